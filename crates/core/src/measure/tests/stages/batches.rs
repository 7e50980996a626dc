//! The lanes of batches.

use super::{at_least, catalogue};
use crate::measure::solver::stages::{Stage, only};
use crate::measure::*;
use sublevel_testkit::Seeded;

/// Lanes answer about as many poses of smooth bodies as continuation from a cold start, and no
/// other stage takes their place.
#[test]
fn lanes_answer_alone() {
    let (mut cases, mut done) = (0, 0);
    for case in catalogue().iter().filter(|case| case.is_smooth() && case.is_apart()) {
        let mut random = Seeded(96_000 + case.seed);
        let poses: [Pose; 16] = std::array::from_fn(|_| {
            let shift = random.unit() * (0.3 * case.distance.lower);
            case.poses[1].with_translation(case.poses[1].translation() + shift)
        });
        let mut answers = [Distance::default(); 16];
        let options = Options::default();
        only(&[Stage::Lanes], || distance_batch(case.a, &case.poses[0], case.b, &poses, &options, &mut answers))
            .unwrap();
        for (answer, pose) in answers.iter().zip(&poses) {
            let single = distance(case.a, &case.poses[0], case.b, pose, &options, &mut WarmStart::default());
            assert!(answer.lower <= single.upper && single.lower <= answer.upper, "seed {}: {answer:?}", case.seed);
            cases += 1;
            done += u32::from(answer.status == Status::Converged);
        }
    }
    assert!(cases >= 500, "{cases} poses");
    at_least("lanes", 64.0, 100.0 * f64::from(done) / f64::from(cases));
}
