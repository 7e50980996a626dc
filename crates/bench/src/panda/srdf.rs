//! The SRDF of the arm beside what is proven of its pairs of links.

use std::error::Error;
use std::ops::ControlFlow;
use std::time::Instant;

use sublevel::robot::motion::{DeriveOptions, PairClass};
use sublevel::robot::read_srdf;
use sublevel::scene::DerivedLinks;

use super::arm::Arm;
use super::representation::{LoadedArm, Representation};
use super::rows::SrdfRow;

/// What an SRDF calls pairs that no sample had in contact.
const NEVER: &str = "Never";

/// Looks at every pair of links.
///
/// # Errors
/// An SRDF that cannot be read.
pub(super) fn measure(arm: &Arm, links: Representation, loaded: &LoadedArm) -> Result<SrdfRow, Box<dyn Error>> {
    let start = Instant::now();
    let derived = loaded.robot.derive_pairs(0.0, &DeriveOptions::default(), &mut |_| ControlFlow::Continue(()))?;
    let seconds = start.elapsed().as_secs_f64();
    let semantics = read_srdf(&arm.srdf, &arm.description).map_err(|error| format!("panda.srdf: {error}"))?;
    let name = |link: usize| arm.kinematics.links()[link].clone();
    let place = |link: usize| arm.description.links.iter().position(|described| described.name == name(link));
    let reason = |pair: &DerivedLinks| {
        let [a, b] = pair.links.map(place);
        let (a, b) = (a?.min(b?), a?.max(b?));
        let disabled = semantics.disabled_pairs.iter().find(|disabled| (disabled.first, disabled.second) == (a, b));
        disabled.map(|disabled| disabled.reason.to_string())
    };
    let never: Vec<_> = derived.iter().filter(|pair| reason(pair).as_deref() == Some(NEVER)).collect();
    let proven = never.iter().filter(|pair| pair.pair.class == PairClass::Never).count();
    let wrong: Vec<_> = never.iter().filter(|pair| pair.pair.class == PairClass::Collides).collect();
    let words = |pair: &&&DerivedLinks| pair.links.map(|link| name(link).to_string()).join(" and ");
    let deepest = wrong.iter().min_by(|a, b| a.pair.upper_m.total_cmp(&b.pair.upper_m));
    let witness = deepest.and_then(|pair| pair.pair.witness.clone()).unwrap_or_default();
    Ok(SrdfRow {
        representation: links.name().into(),
        pairs: derived.len(),
        never: never.len(),
        proven,
        wrong: wrong.iter().map(words).collect::<Vec<_>>().join("; "),
        overlap_m: deepest.map_or(f64::NAN, |pair| -pair.pair.upper_m),
        witness: witness.iter().map(|value| format!("{value:.4}")).collect::<Vec<_>>().join(" "),
        is_certain: deepest.is_some_and(|pair| pair.is_certain),
        boxes: derived.iter().map(|pair| u64::from(pair.pair.boxes)).sum(),
        seconds,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::FitCache;
    use sublevel_testkit::data;

    #[test]
    #[ignore = "needs SUBLEVEL_DATA"]
    fn one_pair_of_the_srdf_is_wrong_and_all_others_are_proven() {
        let arm = Arm::read(&data("")).expect("the files of the arm");
        let folder = tempfile::tempdir().expect("a folder");
        let loaded =
            arm.load(Representation::Default, &FitCache::new(folder.path()).expect("a folder")).expect("bodies");
        let row = measure(&arm, Representation::Default, &loaded).expect("looked at");
        println!("{row:?}");
        assert_eq!((row.pairs, row.never, row.proven), (55, 23, 22));
        assert_eq!((row.wrong.as_str(), row.is_certain), ("panda_link2 and panda_link6", true));
        assert!(row.overlap_m > 0.05 && row.witness.split(' ').count() == 7);
    }
}
