//! The file: opening, locking, reading whole, committing.

use std::fmt;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use redb::{
    Database, DatabaseError, Durability, ReadOnlyTable, ReadTransaction, ReadableDatabase, ReadableTable,
    TableDefinition, TableError, TableHandle, WriteTransaction,
};
use serde::de::DeserializeOwned;

use super::format_3::{self, FORMAT_3};
use super::robot_row::{InstanceRow, RobotRow};
use super::rows::{
    BODIES, FORMAT, FORMAT_4, INSTANCES, JOBS, LADDERS, LadderRow, META, OBJECTS, ObjectRow, POINTS, RESERVES,
    REVISIONS, ROBOTS, SCENES, SceneRow, TRIANGLES, json,
};
use super::{Job, StoreError};

/// Name of the file in its directory.
pub(super) const FILE: &str = "catalogue.redb";

/// The catalogue's file, locked by this process. Hand it to [`super::Catalogue::load`].
pub struct Store {
    dir: PathBuf,
    opener: Opener,
    /// `None` after a failed commit, until opening again succeeds.
    database: Option<Database>,
}

type Opener = Box<dyn Fn() -> Result<Database, DatabaseError> + Send>;

/// The points of a job, metres, and the triangles between them.
pub type JobMesh = (Vec<Vector3<f64>>, Vec<[usize; 3]>);

/// Everything in the file, as stored.
pub(super) struct Contents {
    pub(super) bodies: Vec<(String, String)>,
    /// In the order of their ids.
    pub(super) ladders: Vec<(String, LadderRow)>,
    /// Scene, revision, row.
    pub(super) scenes: Vec<(String, u64, SceneRow)>,
    /// Scene, object, row; in the order of scene and object.
    pub(super) objects: Vec<(String, String, ObjectRow)>,
    /// In the order of their ids.
    pub(super) robots: Vec<(String, RobotRow)>,
    /// Scene, name of the robot in it, row; in the order of both.
    pub(super) instances: Vec<(String, String, InstanceRow)>,
    /// In the order of their ids.
    pub(super) jobs: Vec<Job>,
    pub(super) revision_floor: u64,
}

impl Store {
    /// Opens the catalogue in a directory, making both as needed, and locks it.
    ///
    /// # Errors
    /// [`StoreError::InUse`] when another process has it open; otherwise the reason why it cannot
    /// be opened.
    pub fn open(dir: &Path) -> Result<Self, StoreError> {
        let unusable = |source| StoreError::Directory { dir: dir.into(), source };
        fs::create_dir_all(dir).map_err(unusable)?;
        let file = dir.join(FILE);
        let fresh = match fs::metadata(&file) {
            // redb would make a new database of it, and whatever was in it would be forgotten
            // without a word.
            Ok(found) if found.len() == 0 => return Err(StoreError::Empty { file }),
            Ok(_) => false,
            Err(error) if error.kind() == io::ErrorKind::NotFound => true,
            Err(error) => return Err(unusable(error)),
        };
        let first = if fresh { Database::create(&file) } else { Database::open(&file) };
        let store = Self::open_with(dir, first, Box::new(move || Database::open(&file)))?;
        remove_cut_backups(dir);
        if fresh {
            // A synced file is of no use when its directory entry is lost.
            File::open(dir).and_then(|dir| dir.sync_all()).map_err(unusable)?;
            if let Some(parent) = dir.parent().filter(|parent| !parent.as_os_str().is_empty()) {
                // The directory may be new as well; a parent that may not be read is not an error.
                let _ = File::open(parent).and_then(|parent| parent.sync_all());
            }
        }
        Ok(store)
    }

    /// `first` is opened now; `opener` opens what is there, and never makes anything new, after a
    /// failed commit.
    pub(super) fn open_with(
        dir: &Path,
        first: Result<Database, DatabaseError>,
        opener: Opener,
    ) -> Result<Self, StoreError> {
        let mut store = Self { dir: dir.into(), opener, database: None };
        let database = store.opened(first)?;
        store.check_format(&database)?;
        store.database = Some(database);
        Ok(store)
    }

    pub(super) fn dir(&self) -> &Path {
        &self.dir
    }

    pub(super) fn is_closed(&self) -> bool {
        self.database.is_none()
    }

    /// Opens the file again after a failed commit. One that lacks its tables is not the one that
    /// was open.
    pub(super) fn reopen(&mut self) -> Result<(), StoreError> {
        self.database = None;
        let database = self.opened((self.opener)())?;
        match self.format(&database)?.1 {
            Some(FORMAT) => self.database = Some(database),
            _ => return Err(StoreError::damaged(&self.dir, "the file was replaced while it was in use")),
        }
        Ok(())
    }

    fn opened(&self, result: Result<Database, DatabaseError>) -> Result<Database, StoreError> {
        result.map_err(|error| match error {
            DatabaseError::UpgradeRequired(found) => {
                StoreError::damaged(&self.dir, format!("it is a redb file of the old version {found}"))
            }
            error => StoreError::from_redb(&self.dir, error),
        })
    }

    /// Whether there are tables at all, and the format they say they have.
    fn format(&self, database: &Database) -> Result<(bool, Option<u64>), StoreError> {
        (|| {
            let read = database.begin_read()?;
            let tables = read.list_tables()?.map(|table| table.name().to_owned()).collect::<Vec<_>>();
            let known = tables.iter().any(|name| name == META.name());
            let found = if known { read.open_table(META)?.get("format")?.map(|value| value.value()) } else { None };
            Ok::<_, redb::Error>((!tables.is_empty(), found))
        })()
        .map_err(|error| StoreError::from_redb(&self.dir, error))
    }

    /// Checks the format of the tables, makes them in a new file, or writes those of formats 3 and
    /// 4 in the present one.
    fn check_format(&self, database: &Database) -> Result<(), StoreError> {
        let (tables, found) = self.format(database)?;
        match found {
            Some(FORMAT) => Ok(()),
            Some(FORMAT_3) => self.upgrade_from_3(database),
            Some(FORMAT_4) => self.upgrade_from_4(database),
            Some(found) => Err(StoreError::Format { dir: self.dir.clone(), found, expected: FORMAT }),
            None if !tables => commit(database, |transaction| {
                transaction.open_table(META)?.insert("format", FORMAT)?;
                transaction.open_table(BODIES)?;
                transaction.open_table(LADDERS)?;
                transaction.open_table(ROBOTS)?;
                transaction.open_table(INSTANCES)?;
                transaction.open_table(SCENES)?;
                transaction.open_table(RESERVES)?;
                transaction.open_table(REVISIONS)?;
                transaction.open_table(OBJECTS)?;
                Ok(())
            })
            .map_err(|error| StoreError::from_redb(&self.dir, error)),
            None => Err(StoreError::damaged(&self.dir, "it names no format")),
        }
    }

    /// Makes the tables that format 4 has not; all else has the same form.
    fn upgrade_from_4(&self, database: &Database) -> Result<(), StoreError> {
        let written = commit(database, |transaction| {
            transaction.open_table(META)?.insert("format", FORMAT)?;
            transaction.open_table(ROBOTS)?;
            transaction.open_table(INSTANCES)?;
            Ok(())
        });
        written.map_err(|error| StoreError::from_redb(&self.dir, error))?;
        tracing::info!(from = FORMAT_4, to = FORMAT, "the catalogue has a new format");
        Ok(())
    }

    /// Writes the jobs of format 3 in their present form, and makes the tables that it has not.
    fn upgrade_from_3(&self, database: &Database) -> Result<(), StoreError> {
        let read = || jobs::<format_3::FitJob>(&database.begin_read()?);
        let jobs = read().map_err(|error| self.unreadable(error))?;
        let written = commit(database, |transaction| {
            transaction.open_table(META)?.insert("format", FORMAT)?;
            transaction.open_table(ROBOTS)?;
            transaction.open_table(INSTANCES)?;
            let mut table = transaction.open_table(JOBS)?;
            for job in &jobs {
                table.insert(job.id, json(job)?.as_slice())?;
            }
            Ok(())
        });
        written.map_err(|error| StoreError::from_redb(&self.dir, error))?;
        tracing::info!(from = FORMAT_3, to = FORMAT, jobs = jobs.len(), "the catalogue has a new format");
        Ok(())
    }

    /// Commits one transaction durably: when this returns `Ok`, it is on disk. After an error the
    /// file is closed, since the database cannot tell what reached the disk; [`Store::reopen`] and
    /// [`Store::read`] can.
    pub(super) fn commit(
        &mut self,
        write: impl FnOnce(&WriteTransaction) -> Result<(), redb::Error>,
    ) -> Result<(), StoreError> {
        let database = self.database.as_ref().ok_or_else(|| self.closed())?;
        commit(database, write).map_err(|error| {
            self.database = None;
            StoreError::from_redb(&self.dir, error)
        })
    }

    /// Reads everything.
    pub(super) fn read(&self) -> Result<Contents, StoreError> {
        let database = self.database.as_ref().ok_or_else(|| self.closed())?;
        self.read_tables(database).map_err(|error| self.unreadable(error))
    }

    fn unreadable(&self, error: ReadError) -> StoreError {
        match error {
            ReadError::Redb(error) => StoreError::from_redb(&self.dir, error),
            ReadError::Row(what) => StoreError::damaged(&self.dir, what),
        }
    }

    fn read_tables(&self, database: &Database) -> Result<Contents, ReadError> {
        let read = database.begin_read()?;
        let mut contents = Contents {
            bodies: Vec::new(),
            ladders: Vec::new(),
            scenes: Vec::new(),
            objects: Vec::new(),
            robots: Vec::new(),
            instances: Vec::new(),
            jobs: jobs::<Job>(&read)?,
            revision_floor: read.open_table(META)?.get("revision_floor")?.map_or(0, |value| value.value()),
        };
        for entry in read.open_table(BODIES)?.iter()? {
            let (id, file) = entry?;
            let id = id.value().to_owned();
            let file = String::from_utf8(file.value().to_vec())
                .map_err(|error| ReadError::Row(format!("body {id} is no text: {error}")))?;
            contents.bodies.push((id, file));
        }
        for entry in read.open_table(LADDERS)?.iter()? {
            let (id, row) = entry?;
            let id = id.value().to_owned();
            let row = parse(row.value(), || format!("ladder {id}"))?;
            contents.ladders.push((id, row));
        }
        let (revisions, reserves) = (read.open_table(REVISIONS)?, read.open_table(RESERVES)?);
        for entry in read.open_table(SCENES)?.iter()? {
            let (name, row) = entry?;
            let name = name.value().to_owned();
            let row = parse(row.value(), || format!("scene \"{name}\""))?;
            let revision = revisions.get(name.as_str())?.map(|value| value.value());
            let revision = revision.ok_or_else(|| ReadError::Row(format!("scene \"{name}\" has no revision")))?;
            // The server was cut off while it gave out revisions that it had not written.
            let reserve = reserves.get(name.as_str())?.map_or(0, |value| value.value() + 1);
            contents.scenes.push((name, revision.max(reserve), row));
        }
        for entry in read.open_table(OBJECTS)?.iter()? {
            let (key, row) = entry?;
            let (scene, name) = key.value();
            let row = parse(row.value(), || format!("object \"{name}\" of scene \"{scene}\""))?;
            contents.objects.push((scene.to_owned(), name.to_owned(), row));
        }
        for entry in read.open_table(ROBOTS)?.iter()? {
            let (id, row) = entry?;
            let id = id.value().to_owned();
            let row = parse(row.value(), || format!("robot {id}"))?;
            contents.robots.push((id, row));
        }
        for entry in read.open_table(INSTANCES)?.iter()? {
            let (key, row) = entry?;
            let (scene, name) = key.value();
            let row = parse(row.value(), || format!("robot \"{name}\" of scene \"{scene}\""))?;
            contents.instances.push((scene.to_owned(), name.to_owned(), row));
        }
        Ok(contents)
    }

    /// What a copy of everything is read from; later changes are not seen in it.
    pub(super) fn snapshot(&self) -> Result<ReadTransaction, StoreError> {
        let database = self.database.as_ref().ok_or_else(|| self.closed())?;
        database.begin_read().map_err(|error| StoreError::from_redb(&self.dir, error))
    }

    /// Points, metres, and triangles of a job, if it has not ended.
    pub(super) fn mesh(&self, id: u64) -> Result<Option<JobMesh>, StoreError> {
        let Some(coordinates) = self.job_bytes(POINTS, id)? else { return Ok(None) };
        let corners = self.job_bytes(TRIANGLES, id)?.unwrap_or_default();
        let points = coordinates.as_chunks::<8>().0.as_chunks::<3>().0;
        let points = points.iter().map(|point| point.map(f64::from_le_bytes).into()).collect();
        let triangles = corners.as_chunks::<4>().0.as_chunks::<3>().0;
        let index = |corner| usize::try_from(u32::from_le_bytes(corner)).unwrap_or(usize::MAX);
        Ok(Some((points, triangles.iter().map(|corners| corners.map(index)).collect())))
    }

    fn job_bytes(
        &self,
        definition: TableDefinition<u64, &'static [u8]>,
        id: u64,
    ) -> Result<Option<Vec<u8>>, StoreError> {
        let database = self.database.as_ref().ok_or_else(|| self.closed())?;
        (|| {
            let Some(table) = table(&database.begin_read()?, definition)? else { return Ok(None) };
            Ok(table.get(id)?.map(|row| row.value().to_vec()))
        })()
        .map_err(|error: redb::Error| StoreError::from_redb(&self.dir, error))
    }

    fn closed(&self) -> StoreError {
        StoreError::Disk { dir: self.dir.clone(), source: Box::new(redb::Error::DatabaseClosed) }
    }
}

/// Beginning of the names of folders in which backups are made, in the directory of the catalogue.
pub const BACKUP_PREFIX: &str = "catalogue.redb.backing-up-";

/// What a server that was cut off left behind; nobody else makes backups here, since the catalogue
/// is locked.
fn remove_cut_backups(dir: &Path) {
    for entry in fs::read_dir(dir).into_iter().flatten().flatten() {
        if entry.file_name().to_string_lossy().starts_with(BACKUP_PREFIX) && entry.path().is_dir() {
            // It takes space only.
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

impl fmt::Debug for Store {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Store").field("dir", &self.dir).finish_non_exhaustive()
    }
}

fn commit(
    database: &Database,
    write: impl FnOnce(&WriteTransaction) -> Result<(), redb::Error>,
) -> Result<(), redb::Error> {
    let mut transaction = database.begin_write()?;
    // The default, said aloud because every promise of this room rests on it.
    transaction.set_durability(Durability::Immediate)?;
    write(&transaction)?;
    transaction.commit()?;
    Ok(())
}

enum ReadError {
    Redb(redb::Error),
    Row(String),
}

impl<E: Into<redb::Error>> From<E> for ReadError {
    fn from(error: E) -> Self {
        Self::Redb(error.into())
    }
}

/// The jobs in the order of their ids, from rows of one form.
fn jobs<R: DeserializeOwned + Into<Job>>(read: &ReadTransaction) -> Result<Vec<Job>, ReadError> {
    let Some(rows) = table(read, JOBS)? else { return Ok(Vec::new()) };
    let mut jobs = Vec::new();
    for entry in rows.iter()? {
        let (id, row) = entry?;
        let id = id.value();
        let job: Job = parse::<R>(row.value(), || format!("job {id}"))?.into();
        if job.id != id {
            return Err(ReadError::Row(format!("job {id} says that it is {}", job.id)));
        }
        jobs.push(job);
    }
    Ok(jobs)
}

/// A table that older files may lack.
pub(super) fn table<K: redb::Key + 'static, V: redb::Value + 'static>(
    read: &ReadTransaction,
    definition: TableDefinition<K, V>,
) -> Result<Option<ReadOnlyTable<K, V>>, redb::Error> {
    match read.open_table(definition) {
        Ok(table) => Ok(Some(table)),
        Err(TableError::TableDoesNotExist(_)) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

fn parse<T: DeserializeOwned>(bytes: &[u8], what: impl Fn() -> String) -> Result<T, ReadError> {
    serde_json::from_slice(bytes).map_err(|error| ReadError::Row(format!("{}: {error}", what())))
}
