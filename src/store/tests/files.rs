//! Whole files of each format, as redb has written them: what is on disk does not depend on the
//! version of redb that opens it.

use std::path::{Path, PathBuf};

use redb::Database;

use super::formats::{FORMATS, Rows, holds_robots, holds_what_was_filled_in, write_rows};
use super::{at, ball, placed};
use crate::store::disk::FILE;
use crate::store::rows::FORMAT;
use crate::store::{Catalogue, Store};

/// The file of a format, `catalogue.redb`.
fn path(format: u64) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("src/store/tests/format_{format}.redb"))
}

fn load(dir: &Path) -> Catalogue {
    Catalogue::load(Store::open(dir).expect("it opens")).expect("it loads")
}

#[test]
fn a_file_of_each_format_is_opened_changed_and_opened_again() {
    assert_eq!(FORMATS.last().map(|(format, _)| *format), Some(FORMAT), "a format without a file");
    for (format, _) in FORMATS {
        let dir = tempfile::tempdir().expect("a directory");
        std::fs::copy(path(format), dir.path().join(FILE)).expect("copied");
        let catalogue = load(dir.path());
        holds_what_was_filled_in(&catalogue);
        if format >= 5 {
            holds_robots(&catalogue);
        }
        catalogue.update_scene("room", &placed("new", &ball(0.5))).expect("placed");
        let revision = catalogue.scene("room").expect("there").revision();
        drop(catalogue);
        let scene = load(dir.path()).scene("room").expect("there");
        assert_eq!((scene.revision(), scene.len()), (revision, 4), "format {format}");
        let slot = scene.slot("new").expect("there");
        assert_eq!(scene.pose(slot), Some(&at(0.1)));
    }
}

/// A file that holds these rows and little else.
fn written(rows: &Rows) -> Vec<u8> {
    let dir = tempfile::tempdir().expect("a directory");
    let path = dir.path().join(FILE);
    let mut database = Database::create(&path).expect("made");
    let transaction = database.begin_write().expect("begun");
    write_rows(&transaction, rows);
    transaction.commit().expect("written");
    while database.compact().expect("compacted") {}
    drop(database);
    std::fs::read(path).expect("read")
}

/// `UPDATE_FORMAT=1` writes the file of the present format, which is right only together with a new
/// number; a file of a format that has been is never written again.
#[test]
fn a_file_of_each_format_is_written_once() {
    for (format, rows) in FORMATS {
        let is_missing = !path(format).exists();
        if std::env::var_os("UPDATE_FORMAT").is_some() && (format == FORMAT || is_missing) {
            let file = written(&serde_json::from_str(rows).expect("rows"));
            std::fs::write(path(format), file).expect("written");
        }
        let bytes = std::fs::metadata(path(format)).expect("there").len();
        assert!((4096..200_000).contains(&bytes), "format {format}: {bytes} bytes");
    }
}
