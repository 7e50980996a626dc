//! Queries as the endurance bench draws them.

use super::super::library::{Body, Options, Pose, WarmStart, distance, own, pose, shifted, turned};
use super::query::Query;
use super::table::Table;
use draw::{Draw, Style};
use nalgebra::Vector3;
use std::ops::ControlFlow;
use sublevel_testkit::Seeded;
use sublevel_testkit::catalogue::soak;

#[path = "../../../benches/endurance/draw.rs"]
mod draw;

/// Queries of one pair before the next is drawn.
const ROUND: u32 = 250;

/// The fitted bodies of the bench of instructions.
const FITTED: [&str; 2] = [
    include_str!("../../../benches/instructions/chair-d6.json"),
    include_str!("../../../benches/instructions/human-d6.json"),
];

/// The bodies that the endurance bench needs no fit for, two fitted ones, and smooth bodies that
/// cut each other, which have edges and no closed form.
pub(crate) fn bodies() -> Vec<Body> {
    let mut all: Vec<Body> = soak::bodies().iter().map(|body| own(&body.to_json()).clone()).collect();
    let cut = all.iter().filter(|body| body.name().starts_with('P')).flat_map(|body| {
        [Vector3::new(0.7, 0.7, 0.7), Vector3::new(0.5, 0.3, 1.0)].map(|share| {
            let half = share * body.circumscribed().radius;
            let round = Body::ellipsoid("round", Vector3::zeros(), half).expect("an ellipsoid");
            let constraints = vec![body.constraints()[0].clone(), round.constraints()[0].clone()];
            Body::new("cut", *round.normalization(), constraints).expect("both are bounded")
        })
    });
    let cut: Vec<_> = cut.collect();
    all.extend(cut);
    all.extend(FITTED.map(|json| Body::from_json(json).expect("a body file")));
    all
}

/// Which questions are put.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Others {
    /// The distance that is drawn, and at each fourth pose whether they overlap.
    No,
    /// One that is none of those.
    Yes,
}

/// Puts at least `count` queries: cold, from the answer before, and from hints of other poses.
/// `progress` is given how many there are and can stop it.
pub(crate) fn draws(
    table: &mut Table,
    bodies: &[Body],
    others: Others,
    (seed, count): (u64, u64),
    progress: &mut dyn FnMut(u64) -> ControlFlow<()>,
) -> ControlFlow<()> {
    let mut block = 0;
    while table.queries < count {
        progress(table.queries)?;
        let mut random = Seeded(seed ^ u64::wrapping_mul(block, 0xd134_2543_de82_ef95));
        let other = Query::OTHERS[random.index(Query::OTHERS.len())];
        let mut draw = Draw::new(bodies, &mut random);
        let Draw { a, b, measure, style, batches, .. } = draw;
        let distance = [Query::Distance, Query::Level, Query::Growth].get(measure).copied().unwrap_or(Query::Distance);
        let query = if others == Others::Yes { other } else { distance };
        let (mut warm, mut warm_overlap) = (WarmStart::default(), WarmStart::default());
        for round in 0..ROUND {
            let (pose_a, pose_b, continues) = draw.next();
            // Those of a batch have no hints.
            if batches || !continues && !round.is_multiple_of(4) {
                (warm, warm_overlap) = Default::default();
            }
            let pair = ((a, &pose_a), (b, &pose_b));
            let what = || {
                let pose = |pose: &Pose| {
                    format!("{:?} {:?}", pose.translation().as_slice(), pose.rotation().coords.as_slice())
                };
                format!("{style:?} {}-{}, block {block}, {}, {}", a.name(), b.name(), pose(&pose_a), pose(&pose_b))
            };
            let options = Options::default();
            table.put(query, pair, &options, &mut warm, what);
            if others == Others::No && (round.is_multiple_of(4) || style == Style::Trajectory) {
                table.put(Query::Overlap, pair, &options, &mut warm_overlap, what);
            }
        }
        block += 1;
    }
    ControlFlow::Continue(())
}
