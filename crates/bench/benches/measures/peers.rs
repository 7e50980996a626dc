//! GJK of other libraries on the convex hulls: what coal is given, and whether all agree.

use crate::objects::folder;
use crate::rows::{DEGREE, Scene};
use std::error::Error;
use sublevel::measure::{Options, Pose, WarmStart, distance};
use sublevel_bench::comparison::{Coal, CoalRun, PeerError, PeerShape, parry_pose};

/// Answers that contradict each other by more, metres, are reported: ten times the tolerance coal
/// has by default.
const AGREEMENT: f64 = 1e-5;

/// Coal on the hulls and the poses of a scene.
pub(crate) fn start<'a>(coal: &'a Coal, scene: &Scene<'_>) -> Result<CoalRun<'a>, Box<dyn Error>> {
    let name = format!("{}-{}", scene.pair.name, scene.kind.name());
    let hulls = [&scene.pair.a, &scene.pair.b].map(|object| object.hull.as_slice());
    Ok(coal.start(&folder()?, &name, hulls.map(PeerShape::Hull), scene.poses(DEGREE))?)
}

/// Tells where coal, parry and our bodies, which contain the hulls, contradict each other.
pub(crate) fn check(run: &CoalRun<'_>, scene: &Scene<'_>) -> Result<(), PeerError> {
    let (a, b) = scene.pair.bodies(DEGREE);
    let ours = [scene.pair.a.hull.len(), scene.pair.b.hull.len()];
    if let Some(other) = run.vertices().filter(|other| *other != ours) {
        eprintln!("note: coal's hulls of {} have {other:?} vertices, ours {ours:?}", scene.pair.name);
    }
    let (mut differ, mut outside) = (0.0_f64, 0.0_f64);
    for (trajectory, distances) in scene.poses(DEGREE).iter().zip(run.distances()?) {
        for (coal, pose) in distances.into_iter().zip(trajectory) {
            differ = differ.max((coal - scene.hulls.distance(&parry_pose(pose))).abs());
            let ours = distance(a, &Pose::identity(), b, pose, &Options::default(), &mut WarmStart::default());
            outside = outside.max(ours.lower - coal);
        }
    }
    if differ > AGREEMENT {
        eprintln!("note: coal and parry differ by up to {differ:.1e} m");
    }
    if outside > AGREEMENT {
        eprintln!("note: coal's hulls are closer than proven for the bodies around them, by up to {outside:.1e} m");
    }
    Ok(())
}
