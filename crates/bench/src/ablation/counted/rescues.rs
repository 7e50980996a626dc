//! The queries that stages were made for.

use super::super::library::{Options, Pose, WarmStart, own};
use super::query::Query;
use super::table::Table;
use sublevel_testkit::catalogue::rescues::{Ask, Place, all};

/// Puts the queries that commits and tests name as rescued by some stage.
pub(crate) fn rescues(table: &mut Table) {
    let placed = |[a, b]: [Place; 2]| [a, b].map(|(t, q)| Pose::from_quaternion(t.into(), q).expect("a pose"));
    for rescue in all() {
        let (a, b) = (own(&rescue.a.to_json()), own(&rescue.b.to_json()));
        let query = match rescue.ask {
            Ask::Distance => Query::Distance,
            Ask::Level => Query::Level,
            Ask::Growth => Query::Growth,
        };
        let (options, mut warm) = (Options::default(), WarmStart::default());
        if let Some([pose_a, pose_b]) = rescue.before.map(placed) {
            query.solve(((a, &pose_a), (b, &pose_b)), &options, &mut warm);
        }
        let [pose_a, pose_b] = placed(rescue.at);
        table.put(query, ((a, &pose_a), (b, &pose_b)), &options, &mut warm, || rescue.what.clone());
    }
}
