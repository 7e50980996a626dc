//! Who is fastest at an accuracy: Pareto fronts, and how many times as fast as their peers ours
//! are.

/// A representation by what it costs and how wrong it is.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Entry {
    /// Name for people.
    pub(super) name: String,
    /// Whether it is ours.
    pub(super) ours: bool,
    /// Mean model error, as a part of the larger diameter; 0 for exact ones.
    pub(super) error: f64,
    /// Time of a query, nanoseconds.
    pub(super) nanoseconds: f64,
}

/// Those that nothing as accurate is faster than, from the most accurate on.
pub(super) fn front<'a>(entries: impl Iterator<Item = &'a Entry>) -> Vec<&'a Entry> {
    let mut all: Vec<&Entry> = entries.filter(|e| e.error.is_finite() && e.nanoseconds.is_finite()).collect();
    all.sort_by(|a, b| a.error.total_cmp(&b.error).then(a.nanoseconds.total_cmp(&b.nanoseconds)));
    let mut fastest = f64::INFINITY;
    all.retain(|entry| {
        let kept = entry.nanoseconds < fastest;
        fastest = fastest.min(entry.nanoseconds);
        kept
    });
    all
}

/// Where ours stand at an accuracy.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Standing {
    /// The fastest of ours that is accurate enough.
    pub(super) ours: String,
    /// Its mean model error.
    pub(super) error: f64,
    /// The fastest peer that is at least as accurate as it.
    pub(super) peer: String,
    /// How many times as fast as that ours is.
    pub(super) times: f64,
    /// How many times as fast as the fastest peer of the error allowed.
    pub(super) allowed: f64,
}

/// The fastest of ours whose error is at most `error`, against peers. Any other of ours is slower:
/// to look among them for one with slower peers would find a millisecond that beats a second.
pub(super) fn standing(entries: &[Entry], error: f64) -> Option<Standing> {
    let fastest = |ours: bool, error: f64| {
        let able = entries.iter().filter(move |e| e.ours == ours && e.error <= error && e.nanoseconds.is_finite());
        able.min_by(|a, b| a.nanoseconds.total_cmp(&b.nanoseconds))
    };
    let ours = fastest(true, error)?;
    let (peer, allowed) = (fastest(false, ours.error)?, fastest(false, error)?);
    Some(Standing {
        ours: ours.name.clone(),
        error: ours.error,
        peer: peer.name.clone(),
        times: peer.nanoseconds / ours.nanoseconds,
        allowed: allowed.nanoseconds / ours.nanoseconds,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(name: &str, ours: bool, error: f64, nanoseconds: f64) -> Entry {
        Entry { name: name.into(), ours, error, nanoseconds }
    }

    #[test]
    fn the_front_falls() {
        let all = [
            entry("hull", false, 0.0, 600.0),
            entry("six", true, 0.02, 250.0),
            entry("slow", true, 0.03, 300.0),
            entry("ball", true, 0.2, 100.0),
            entry("broken", true, f64::NAN, 1.0),
        ];
        let names: Vec<&str> = front(all.iter()).iter().map(|e| e.name.as_str()).collect();
        assert_eq!(names, ["hull", "six", "ball"]);
    }

    #[test]
    fn ours_are_held_against_peers_at_least_as_accurate() {
        let all = [
            entry("hull", false, 0.0, 600.0),
            entry("rough hull", false, 0.03, 400.0),
            entry("six", true, 0.02, 250.0),
            entry("four", true, 0.04, 200.0),
        ];
        let found = standing(&all, 0.05).unwrap();
        assert_eq!((found.ours.as_str(), found.peer.as_str()), ("four", "rough hull"));
        assert!((found.times - 2.0).abs() < 1e-12 && (found.allowed - 2.0).abs() < 1e-12);
        let found = standing(&all, 0.03).unwrap();
        assert_eq!((found.ours.as_str(), found.peer.as_str()), ("six", "hull"));
        assert!((found.times - 2.4).abs() < 1e-12 && (found.allowed - 1.6).abs() < 1e-12);
        assert_eq!(standing(&all, 0.01), None, "none of ours is that accurate");
    }
}
