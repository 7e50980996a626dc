//! The catalogue on a disk that fails, fills up, or holds something else.

mod crashes;
mod files;
mod formats;
mod jobs;
pub(crate) mod requests;

use std::io::{self, ErrorKind};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use nalgebra::Vector3;
use redb::{Database, StorageBackend};

use super::rows::{BODIES, META, OBJECTS, REVISIONS, SCENES};
use super::{Catalogue, CatalogueError, Counts, Store, StoreError};
use crate::body::Body;
use crate::measure::Pose;
use crate::scene::{Attach, Placement, Scene, Subject, Update};

/// A disk in memory that outlives the databases on it and is full on demand: it takes one more
/// write, cut short, and refuses every other.
#[derive(Debug, Clone, Default)]
struct Disk {
    bytes: Arc<Mutex<Vec<u8>>>,
    full: Arc<AtomicBool>,
    torn: Arc<AtomicBool>,
}

impl Disk {
    fn refuse(&self) -> io::Result<()> {
        if self.full.load(Ordering::Relaxed) { Err(ErrorKind::StorageFull.into()) } else { Ok(()) }
    }

    fn set_full(&self, full: bool) {
        self.full.store(full, Ordering::Relaxed);
        self.torn.store(false, Ordering::Relaxed);
    }

    fn open(&self) -> Result<Store, StoreError> {
        let disk = self.clone();
        let open = move || Database::builder().create_with_backend(disk.clone());
        Store::open_with(Path::new("disk"), open(), Box::new(open))
    }

    fn load(&self) -> Result<Catalogue, StoreError> {
        Catalogue::load(self.open()?)
    }

    /// Writes to the tables behind the catalogue's back.
    fn meddle(&self, write: impl FnOnce(&redb::WriteTransaction)) {
        self.open()
            .and_then(|mut store| {
                store.commit(|transaction| {
                    write(transaction);
                    Ok(())
                })
            })
            .expect("written");
    }
}

impl StorageBackend for Disk {
    fn len(&self) -> io::Result<u64> {
        Ok(self.bytes.lock().expect("sound").len() as u64)
    }

    fn read(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let start = usize::try_from(offset).expect("small");
        let bytes = self.bytes.lock().expect("sound");
        out.copy_from_slice(bytes.get(start..start + out.len()).ok_or(ErrorKind::UnexpectedEof)?);
        Ok(())
    }

    fn set_len(&self, len: u64) -> io::Result<()> {
        self.refuse()?;
        self.bytes.lock().expect("sound").resize(usize::try_from(len).expect("small"), 0);
        Ok(())
    }

    fn sync_data(&self) -> io::Result<()> {
        self.refuse()
    }

    fn write(&self, offset: u64, data: &[u8]) -> io::Result<()> {
        let torn = self.refuse().is_err();
        if torn && self.torn.swap(true, Ordering::Relaxed) {
            return self.refuse();
        }
        let kept = if torn { data.len() / 2 } else { data.len() };
        let start = usize::try_from(offset).expect("small");
        self.bytes.lock().expect("sound")[start..start + kept].copy_from_slice(&data[..kept]);
        self.refuse()
    }
}

fn ball(radius: f64) -> Body {
    Body::ball("ball", Vector3::zeros(), radius).expect("a ball")
}

fn at(x: f64) -> Pose {
    Pose::from_quaternion(Vector3::new(x, 0.0, 0.0), [0.6, 0.0, 0.0, 0.8]).expect("a pose")
}

fn placed(name: &str, body: &Body) -> Update {
    let (name, body, pose) = (name.into(), *body.id(), Some(at(0.1)));
    let placement = Placement { name, body, pose, group: "g".into(), padding_m: Some(0.25), attachment: None };
    Update { upserts: vec![placement], ..Update::default() }
}

fn moved(x: f64) -> Update {
    Update { poses: vec![("o".into(), at(x))], ..Update::default() }
}

fn sizes(catalogue: &Catalogue) -> (usize, usize) {
    let counts = catalogue.counts();
    (counts.bodies, counts.scenes)
}

/// Where `o` stands.
fn pose(scene: &Scene) -> Pose {
    *scene.slot("o").and_then(|slot| scene.pose(slot)).expect("there")
}

fn furnished(disk: &Disk) -> Catalogue {
    let catalogue = disk.load().expect("a new catalogue");
    catalogue.create_body(ball(1.0).into()).expect("stored");
    catalogue.create_scene("room").expect("made");
    catalogue.update_scene("room", &placed("o", &ball(1.0))).expect("placed");
    catalogue
}

#[test]
fn a_full_disk_is_reported_and_changes_nothing() {
    let disk = Disk::default();
    let catalogue = furnished(&disk);
    for round in 0..3 {
        disk.set_full(true);
        let before = catalogue.scene("room").expect("there");
        let failed = catalogue.update_scene("room", &moved(1.0)).expect_err("full");
        assert!(matches!(failed, CatalogueError::Store(StoreError::Full { .. })), "{failed}");
        assert!(catalogue.create_body(ball(2.0 + f64::from(round)).into()).is_err());
        assert!(catalogue.create_scene("hall").is_err());
        assert!(catalogue.delete_scene("room").is_err());
        let still = catalogue.scene("room").expect("still there");
        assert_eq!(still.revision(), before.revision());
        assert_eq!(pose(&still), pose(&before));
        assert_eq!(sizes(&catalogue), (1, 1));

        // With space again, the next change works without a restart.
        disk.set_full(false);
        let next = catalogue.update_scene("room", &moved(f64::from(round))).expect("space again");
        assert_eq!(next.revision(), before.revision() + 1);
        assert_eq!(catalogue.scene("room").expect("there").revision(), next.revision());
    }
    let revision = catalogue.scene("room").expect("there").revision();
    drop(catalogue);
    let again = disk.load().expect("loads");
    assert_eq!(sizes(&again), (1, 1));
    let scene = again.scene("room").expect("there");
    assert_eq!((scene.revision(), pose(&scene)), (revision, at(2.0)));
}

/// What is on disk between two commits is one of the two states, however the process ends.
#[test]
fn every_acknowledged_change_is_on_disk() {
    let disk = Disk::default();
    let catalogue = furnished(&disk);
    for step in 0..20 {
        let revision = catalogue.update_scene("room", &moved(f64::from(step) / 3.0)).expect("moved").revision();
        // A copy of the bytes is what a killed process leaves.
        let copy = Disk::default();
        copy.bytes.lock().expect("sound").clone_from(&disk.bytes.lock().expect("sound"));
        let scene = copy.load().expect("loads").scene("room").expect("there");
        assert_eq!(scene.revision(), revision);
        let object = scene.slot("o").and_then(|slot| scene.object(slot)).expect("there");
        assert_eq!((pose(&scene), &*object.group, object.padding_m), (at(f64::from(step) / 3.0), "g", Some(0.25)));
    }
}

#[test]
fn what_it_did_not_write_is_refused_by_name() {
    type Write = fn(&redb::WriteTransaction);
    let damage: [(&str, Write); 7] = [
        ("format 7", |t| drop(t.open_table(META).expect("a table").insert("format", 7))),
        ("body", |t| drop(t.open_table(BODIES).expect("a table").insert("feed", &b"{}"[..]))),
        ("scene \"room\"", |t| drop(t.open_table(SCENES).expect("a table").insert("room", &b"{}"[..]))),
        ("is made of no body", |t| {
            let row = br#"{"body":"?","pose":{"translation_m":[0,0,0],"rotation":[0,0,0,1]},"group":"","padding_m":null,"attachment":null}"#;
            drop(t.open_table(OBJECTS).expect("a table").insert(("room", "p"), &row[..]));
        }),
        ("has no pose", |t| {
            let row = format!(
                r#"{{"body":"{}","pose":{{"translation_m":[0,0,0],"rotation":[0,0,0,2]}},"group":"","padding_m":null,"attachment":null}}"#,
                ball(1.0).id()
            );
            drop(t.open_table(OBJECTS).expect("a table").insert(("room", "p"), row.as_bytes()));
        }),
        ("which is not stored", |t| {
            let row = format!(
                r#"{{"body":"{}","pose":{{"translation_m":[0,0,0],"rotation":[0,0,0,1]}},"group":"","padding_m":null,"attachment":null}}"#,
                ball(2.0).id()
            );
            drop(t.open_table(OBJECTS).expect("a table").insert(("room", "p"), row.as_bytes()));
        }),
        ("which is not stored", |t| {
            let row = br#"{"body":"f","pose":{"translation_m":[0,0,0],"rotation":[0,0,0,1]},"group":"","padding_m":null,"attachment":null}"#;
            let row = String::from_utf8_lossy(row).replace("\"f\"", &format!("\"{}\"", ball(1.0).id()));
            drop(t.open_table(OBJECTS).expect("a table").insert(("hall", "p"), row.as_bytes()));
        }),
    ];
    for (word, write) in damage {
        let disk = Disk::default();
        drop(furnished(&disk));
        disk.meddle(write);
        let error = disk.load().expect_err(word).to_string();
        assert!(error.contains(word) && error.contains("disk"), "{error}");
    }
}

/// Bodies are looked at one by one, and what does not use the damaged one goes on.
#[test]
fn what_is_damaged_is_named_and_not_used() {
    let disk = Disk::default();
    let catalogue = furnished(&disk);
    catalogue.create_body(ball(2.0).into()).expect("stored");
    catalogue.create_scene("hall").expect("made");
    catalogue.update_scene("hall", &placed("o", &ball(2.0))).expect("placed");
    catalogue.create_scene("lost").expect("made");
    drop(catalogue);
    let (first, second) = (*ball(1.0).id(), *ball(2.0).id());
    let damages: [(String, &str); 3] = [
        (ball(2.0).to_json(), "has the content of body"),
        (ball(1.0).to_json()[..99].to_owned(), "EOF"),
        (ball(1.0).to_json().replacen("1.0", "1.5", 1), "damaged"),
    ];
    for (file, why) in damages {
        disk.meddle(|t| {
            drop(t.open_table(BODIES).expect("a table").insert(&*first.to_string(), file.as_bytes()));
            let rules = br#"{"allowed":[[{"object":"a"},{"object":"b"}]],"group_paddings_m":[],"pair_paddings_m":[]}"#;
            drop(t.open_table(SCENES).expect("a table").insert("lost", &rules[..]));
        });
        for background in [false, true] {
            let catalogue = disk.load().expect("loads");
            assert!(!catalogue.is_proven());
            if background {
                assert!(!catalogue.prove_all(&AtomicBool::new(true)), "stopped before it began");
                assert!(catalogue.prove_all(&AtomicBool::new(false)));
                assert_eq!(catalogue.damage().len(), 3, "a body, its scene, and one with rules for nobody");
                assert!(catalogue.is_proven(), "everything was looked at");
            }
            let error = catalogue.geometry(&first).expect_err("damaged").to_string();
            assert!(error.contains(&first.to_string()) && error.contains(why), "{error}");
            assert!(matches!(catalogue.scene("room"), Err(CatalogueError::DamagedBody { id, .. }) if id == first));
            assert!(matches!(catalogue.scene("lost"), Err(CatalogueError::DamagedScene { .. })));
            let used = catalogue.update_scene("hall", &placed("p", &ball(1.0))).expect_err("damaged");
            assert!(matches!(used, CatalogueError::DamagedBody { .. }), "{used}");
            assert!(catalogue.fork_scene("room", "plan", None).is_err());
            assert!(matches!(catalogue.delete_body(&first), Err(CatalogueError::BodyUsed { .. })));
            // Lists show the rest.
            assert_eq!(catalogue.bodies(None, 9).0.iter().map(|body| *body.id()).collect::<Vec<_>>(), [second]);
            let (scenes, more) = catalogue.scenes(None, 9);
            let listed: Vec<_> = scenes.iter().map(|entry| (&*entry.name, entry.revision, entry.objects)).collect();
            assert_eq!((listed.len(), more), (3, false), "{listed:?}");
            assert_eq!((listed[0].0, listed[0].2, listed[2].0, listed[2].2), ("hall", 1, "room", 1));
            assert_eq!(catalogue.scene("hall").expect("whole").len(), 1);
            let Counts { bodies, unproven_bodies, damaged_bodies, scenes, .. } = catalogue.counts();
            assert_eq!((bodies, unproven_bodies, damaged_bodies, scenes), (2, 0, 1, 3));
        }
    }

    // The remedies: the body again, and the scene without its rules.
    let catalogue = disk.load().expect("loads");
    assert!(catalogue.geometry(&first).is_err());
    assert!(catalogue.create_body(ball(1.0).into()).expect("stored").1, "it replaces the damaged one");
    assert_eq!(catalogue.scene("room").expect("whole again").len(), 1);
    let revision = catalogue.scenes(None, 9).0.iter().map(|entry| entry.revision).max().expect("there");
    catalogue.delete_scene("lost").expect("deleted");
    assert!(catalogue.prove_all(&AtomicBool::new(false)) && catalogue.is_proven());
    assert!(catalogue.create_scene("lost").expect("made").revision() >= revision.min(2));
    drop(catalogue);
    let again = disk.load().expect("loads");
    assert!(again.prove_all(&AtomicBool::new(false)) && again.is_proven() && again.damage().is_empty());
}

/// Many ask for the same scene while it is proven in the background.
#[test]
fn a_scene_that_many_ask_for_is_made_once() {
    let disk = Disk::default();
    let catalogue = furnished(&disk);
    for round in 0..20 {
        let post = Body::cylinder("post", 1.0 + f64::from(round) * 0.01, 1.0).expect("a cylinder");
        catalogue.create_body(post.clone().into()).expect("stored");
        catalogue.update_scene("room", &placed(&format!("post {round}"), &post)).expect("placed");
    }
    drop(catalogue);
    let catalogue = disk.load().expect("loads");
    assert_eq!(catalogue.counts().unproven_bodies, 21);
    let scenes: Vec<_> = std::thread::scope(|scope| {
        let asking: Vec<_> = (0..8).map(|_| scope.spawn(|| catalogue.live_scene("room").expect("there"))).collect();
        assert!(catalogue.prove_all(&AtomicBool::new(false)));
        asking.into_iter().map(|asking| asking.join().expect("no panic")).collect()
    });
    assert!(scenes.iter().all(|scene| Arc::ptr_eq(scene, &scenes[0])));
    assert_eq!((scenes[0].snapshot().len(), catalogue.is_proven()), (21, true));
}

/// Were a new file made, the scenes would be gone from memory too and their revisions given out
/// again.
#[test]
fn a_file_that_went_away_is_not_made_again() {
    let dir = tempfile::tempdir().expect("a directory");
    let (file, aside) = (dir.path().join("catalogue.redb"), dir.path().join("aside.redb"));
    let mut store = Store::open(dir.path()).expect("a new catalogue");
    std::fs::rename(&file, &aside).expect("moved");
    let gone = store.reopen().expect_err("gone").to_string();
    assert!(!file.exists() && store.is_closed(), "{gone}");
    drop(redb::Database::create(&file).expect("another database"));
    assert!(store.reopen().expect_err("another one").to_string().contains("replaced"));
    std::fs::rename(&aside, &file).expect("moved back");
    store.reopen().expect("there again");
}

#[test]
fn an_empty_file_is_not_taken_for_a_new_catalogue() {
    let dir = tempfile::tempdir().expect("a directory");
    std::fs::write(dir.path().join("catalogue.redb"), "").expect("written");
    let error = Store::open(dir.path()).expect_err("empty").to_string();
    assert!(error.contains("catalogue.redb is empty"), "{error}");
    assert_eq!(std::fs::metadata(dir.path().join("catalogue.redb")).expect("still there").len(), 0);
}

#[test]
fn a_new_pose_leaves_the_scenes_row_alone() {
    let disk = Disk::default();
    let before = furnished(&disk).scene("room").expect("there").revision();
    let mark = br#"{"allowed": [], "group_paddings_m": [], "pair_paddings_m": []}"#;
    disk.meddle(|t| drop(t.open_table(SCENES).expect("a table").insert("room", &mark[..])));
    let catalogue = disk.load().expect("loads");
    assert_eq!(catalogue.update_scene("room", &moved(1.0)).expect("moved").revision(), before + 1);
    drop(catalogue);
    disk.meddle(|t| {
        let table = t.open_table(SCENES).expect("a table");
        let row = redb::ReadableTable::get(&table, "room").expect("read").expect("a row").value().to_vec();
        assert_eq!(row, mark);
    });
    assert_eq!(disk.load().expect("loads").scene("room").expect("there").revision(), before + 1);
    disk.meddle(|t| drop(t.open_table(REVISIONS).expect("a table").remove("room")));
    assert!(disk.load().expect_err("damaged").to_string().contains("has no revision"));
}

#[test]
fn a_body_in_use_is_kept() {
    let catalogue = furnished(&Disk::default());
    let id = *ball(1.0).id();
    assert!(matches!(catalogue.delete_body(&id), Err(CatalogueError::BodyUsed { .. })));
    catalogue.delete_scene("room").expect("deleted");
    catalogue.delete_body(&id).expect("deleted");
    assert!(matches!(catalogue.delete_body(&id), Err(CatalogueError::NoBody(_))));
    assert!(catalogue.create_scene("room").expect("made").revision() > 2);
}

/// What a held object may touch names other objects; those may go.
#[test]
fn an_object_that_others_may_touch_can_be_removed() {
    let disk = Disk::default();
    let catalogue = furnished(&disk);
    for name in ["hand", "shelf"] {
        catalogue.update_scene("room", &placed(name, &ball(1.0))).expect("placed");
    }
    let touch = vec![Subject::Object("shelf".into()), Subject::Group("g".into())];
    let attach = Attach { name: "o".into(), to: "hand".into(), pose: None, touch };
    catalogue.update_scene("room", &Update { attach: vec![attach], ..Update::default() }).expect("held");
    let removal = Update { removals: vec!["shelf".into()], ..Update::default() };
    catalogue.update_scene("room", &removal).expect("removed");
    let touched = |catalogue: &Catalogue| {
        let scene = catalogue.scene("room").expect("there");
        let object = scene.slot("o").and_then(|slot| scene.object(slot)).expect("there");
        object.attachment.as_ref().expect("held").touch.clone()
    };
    assert_eq!(touched(&catalogue), [Subject::Group("g".into())]);
    drop(catalogue);
    assert_eq!(touched(&disk.load().expect("loads")), [Subject::Group("g".into())]);
}

/// While one thread forks a scene, another removes its object and deletes the body.
#[test]
fn what_a_fork_holds_stays_in_the_catalogue() {
    let catalogue = furnished(&Disk::default());
    let id = *ball(1.0).id();
    let removal = Update { removals: vec!["o".into()], ..Update::default() };
    let (mut deleted, done) = (0, AtomicBool::new(false));
    std::thread::scope(|scope| {
        let (done, catalogue) = (&done, &catalogue);
        scope.spawn(move || {
            while !done.load(Ordering::Relaxed) {
                let fork = catalogue.fork_scene("room", "plan", None).expect("forked").snapshot();
                for (_, object, _) in fork.objects() {
                    assert!(catalogue.geometry(object.geometry.id()).is_ok(), "deleted in use");
                }
                catalogue.delete_scene("plan").expect("deleted");
            }
        });
        for _ in 0..100 {
            catalogue.update_scene("room", &removal).expect("removed");
            match catalogue.delete_body(&id) {
                Ok(()) => deleted += 1,
                Err(error) => assert!(matches!(error, CatalogueError::BodyUsed { .. }), "{error}"),
            }
            catalogue.create_body(ball(1.0).into()).expect("stored");
            catalogue.update_scene("room", &placed("o", &ball(1.0))).expect("placed");
        }
        done.store(true, Ordering::Relaxed);
    });
    assert!(deleted > 0);
}

/// A fork is of one scene, not of whatever has its name and revision later.
#[test]
fn a_fork_is_not_committed_to_another_scene_of_the_name() {
    let catalogue = furnished(&Disk::default());
    catalogue.fork_scene("room", "plan", None).expect("forked");
    let revision = catalogue.update_scene("plan", &moved(1.0)).expect("moved").revision();
    catalogue.fork_scene("plan", "detail", None).expect("forked");
    catalogue.delete_scene("plan").expect("deleted");
    catalogue.fork_scene("room", "plan", None).expect("forked");
    assert_eq!(catalogue.update_scene("plan", &moved(2.0)).expect("moved").revision(), revision);
    assert!(matches!(catalogue.commit_fork("detail"), Err(CatalogueError::NoParent { .. })));
    assert_eq!(pose(&catalogue.scene("plan").expect("there")), at(2.0));
}

#[test]
fn pages_cover_everything_once() {
    let catalogue = Disk::default().load().expect("a new catalogue");
    for name in ["d", "a", "c", "b", "e"] {
        catalogue.create_scene(name).expect("made");
    }
    let names = |after, count| {
        let (page, more) = catalogue.scenes(after, count);
        (page.iter().map(|entry| entry.name.to_string()).collect::<Vec<_>>().concat(), more)
    };
    assert_eq!(names(None, 2), ("ab".into(), true));
    assert_eq!(names(Some("b"), 2), ("cd".into(), true));
    assert_eq!(names(Some("d"), 2), ("e".into(), false));
    assert_eq!(names(Some("bb"), 9), ("cde".into(), false));
}
