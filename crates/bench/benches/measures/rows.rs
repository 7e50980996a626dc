//! The rows: one function each, listed in [`all`].

use crate::motion::{self, Kind, Trajectory};
use crate::objects::{DEGREES, Pair, folder};
use crate::sweep::{Answer, Row, Target};
use std::error::Error;
use std::fs;
use sublevel::measure::{
    Distance, ImpactOptions, ImpactStatus, Motion, Options, Pose, Ray, RayCast, Status, WarmStart, cast_ray, distance,
    distance_batch, growth_distance, level_distance, penetration, signed_distance, time_of_impact,
};
use sublevel::polynomial::widest;
use sublevel_bench::comparison::{Hulls, parry_pose};

/// Label of coal's rows.
pub(crate) const COAL_WARM: &str = "coal GJK warm";
pub(crate) const COAL_COLD: &str = "coal GJK cold";
/// Label of parry's row.
pub(crate) const PARRY_COLD: &str = "parry GJK cold";

/// The degree of the peers' poses, and of the rows that are not timed at every degree.
pub(crate) const DEGREE: usize = 6;

/// Most poses of a batch.
const BATCH: usize = 1024;

/// A pair and its poses.
pub(crate) struct Scene<'a> {
    pub(crate) pair: &'a Pair,
    pub(crate) kind: Kind,
    pub(crate) hulls: Hulls,
    /// Where the first body stands: a pose is not made again for each query.
    origin: Pose,
    /// Poses for the bodies of each degree: the same for all, unless grazing.
    poses: Vec<(usize, Vec<Trajectory>)>,
    parry_poses: Vec<Vec<parry3d_f64::math::Pose>>,
    /// From the second body of [`DEGREE`] to the first, in each pose.
    rays: Vec<Vec<Ray>>,
    /// Of both bodies of [`DEGREE`], from each pose on.
    screws: Vec<Vec<(Motion, Motion)>>,
    /// Poses in which the bodies of [`DEGREE`] overlap, where the kind is of contact.
    overlapping: Vec<Trajectory>,
}

impl<'a> Scene<'a> {
    pub(crate) fn new(pair: &'a Pair, kind: Kind, trajectories: usize, poses: usize) -> Result<Self, Box<dyn Error>> {
        let (a, b) = pair.bodies(DEGREE);
        let all: Vec<(usize, Vec<Trajectory>)> = match kind {
            Kind::Separated => {
                let bodies: Vec<_> = DEGREES.iter().map(|&degree| pair.bodies(degree)).collect();
                let shared = motion::separated(&bodies, 1.0, trajectories, poses)?;
                DEGREES.iter().map(|&degree| (degree, shared.clone())).collect()
            }
            // Bodies that differ in size cannot all graze in one pose: each degree walks the same
            // way along its own.
            Kind::Grazing => DEGREES
                .iter()
                .map(|&degree| {
                    let (a, b) = pair.bodies(degree);
                    Ok((degree, motion::grazing(a, b, trajectories, poses)?))
                })
                .collect::<Result<_, Box<dyn Error>>>()?,
            Kind::Contact => vec![(DEGREE, motion::through_contact(a, b, trajectories, poses)?)],
        };
        let mut scene = Self {
            pair,
            kind,
            hulls: Hulls::new(&pair.a.hull, &pair.b.hull)?,
            origin: Pose::identity(),
            poses: all,
            parry_poses: Vec::new(),
            rays: Vec::new(),
            screws: Vec::new(),
            overlapping: Vec::new(),
        };
        if kind == Kind::Contact {
            scene.overlapping = motion::overlapping(a, b, trajectories, poses)?;
        }
        scene.rays = motion::rays(a, b, scene.poses(DEGREE))?;
        scene.screws = motion::screws(a, b, scene.poses(DEGREE))?;
        scene.parry_poses = scene.poses(DEGREE).iter().map(|t| t.iter().map(parry_pose).collect()).collect();
        // For a look at single poses with `sublevel measure --poses`.
        let path = folder()?.join(format!("{}-{}.poses", pair.name, kind.name()));
        fs::write(&path, motion::to_text(scene.poses(DEGREE)))
            .map_err(|error| format!("{}: {error}", path.display()))?;
        Ok(scene)
    }

    /// The poses for bodies of this degree.
    pub(crate) fn poses(&self, degree: usize) -> &[Trajectory] {
        self.poses.iter().find(|(known, _)| *known == degree).map_or(&[], |(_, poses)| poses)
    }

    /// Figures are for separated bodies; grazing ones may take twice as long.
    fn part(&self, of: &'static str, part: f64) -> Target {
        Target::PartOf(of, if self.kind == Kind::Grazing { 2.0 * part } else { part })
    }

    /// The rule that a distance takes at most twice the time when the bodies graze.
    fn near_as_far(&self, row: Row<'a>) -> Row<'a> {
        if self.kind == Kind::Grazing { row.at_most(Target::OfSeparated(2.0)) } else { row }
    }
}

/// All rows of a table.
pub(crate) fn all<'a>(scene: &'a Scene<'a>) -> Vec<Row<'a>> {
    if scene.kind == Kind::Contact {
        return vec![signed_warm(scene), penetration_cold(scene), growth_warm(scene)];
    }
    let mut rows = Vec::new();
    rows.extend(DEGREES.map(|degree| distance_warm(scene, degree)));
    rows.extend(DEGREES.map(|degree| distance_cold(scene, degree)));
    rows.push(distance_batches(scene));
    rows.push(level_warm(scene));
    rows.push(level_cold(scene));
    rows.push(growth_warm(scene));
    rows.push(signed_warm(scene));
    rows.push(ray_cast(scene));
    rows.push(impact(scene));
    rows.push(parry_cold(scene));
    rows.push(parry_warm(scene));
    rows
}

fn distance_warm<'a>(scene: &'a Scene<'a>, degree: usize) -> Row<'a> {
    let (a, b) = scene.pair.bodies(degree);
    let options = Options::default();
    let origin = &scene.origin;
    let row = Row::warm(format!("distance warm, degree {degree}"), scene.poses(degree), move |pose, warm| {
        let answer = distance(a, origin, b, pose, &options, warm);
        Answer::new(answer.iterations, answer.status, answer.lower <= 0.0)
    });
    let part = match degree {
        2 => 0.2,
        4 => 0.3,
        6 => 0.45,
        _ => 0.9,
    };
    let row = row
        .at_most(scene.part(COAL_WARM, part))
        .at_most(Target::MeanIterations(2.0))
        .at_most(Target::MostIterations(30));
    let row = if degree == DEGREE { row.at_most(scene.part(PARRY_COLD, 0.1)) } else { row };
    scene.near_as_far(row)
}

fn distance_cold<'a>(scene: &'a Scene<'a>, degree: usize) -> Row<'a> {
    let (a, b) = scene.pair.bodies(degree);
    let options = Options::default();
    let origin = &scene.origin;
    let row = Row::cold(format!("distance cold, degree {degree}"), scene.poses(degree), move |pose| {
        let answer = distance(a, origin, b, pose, &options, &mut WarmStart::default());
        Answer::new(answer.iterations, answer.status, answer.lower <= 0.0)
    });
    let row = row.at_most(Target::MostIterations(30));
    let row = if degree == DEGREE { row.at_most(scene.part(COAL_COLD, 0.9)) } else { row };
    scene.near_as_far(row)
}

/// Consecutive poses, cold, as many at a time as the figures ask.
fn distance_batches<'a>(scene: &'a Scene<'a>) -> Row<'a> {
    let (a, b) = scene.pair.bodies(DEGREE);
    let options = Options::default();
    let origin = &scene.origin;
    let batch = move |poses: &[Pose], answers: &mut [Distance]| {
        distance_batch(a, origin, b, poses, &options, answers).expect("there are poses, and places for answers");
    };
    let judge = |answer: &Distance| Answer::new(answer.iterations, answer.status, answer.lower <= 0.0);
    let apart = if widest() == "AVX-512" { 120.0 } else { 200.0 };
    let nanoseconds = if scene.kind == Kind::Grazing { 2.0 * apart } else { apart };
    Row::batches(format!("distance batches, degree {DEGREE}"), scene.poses(DEGREE), BATCH, batch, judge)
        .at_most(Target::Nanoseconds(nanoseconds))
        // The same figure on a machine of any speed.
        .at_most(scene.part(COAL_WARM, (1e3 * apart / scene.pair.coal_warm).round() / 1e3))
        .at_most(Target::MostIterations(30))
}

fn level_warm<'a>(scene: &'a Scene<'a>) -> Row<'a> {
    let (a, b) = scene.pair.bodies(DEGREE);
    let options = Options::default();
    let origin = &scene.origin;
    Row::warm(format!("level distance warm, degree {DEGREE}"), scene.poses(DEGREE), move |pose, warm| {
        let answer = level_distance(a, origin, b, pose, &options, warm);
        Answer::new(answer.iterations, answer.status, answer.upper <= 1.0)
    })
    .at_most(scene.part(COAL_WARM, 0.35))
    .at_most(Target::MeanIterations(2.0))
    .at_most(Target::MostIterations(30))
}

fn level_cold<'a>(scene: &'a Scene<'a>) -> Row<'a> {
    let (a, b) = scene.pair.bodies(DEGREE);
    let options = Options::default();
    let origin = &scene.origin;
    Row::cold(format!("level distance cold, degree {DEGREE}"), scene.poses(DEGREE), move |pose| {
        let answer = level_distance(a, origin, b, pose, &options, &mut WarmStart::default());
        Answer::new(answer.iterations, answer.status, answer.upper <= 1.0)
    })
    .at_most(Target::MostIterations(30))
}

fn growth_warm<'a>(scene: &'a Scene<'a>) -> Row<'a> {
    let (a, b) = scene.pair.bodies(DEGREE);
    let options = Options::default();
    let origin = &scene.origin;
    Row::warm(format!("growth distance warm, degree {DEGREE}"), scene.poses(DEGREE), move |pose, warm| {
        let answer = growth_distance(a, origin, b, pose, &options, warm);
        Answer::new(answer.iterations, answer.status, answer.lower <= 1.0)
    })
    .at_most(Target::Nanoseconds(600.0))
}

fn signed_warm<'a>(scene: &'a Scene<'a>) -> Row<'a> {
    let (a, b) = scene.pair.bodies(DEGREE);
    let options = Options::default();
    let origin = &scene.origin;
    Row::warm(format!("signed distance warm, degree {DEGREE}"), scene.poses(DEGREE), move |pose, warm| {
        let answer = signed_distance(a, origin, b, pose, &options, warm);
        Answer::new(answer.iterations, answer.status, answer.lower <= 0.0)
    })
}

fn penetration_cold<'a>(scene: &'a Scene<'a>) -> Row<'a> {
    let (a, b) = scene.pair.bodies(DEGREE);
    let options = Options::default();
    let origin = &scene.origin;
    Row::cold(format!("penetration cold, degree {DEGREE}"), &scene.overlapping, move |pose| {
        let answer = penetration(a, origin, b, pose, &options, &mut WarmStart::default());
        Answer::new(answer.iterations, answer.status, answer.upper > 0.0)
    })
    .at_most(Target::Nanoseconds(50_000.0))
}

fn ray_cast<'a>(scene: &'a Scene<'a>) -> Row<'a> {
    let (a, _) = scene.pair.bodies(DEGREE);
    let options = Options::default();
    let origin = &scene.origin;
    Row::cold(format!("ray cast, hits, degree {DEGREE}"), &scene.rays, move |ray| {
        match cast_ray(a, origin, ray, &options) {
            RayCast::Hit(hit) => Answer::new(hit.iterations, hit.status, hit.upper == 0.0),
            _ => Answer::new(0, Status::BracketWide, false),
        }
    })
    .at_most(Target::Nanoseconds(500.0))
}

/// Counts distance queries and evaluations of a separating plane as iterations.
fn impact<'a>(scene: &'a Scene<'a>) -> Row<'a> {
    let (a, b) = scene.pair.bodies(DEGREE);
    let options = ImpactOptions::new(2.0).expect("two seconds are a duration");
    Row::cold(format!("time of impact, degree {DEGREE}"), &scene.screws, move |(of_a, of_b)| {
        let answer = time_of_impact(a, of_a, b, of_b, &options);
        Answer {
            iterations: Some(answer.queries),
            failed: answer.status == ImpactStatus::Stopped,
            overlap: answer.status == ImpactStatus::Contact,
        }
    })
    .at_most(Target::MedianIterations(20))
}

fn parry_cold<'a>(scene: &'a Scene<'a>) -> Row<'a> {
    Row::cold(PARRY_COLD, &scene.parry_poses, move |pose| scene.hulls.cold(pose))
}

/// Parry's warm form: the direction between the closest points before.
fn parry_warm<'a>(scene: &'a Scene<'a>) -> Row<'a> {
    Row::warm("parry GJK warm", &scene.parry_poses, move |pose, direction| scene.hulls.warm(pose, direction))
}
