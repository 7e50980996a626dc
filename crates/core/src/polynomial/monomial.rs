//! Monomials in three variables, in the graded order the evaluation table is laid out in.

/// Exponents of a monomial `z1^e1 z2^e2 z3^e3`.
pub type Exponents = [u8; 3];

/// Total degree of a monomial.
pub fn degree_of(exponents: Exponents) -> usize {
    exponents.iter().map(|&e| usize::from(e)).sum()
}

/// Number of monomials of degree at most `degree`: C(degree + 3, 3).
pub(crate) const fn count(degree: usize) -> usize {
    (degree + 1) * (degree + 2) * (degree + 3) / 6
}

/// All monomials of degree at most `max_degree`, by degree, within a degree from `z1^t` to `z3^t`.
///
/// Each degree's block follows from the one before: all of it times z1, its z1-free tail times z2,
/// its last times z3. `fill` computes the values in the same order.
pub fn monomials(max_degree: usize) -> Vec<Exponents> {
    let mut list = Vec::with_capacity(count(max_degree));
    for total in 0..=max_degree as u8 {
        for e1 in (0..=total).rev() {
            for e2 in (0..=total - e1).rev() {
                list.push([e1, e2, total - e1 - e2]);
            }
        }
    }
    list
}

/// Where a monomial stands in the order of [`monomials`], whatever their highest degree.
pub fn position(exponents: Exponents) -> usize {
    let [total, tail] = [degree_of(exponents), usize::from(exponents[1]) + usize::from(exponents[2])];
    total * (total + 1) * (total + 2) / 6 + tail * (tail + 1) / 2 + usize::from(exponents[2])
}

/// Values of all monomials of degree at most `degree` <= 6 at `z`, in the order of [`monomials`];
/// `K` is their number and the first of `values` is 1 already.
///
/// A monomial of degree t costs t - 1 multiplications in sequence, hence at most t - 1 roundings.
/// With a constant degree every loop unrolls.
#[inline(always)]
pub(super) fn fill<const K: usize>(degree: usize, z: [f64; 3], values: &mut [f64; K]) {
    debug_assert!(K == count(degree) && degree <= 6);
    if degree >= 2 {
        block::<1, K>(z, values);
        block::<2, K>(z, values);
    }
    if degree >= 4 {
        block::<3, K>(z, values);
        block::<4, K>(z, values);
    }
    if degree >= 6 {
        block::<5, K>(z, values);
        block::<6, K>(z, values);
    }
}

/// The monomials of degree `TOTAL` from those of one degree less.
#[inline(always)]
fn block<const TOTAL: usize, const K: usize>(z: [f64; 3], values: &mut [f64; K]) {
    let size = TOTAL * (TOTAL + 1) / 2;
    let (known, next) = values.split_at_mut(count(TOTAL - 1));
    let previous = &known[count(TOTAL - 1) - size..];
    let (times_first, rest) = next.split_at_mut(size);
    for (value, previous) in times_first.iter_mut().zip(previous) {
        *value = z[0] * *previous;
    }
    for (value, previous) in rest[..TOTAL].iter_mut().zip(&previous[size - TOTAL..]) {
        *value = z[1] * *previous;
    }
    rest[TOTAL] = z[2] * previous[size - 1];
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_follow_the_order_of_the_list() {
        let z = [1.5, -0.75, 0.3125];
        let mut values = [1.0; 84];
        fill::<84>(6, z, &mut values);
        for (exponents, value) in monomials(6).into_iter().zip(values) {
            let direct: f64 = (0..3).map(|i| z[i].powi(i32::from(exponents[i]))).product();
            assert!((value - direct).abs() <= 1e-14 * direct.abs(), "{exponents:?}: {value} against {direct}");
        }
    }

    #[test]
    fn positions_are_those_of_the_list() {
        assert!(monomials(12).into_iter().enumerate().all(|(place, e)| position(e) == place));
    }

    #[test]
    fn counts_match() {
        for degree in 0..=8 {
            assert_eq!(monomials(degree).len(), count(degree));
        }
    }
}
