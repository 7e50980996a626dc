//! What is on disk does not change without a new number: rows of each format as they were written.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::Vector3;
use redb::{ReadableTable, TableDefinition, WriteTransaction};

use super::{Disk, at, ball, placed};
use crate::body::Shape;
use crate::measure::HalfSpace;
use crate::scene::{
    Attach, Attachment, Geometry, Ladder, NamedHalfSpace, NamedJointValues, PlaceRobot, Placement, Subject, Update,
};
use crate::store::rows::{
    BODIES, FORMAT, INSTANCES, JOBS, LADDERS, META, OBJECTS, RESERVES, REVISIONS, ROBOTS, SCENES,
};
use crate::store::{Catalogue, FitOutcome, JobOutcome, JobState, RobotSource, StoreError};

/// Rows of format 3: key and value of each table, values as text.
const FORMAT_3: &str = include_str!("format_3.json");

/// Rows of format 4, which knew no robots.
const FORMAT_4: &str = include_str!("format_4.json");

/// Rows of format 5.
const FORMAT_5: &str = include_str!("format_5.json");

/// All formats that are read, with their rows.
pub(super) const FORMATS: [(u64, &str); 3] = [(3, FORMAT_3), (4, FORMAT_4), (5, FORMAT_5)];

/// A robot of two links of primitives, one of which a body replaces.
const URDF: &str = r#"<robot name="arm">
  <link name="base"><collision><geometry><sphere radius="0.5"/></geometry></collision></link>
  <link name="tool"><collision><geometry><mesh filename="tool.stl"/></geometry></collision></link>
  <joint name="turn" type="continuous"><parent link="base"/><child link="tool"/><origin xyz="0 0 2"/></joint>
</robot>"#;

pub(super) type Rows = BTreeMap<String, BTreeMap<String, String>>;

/// A robot in two scenes.
fn fill_robots(catalogue: &Catalogue) {
    let bodies = BTreeMap::from([("tool".into(), *ball(0.5).id())]);
    let source = RobotSource { urdf: URDF.into(), srdf: "<robot name=\"arm\"/>".into(), bodies };
    let (loaded, created) = catalogue.load_robot(source).expect("a robot");
    assert!(created);
    catalogue.create_scene("hall").expect("made");
    let joints = NamedJointValues { joints: vec!["turn".into()], values: vec![0.25] };
    let placed = PlaceRobot { name: "arm".into(), robot: loaded.robot.clone(), base: at(0.5), joints };
    let attachment = Attachment { to: "arm/tool".into(), pose: at(1.0), touch: Vec::new() };
    let held = Placement {
        name: "held".into(),
        body: *ball(0.5).id(),
        pose: None,
        group: "".into(),
        padding_m: None,
        attachment: Some(attachment),
    };
    let update = Update {
        upserts: vec![held],
        robots: vec![placed],
        object_paddings: vec![("arm/base".into(), Some(0.125))],
        ..Update::default()
    };
    catalogue.update_scene("hall", &update).expect("placed");
}

/// Something of every kind but robots.
fn fill(catalogue: &Catalogue) {
    let balls = [1.0, 0.75].map(|radius| {
        let body = ball(radius).with_points(&[Vector3::new(0.5, 0.0, 0.0)]).expect("inside");
        Arc::new(Shape::Body(Box::new(body)))
    });
    let ladder = Ladder::new("ladder", balls.to_vec()).expect("a ladder");
    catalogue.create_body(Geometry::Ladder(Arc::new(ladder))).expect("stored");
    let floor =
        NamedHalfSpace::new("floor", HalfSpace::new(Vector3::z(), 0.0).expect("a half-space")).expect("a floor");
    catalogue.create_body(Geometry::HalfSpace(Arc::new(floor.clone()))).expect("stored");
    catalogue.create_body(ball(0.5).into()).expect("stored");
    catalogue.create_scene("room").expect("made");
    catalogue.update_scene("room", &placed("o", &ball(0.5))).expect("placed");
    let held = Placement {
        name: "held".into(),
        body: *ball(0.5).id(),
        pose: Some(at(1.5)),
        group: "tools".into(),
        padding_m: None,
        attachment: None,
    };
    let ground = Placement { name: "ground".into(), body: *floor.id(), ..held.clone() };
    let (object, group) = (|name: &str| Subject::Object(name.into()), Subject::Group("tools".into()));
    let touch = vec![group.clone()];
    let update = Update {
        upserts: vec![held, ground],
        allow: vec![(object("o"), object("ground"))],
        group_paddings: vec![("tools".into(), Some(0.01))],
        pair_paddings: vec![((object("o"), group), Some(0.125))],
        ..Update::default()
    };
    catalogue.update_scene("room", &update).expect("placed");
    let attach = vec![Attach { name: "held".into(), to: "o".into(), pose: None, touch }];
    catalogue.update_scene("room", &Update { attach, ..Update::default() }).expect("held");
    catalogue.create_job(super::jobs::job("request")).expect("queued");
    catalogue.create_job(super::jobs::solve("solve", [&ball(0.5), &ball(1.0)])).expect("queued");
}

fn text_rows(transaction: &WriteTransaction) -> Rows {
    let mut rows = Rows::new();
    for (name, definition) in [("bodies", BODIES), ("ladders", LADDERS), ("scenes", SCENES), ("robots", ROBOTS)] {
        let table = transaction.open_table(definition).expect("a table");
        let text = |value: &[u8]| String::from_utf8(value.to_vec()).expect("text");
        let all = table.iter().expect("rows").map(|row| row.expect("a row"));
        rows.insert(name.into(), all.map(|(key, value)| (key.value().to_owned(), text(value.value()))).collect());
    }
    for (name, definition) in [("meta", META), ("revisions", REVISIONS), ("reserves", RESERVES)] {
        let table = transaction.open_table(definition).expect("a table");
        let all = table.iter().expect("rows").map(|row| row.expect("a row"));
        rows.insert(name.into(), all.map(|(key, value)| (key.value().to_owned(), value.value().to_string())).collect());
    }
    for (name, definition) in [("objects", OBJECTS), ("instances", INSTANCES)] {
        let table = transaction.open_table(definition).expect("a table");
        let all = table.iter().expect("rows").map(|row| row.expect("a row")).map(|(key, value)| {
            let (scene, name) = key.value();
            (format!("{scene}/{name}"), String::from_utf8(value.value().to_vec()).expect("text"))
        });
        rows.insert(name.into(), all.collect());
    }
    let jobs = transaction.open_table(JOBS).expect("a table");
    let jobs = jobs.iter().expect("rows").map(|row| row.expect("a row"));
    let jobs =
        jobs.map(|(key, value)| (key.value().to_string(), String::from_utf8(value.value().to_vec()).expect("text")));
    rows.insert("jobs".into(), jobs.collect());
    rows
}

pub(super) fn write_rows(transaction: &WriteTransaction, rows: &Rows) {
    let put = |definition: TableDefinition<&str, &[u8]>, name: &str| {
        let mut table = transaction.open_table(definition).expect("a table");
        for (key, value) in rows.get(name).into_iter().flatten() {
            table.insert(key.as_str(), value.as_bytes()).expect("written");
        }
    };
    put(ROBOTS, "robots");
    put(BODIES, "bodies");
    put(LADDERS, "ladders");
    put(SCENES, "scenes");
    for (name, definition) in [("meta", META), ("revisions", REVISIONS), ("reserves", RESERVES)] {
        let mut table = transaction.open_table(definition).expect("a table");
        for (key, value) in &rows[name] {
            table.insert(key.as_str(), value.parse::<u64>().expect("a number")).expect("written");
        }
    }
    for (name, definition) in [("objects", OBJECTS), ("instances", INSTANCES)] {
        let mut table = transaction.open_table(definition).expect("a table");
        for (key, value) in rows.get(name).into_iter().flatten() {
            table.insert(key.split_once('/').expect("scene and name"), value.as_bytes()).expect("written");
        }
    }
    let mut jobs = transaction.open_table(JOBS).expect("a table");
    for (key, value) in &rows["jobs"] {
        jobs.insert(key.parse::<u64>().expect("a number"), value.as_bytes()).expect("written");
    }
}

/// `UPDATE_FORMAT=1` writes the rows again, which is right only together with a new number.
#[test]
fn rows_are_written_as_format_5_has_them() {
    let disk = Disk::default();
    let catalogue = disk.load().expect("a new catalogue");
    fill(&catalogue);
    fill_robots(&catalogue);
    drop(catalogue);
    let mut written = Rows::new();
    disk.meddle(|transaction| written = text_rows(transaction));
    if std::env::var_os("UPDATE_FORMAT").is_some() {
        let text = serde_json::to_string_pretty(&written).expect("text") + "\n";
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/src/store/tests/format_5.json");
        std::fs::write(path, text).expect("written");
        return;
    }
    let known = rows_in(FORMAT_5);
    assert_eq!((FORMAT, &written["meta"]), (5, &known["meta"]));
    for (table, rows) in &known {
        for (key, row) in rows {
            assert_eq!(written[table].get(key), Some(row), "{table} {key}: give the format a new number");
        }
        assert_eq!(written[table].len(), rows.len(), "{table}");
    }
}

fn rows_in(text: &str) -> Rows {
    serde_json::from_str(text).expect("rows")
}

/// A disk with these rows.
fn holding(rows: &Rows) -> Disk {
    let disk = Disk::default();
    drop(disk.load().expect("a new catalogue"));
    disk.meddle(|transaction| write_rows(transaction, rows));
    disk
}

#[test]
fn rows_of_format_5_are_read() {
    let read = holding(&rows_in(FORMAT_5)).load().expect("loads");
    holds_what_was_filled_in(&read);
    holds_robots(&read);
}

/// All that [`fill_robots`] makes, and the jobs of [`fill`].
pub(super) fn holds_robots(read: &Catalogue) {
    let whole = Disk::default().load().expect("a new catalogue");
    fill(&whole);
    fill_robots(&whole);
    let [found, made] = [read, &whole].map(|catalogue| catalogue.scene("hall").expect("there"));
    assert_eq!((found.revision(), found.len()), (made.revision(), 3));
    for (slot, object, pose) in made.objects() {
        let other = found.slot(&object.name).expect("there");
        assert_eq!((found.pose(other), made.padding_m(slot, slot)), (Some(pose), found.padding_m(other, other)));
    }
    let [found, made] = [&found, &made].map(|scene| scene.robot("arm").expect("there"));
    assert_eq!((found.base(), found.configuration()), (made.base(), made.configuration()));
    assert_eq!((found.robot().id(), found.configuration()), (made.robot().id(), &[0.25][..]));
    assert_eq!(read.jobs(None, 9).0, whole.jobs(None, 9).0);
}

/// Opening a file writes it in the present format, once.
#[test]
fn rows_of_format_4_are_read_and_written_as_those_of_format_5() {
    let disk = holding(&rows_in(FORMAT_4));
    for _ in 0..2 {
        holds_what_was_filled_in(&disk.load().expect("loads"));
    }
    let mut written = Rows::new();
    disk.meddle(|transaction| written = text_rows(transaction));
    assert_eq!(written, in_format_5(FORMAT_4));

    // A full disk leaves it as it was.
    let disk = holding(&rows_in(FORMAT_4));
    disk.set_full(true);
    assert!(matches!(disk.load(), Err(StoreError::Full { .. })));
    disk.set_full(false);
    holds_what_was_filled_in(&disk.load().expect("loads"));
}

/// The same rows with another number, and without robots.
fn in_format_5(rows: &str) -> Rows {
    let mut rows = rows_in(rows);
    rows.get_mut("meta").expect("meta").insert("format".into(), "5".into());
    rows.extend([("robots".into(), BTreeMap::new()), ("instances".into(), BTreeMap::new())]);
    rows
}

/// Opening a file writes it in the present format, once.
#[test]
fn rows_of_format_3_are_read_and_written_as_those_of_format_5() {
    let disk = holding(&rows_in(FORMAT_3));
    for _ in 0..2 {
        holds_what_was_filled_in(&disk.load().expect("loads"));
    }
    let mut written = Rows::new();
    disk.meddle(|transaction| written = text_rows(transaction));
    let mut known = in_format_5(FORMAT_4);
    known.get_mut("jobs").expect("jobs").remove("2").expect("the solve, which format 3 has not");
    assert_eq!(written, known);

    // A full disk leaves it as it was.
    let disk = holding(&rows_in(FORMAT_3));
    disk.set_full(true);
    assert!(matches!(disk.load(), Err(StoreError::Full { .. })));
    disk.set_full(false);
    holds_what_was_filled_in(&disk.load().expect("loads"));
}

#[test]
fn jobs_of_format_3_are_read_in_every_state() {
    let with_job = |change: &dyn Fn(&str) -> String| {
        let mut rows = rows_in(FORMAT_3);
        let row = rows.get_mut("jobs").and_then(|jobs| jobs.get_mut("1")).expect("a job");
        *row = change(row);
        holding(&rows)
    };
    let made = FitOutcome { bodies: Vec::new(), ladder: None, left_out: 2, left_out_m: 0.1 };
    for (state, expected) in [
        (r#""queued""#, JobState::Queued),
        (r#""running""#, JobState::Running),
        (r#"{"succeeded":{"bodies":[],"left_out":2,"left_out_m":0.1}}"#, JobState::Succeeded(JobOutcome::Fit(made))),
        (r#"{"failed":"why"}"#, JobState::Failed("why".into())),
        (r#""cancelled""#, JobState::Cancelled),
    ] {
        let disk = with_job(&|row| row.replace(r#""state":"queued""#, &format!(r#""state":{state}"#)));
        assert_eq!(disk.load().expect("loads").job(1).expect("there").state, expected);
    }
    let error = with_job(&|row| row[..row.len() / 2].to_owned()).load().expect_err("half a row").to_string();
    assert!(error.contains("job 1") && error.contains("damaged"), "{error}");
}

/// All that [`fill`] makes, but for jobs that earlier formats do not have.
pub(super) fn holds_what_was_filled_in(read: &Catalogue) {
    let whole = Disk::default().load().expect("a new catalogue");
    fill(&whole);
    let ids = |catalogue: &Catalogue| catalogue.bodies(None, 99).0.iter().map(|body| *body.id()).collect::<Vec<_>>();
    assert_eq!(ids(read), ids(&whole));
    let [found, made] = [read, &whole].map(|catalogue| catalogue.scene("room").expect("there"));
    assert_eq!(found.revision(), made.revision());
    assert_eq!(found.len(), 3);
    for (_, object, pose) in made.objects() {
        let slot = found.slot(&object.name).expect("there");
        let (other, stands) = (found.object(slot).expect("there"), found.pose(slot).expect("there"));
        assert_eq!((stands, other.geometry.id(), &other.group), (pose, object.geometry.id(), &object.group));
        assert_eq!((other.padding_m, &other.attachment), (object.padding_m, &object.attachment));
    }
    assert!(found.rules().allowed().eq(made.rules().allowed()));
    assert!(found.rules().group_paddings().eq(made.rules().group_paddings()));
    assert!(found.rules().pair_paddings().eq(made.rules().pair_paddings()));
    assert_eq!(read.job(1).expect("there"), whole.job(1).expect("there"));
}

#[test]
fn other_formats_are_refused_by_number() {
    for format in [1, 2, 6, 99] {
        let disk = Disk::default();
        drop(disk.load().expect("a new catalogue"));
        disk.meddle(|transaction| {
            transaction.open_table(META).expect("a table").insert("format", format).expect("written");
        });
        match disk.load() {
            Err(error @ StoreError::Format { found, expected: FORMAT, .. }) => {
                assert!(found == format && error.to_string().contains(&format.to_string()), "{error}");
            }
            other => panic!("format {format}: {other:?}"),
        }
    }
}
