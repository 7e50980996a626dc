//! The cases of the stability catalogue that ask for a distance.

use super::super::library::{Options, WarmStart, own, pose};
use super::query::Query;
use super::table::Table;
use sublevel_testkit::Seeded;
use sublevel_testkit::bodies;
use sublevel_testkit::catalogue::{Case, contact, placement, scale};

/// Puts the cases, at their accuracies, as distances of all kinds and as a decision: at most
/// `count` of each family.
pub(crate) fn families(table: &mut Table, count: u64) {
    let zoo = bodies::zoo();
    let mut put = |family: u8, cases: &mut dyn Iterator<Item = Vec<Case>>| {
        for case in cases.flatten() {
            let (a, b) = (own(&case.a.to_json()), own(&case.b.to_json()));
            let (pose_a, pose_b) = (
                pose(*case.pose_a.translation(), case.pose_a.rotation()),
                pose(*case.pose_b.translation(), case.pose_b.rotation()),
            );
            let options = Options::default().with_accuracy(case.accuracy).expect("in range");
            let what = || format!("family {family}, {}", case.what);
            for query in Query::DISTANCES {
                table.put(query, ((a, &pose_a), (b, &pose_b)), &options, &mut WarmStart::default(), what);
            }
        }
    };
    let random = |family: u64, index: u64| Seeded(1_000_000 * family + index);
    put(1, &mut (0..count.min(contact::KISSING)).map(|i| contact::kissing(i, None)));
    put(3, &mut (0..count.min(contact::PARALLEL_FACES)).map(|i| vec![contact::parallel_faces(i)]));
    put(5, &mut (0..count).map(|i| vec![placement::common_point(&zoo, &mut random(5, i))]));
    put(6, &mut (0..count.min(placement::ALONG_AN_AXIS)).map(|i| vec![placement::along_an_axis(i)]));
    put(
        7,
        &mut (0..count).map(|i| {
            let (mut random, i) = (random(7, i), i as usize);
            let (a, b) = (&zoo[i % zoo.len()], &zoo[i / 2 % zoo.len()]);
            vec![placement::concentric(a, b, placement::OFFSETS[i % 8], &mut random)]
        }),
    );
    put(8, &mut (0..count).map(|i| vec![contact::touching(contact::TOUCHING[i as usize % 5], &mut random(8, i))]));
    put(9, &mut (0..count).map(|i| scale::ratio(i, &mut random(9, i)).into()));
    put(10, &mut (0..count).map(|i| scale::far_from_the_origin(i as i32 % 10, &mut random(10, i)).into()));
    put(
        12,
        &mut (0..count).map(|i| {
            let (k, aspect) = (i as usize, 10_f64.powi(2 + (i % 4) as i32));
            let pair = (k / 4 % scale::NEEDLES, k / 20 % scale::PARTNERS);
            scale::needles(aspect, pair, k / 140 % scale::NEEDLE_SETTINGS, &mut random(12, i))
        }),
    );
    put(13, &mut (0..count.min(contact::PARALLEL_FLATS)).map(|i| vec![contact::parallel_flats(i)]));
    put(14, &mut (0..count.min(contact::TIPS)).map(|i| vec![contact::tips(i, &mut random(14, i))]));
    put(15, &mut (0..count).map(|i| vec![contact::smooth(i, &mut random(15, i))]));
}
