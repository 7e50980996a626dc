//! Power that fails between any two writes, and disks that fail at any of them.

use std::collections::BTreeMap;
use std::io::{self, ErrorKind};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use redb::{Database, StorageBackend};

use super::{ball, moved, placed};
use crate::body::BodyId;
use crate::measure::Pose;
use crate::scene::Update;
use crate::store::{Catalogue, CatalogueError, Store, StoreError};

/// What reaches a disk.
#[derive(Clone, Debug)]
enum Operation {
    Write(usize, Vec<u8>),
    SetLength(usize),
    /// Everything before it is on the disk.
    Sync,
    /// So many changes were acknowledged.
    Acknowledged(usize),
}

/// A disk in memory that remembers what reached it, and of which a chosen operation fails.
#[derive(Clone, Debug, Default)]
struct Journal {
    bytes: Arc<Mutex<Vec<u8>>>,
    operations: Arc<Mutex<Vec<Operation>>>,
    /// Operations until one fails; 0: none does.
    failing: Arc<AtomicUsize>,
    /// Whether all later ones fail, too.
    for_good: Arc<AtomicBool>,
    failed: Arc<AtomicUsize>,
}

fn apply(bytes: &mut Vec<u8>, operation: &Operation) {
    match operation {
        Operation::Write(offset, data) => {
            let end = offset + data.len();
            bytes.resize(bytes.len().max(end), 0);
            bytes[*offset..end].copy_from_slice(data);
        }
        Operation::SetLength(length) => bytes.resize(*length, 0),
        Operation::Sync | Operation::Acknowledged(_) => {}
    }
}

impl Journal {
    fn of(bytes: Vec<u8>) -> Self {
        Self { bytes: Arc::new(Mutex::new(bytes)), ..Self::default() }
    }

    fn load(&self) -> Result<Catalogue, StoreError> {
        let disk = self.clone();
        let open = move || Database::builder().create_with_backend(disk.clone());
        Catalogue::load(Store::open_with(Path::new("disk"), open(), Box::new(open))?)
    }

    fn note(&self, operation: Operation) {
        self.operations.lock().expect("sound").push(operation);
    }

    fn pass(&self) -> io::Result<()> {
        match self.failing.load(Ordering::Relaxed) {
            0 => return Ok(()),
            1 if self.for_good.load(Ordering::Relaxed) => {}
            left => {
                self.failing.store(left - 1, Ordering::Relaxed);
                if left > 1 {
                    return Ok(());
                }
            }
        }
        self.failed.fetch_add(1, Ordering::Relaxed);
        Err(io::Error::from(ErrorKind::Other))
    }
}

impl StorageBackend for Journal {
    fn len(&self) -> io::Result<u64> {
        Ok(self.bytes.lock().expect("sound").len() as u64)
    }

    fn read(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        self.pass()?;
        let start = usize::try_from(offset).expect("small");
        let bytes = self.bytes.lock().expect("sound");
        out.copy_from_slice(bytes.get(start..start + out.len()).ok_or(ErrorKind::UnexpectedEof)?);
        Ok(())
    }

    fn set_len(&self, len: u64) -> io::Result<()> {
        self.pass()?;
        let operation = Operation::SetLength(usize::try_from(len).expect("small"));
        apply(&mut self.bytes.lock().expect("sound"), &operation);
        self.note(operation);
        Ok(())
    }

    fn sync_data(&self) -> io::Result<()> {
        self.pass()?;
        self.note(Operation::Sync);
        Ok(())
    }

    fn write(&self, offset: u64, data: &[u8]) -> io::Result<()> {
        self.pass()?;
        let operation = Operation::Write(usize::try_from(offset).expect("small"), data.to_vec());
        apply(&mut self.bytes.lock().expect("sound"), &operation);
        self.note(operation);
        Ok(())
    }
}

/// A scene: its revision, and its objects.
type SceneContent = (u64, BTreeMap<String, (BodyId, Pose)>);

/// Bodies and scenes.
type Content = (Vec<BodyId>, BTreeMap<String, SceneContent>);

fn content(catalogue: &Catalogue) -> Content {
    let bodies = catalogue.bodies(None, 99).0.iter().map(|body| *body.id()).collect();
    let scene = |name: &str| {
        let scene = catalogue.scene(name).expect("there");
        let objects =
            scene.objects().map(|(_, object, pose)| (object.name.to_string(), (*object.geometry.id(), *pose)));
        (name.to_owned(), (scene.revision(), objects.collect()))
    };
    (bodies, catalogue.scenes(None, 99).0.iter().map(|entry| scene(&entry.name)).collect())
}

type Step = fn(&Catalogue) -> Result<(), CatalogueError>;

/// Changes of every kind, one after the other.
const STEPS: [Step; 12] = [
    |catalogue| catalogue.create_body(ball(1.0).into()).map(drop),
    |catalogue| catalogue.create_scene("room").map(drop),
    |catalogue| catalogue.update_scene("room", &placed("o", &ball(1.0))).map(drop),
    |catalogue| catalogue.update_scene("room", &moved(1.0)).map(drop),
    |catalogue| catalogue.create_body(ball(2.0).into()).map(drop),
    |catalogue| catalogue.create_scene("hall").map(drop),
    |catalogue| catalogue.update_scene("hall", &placed("p", &ball(2.0))).map(drop),
    |catalogue| {
        catalogue.fork_scene("room", "plan", None)?;
        catalogue.update_scene("plan", &moved(2.0))?;
        catalogue.commit_fork("plan").map(drop)
    },
    |catalogue| catalogue.delete_scene("hall"),
    |catalogue| catalogue.delete_body(ball(2.0).id()),
    |catalogue| {
        let live = catalogue.live_scene("room")?;
        let slot = live.snapshot().slot("o").expect("there");
        catalogue.stream_poses::<CatalogueError>(&live, |_| Ok(vec![(slot, super::at(3.0))]))?;
        catalogue.write_poses(true)?;
        Ok(())
    },
    |catalogue| catalogue.update_scene("room", &Update { removals: vec!["o".into()], ..Update::default() }).map(drop),
];

/// The contents after each number of steps, on a disk that does not fail.
fn contents() -> (Journal, Vec<Content>) {
    let disk = Journal::default();
    let catalogue = disk.load().expect("a new catalogue");
    let mut contents = vec![content(&catalogue)];
    disk.note(Operation::Acknowledged(0));
    for (index, step) in STEPS.iter().enumerate() {
        step(&catalogue).expect("a disk that does not fail");
        contents.push(content(&catalogue));
        disk.note(Operation::Acknowledged(index + 1));
    }
    drop(catalogue);
    (disk, contents)
}

/// Wherever the power fails, and whichever of the writes since the last sync have reached the disk
/// then, half of one among them, the catalogue is the one before or after the change under way.
#[test]
fn power_may_fail_between_any_two_writes() {
    let (disk, contents) = contents();
    let operations = disk.operations.lock().expect("sound").clone();
    let first = operations.iter().position(|operation| matches!(operation, Operation::Acknowledged(0)));
    let mut random = 1_u64;
    let mut draw = || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        random >> 62
    };
    let (mut synced, mut unsynced, mut acknowledged) = (Vec::new(), Vec::new(), 0);
    let mut images = 0;
    for (index, operation) in operations.iter().enumerate() {
        match operation {
            Operation::Sync => unsynced.drain(..).for_each(|operation| apply(&mut synced, &operation)),
            Operation::Acknowledged(count) => acknowledged = *count,
            Operation::Write(..) | Operation::SetLength(_) => unsynced.push(operation.clone()),
        }
        if first.is_none_or(|first| index < first) {
            continue;
        }
        for trial in 0..4 {
            let mut image = synced.clone();
            for (place, operation) in unsynced.iter().enumerate() {
                let is_last = place + 1 == unsynced.len();
                let reached = match trial {
                    0 => true,
                    1 => false,
                    _ => draw() > 0,
                };
                match operation {
                    Operation::Write(offset, data) if reached && trial == 3 && is_last => {
                        apply(&mut image, &Operation::Write(*offset, data[..data.len() / 2].to_vec()));
                    }
                    // A file system keeps the length with the data that needs it.
                    Operation::SetLength(_) => apply(&mut image, operation),
                    _ if reached => apply(&mut image, operation),
                    _ => {}
                }
            }
            let catalogue = Journal::of(image).load();
            let catalogue = catalogue.unwrap_or_else(|error| panic!("operation {index}, trial {trial}: {error}"));
            let found = content(&catalogue);
            let matches = |content: &Content| same(content, &found);
            let fits = contents[acknowledged..].iter().take(2).any(matches);
            assert!(fits, "operation {index}, trial {trial}: after {acknowledged} changes there is {found:?}");
            images += 1;
        }
    }
    assert!(images > 400, "{images} images");
}

/// A scene that was cut off while poses were streamed begins above its reserve of revisions.
fn same(expected: &Content, found: &Content) -> bool {
    let scenes = expected.1.iter().zip(&found.1).all(|((name, (revision, objects)), (other, (now, others)))| {
        name == other && (now == revision || *now > (1 << 20)) && objects == others
    });
    expected.0 == found.0 && expected.1.len() == found.1.len() && scenes
}

/// Whichever operation fails, once or from then on, memory says what the disk says, and that is
/// the catalogue before or after the change; the next change works when the disk does.
#[test]
fn any_operation_of_the_disk_may_fail() {
    let (_, contents) = contents();
    let mut failures = 0;
    for for_good in [false, true] {
        for operation in 1.. {
            let disk = Journal::default();
            let catalogue = disk.load().expect("a new catalogue");
            disk.failing.store(operation, Ordering::Relaxed);
            disk.for_good.store(for_good, Ordering::Relaxed);
            let done = STEPS.iter().take_while(|step| step(&catalogue).is_ok()).count();
            if disk.failed.load(Ordering::Relaxed) == 0 {
                assert_eq!(done, STEPS.len());
                break;
            }
            failures += 1;
            disk.failing.store(0, Ordering::Relaxed);
            // The next change opens the file again.
            let body = ball(9.0);
            catalogue.create_body(body.clone().into()).unwrap_or_else(|error| panic!("{operation}: {error}"));
            catalogue.delete_body(body.id()).expect("deleted");
            let _ = catalogue.delete_scene("plan");
            let here = content(&catalogue);
            drop(catalogue);
            let again = disk.load().unwrap_or_else(|error| panic!("{operation}: {error}"));
            assert!(same(&here, &content(&again)), "operation {operation}: memory and disk differ");
            let fits = contents[done..].iter().take(2).any(|content| same(content, &here));
            assert!(fits, "operation {operation}: after {done} changes there is {here:?}");
        }
    }
    assert!(failures > 100, "{failures} failures");
}
