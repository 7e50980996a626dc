//! How far in time the chord of a gap proves it open.

/// The time from t_0 up to which the gap stays positive, from its lower bounds at both ends and
/// that of its acceleration; t_1 if that is all the way.
pub(super) fn advance(t_0: f64, t_1: f64, first: f64, last: f64, acceleration: f64) -> f64 {
    let step = t_1 - t_0;
    let bend = 0.5 * acceleration * step * step * (1.0 + 1e-12);
    // first - fall u + bend u² with its first root in a form without cancellation.
    let fall = first - last + bend;
    let discriminant = fall * fall - 4.0 * bend * first;
    if last > 0.0 && (fall <= 0.0 || discriminant < -1e-12 * fall * fall) {
        return t_1;
    }
    let u = 2.0 * first / (fall + discriminant.max(0.0).sqrt()) * (1.0 - 1e-11);
    // Not `<`: a NaN proves nothing.
    if last > 0.0 && u >= 1.0 {
        t_1
    } else if u > 0.0 {
        (t_0 + u.min(1.0) * step).next_down().max(t_0)
    } else {
        t_0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sublevel_testkit::Seeded;

    #[test]
    fn chords_bound_what_they_span() {
        for seed in 0..2000 {
            let mut random = Seeded(seed);
            // s(t) = a + b t + c cos(w t + p) has |s''| <= |c| w².
            let (a, b, c) = (random.signed() + 1.0, random.signed(), random.signed());
            let (w, p) = (3.0 * random.signed().abs(), 3.0 * random.signed());
            let s = |t: f64| a + b * t + c * (w * t + p).cos();
            let (t_0, t_1) = (random.signed(), 2.0 + random.signed());
            if s(t_0) > 0.0 {
                let safe = advance(t_0, t_1, s(t_0), s(t_1), c.abs() * w * w);
                assert!(safe >= t_0 && safe <= t_1, "seed {seed}: {safe}");
                for k in 0..500 {
                    let t = t_0 + (safe - t_0) * f64::from(k) / 500.0;
                    assert!(s(t) > 0.0, "seed {seed}: {} at {t} of {safe}", s(t));
                }
            }
        }
    }
}
