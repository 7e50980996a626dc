//! Copies of the catalogue while it is in use.

use std::path::Path;

use redb::{Database, Durability, Key, ReadTransaction, ReadableTable, TableDefinition, Value, WriteTransaction};

use super::disk::table;
use super::rows::{
    BODIES, INSTANCES, JOBS, LADDERS, META, OBJECTS, POINTS, RESERVES, REVISIONS, ROBOTS, SCENES, TRIANGLES,
};

/// Copies everything that a transaction sees into a new file.
pub(super) fn copy(read: &ReadTransaction, to: &Path) -> Result<(), redb::Error> {
    let database = Database::create(to)?;
    let mut write = database.begin_write()?;
    write.set_durability(Durability::Immediate)?;
    copy_table(read, &write, META)?;
    copy_table(read, &write, BODIES)?;
    copy_table(read, &write, LADDERS)?;
    copy_table(read, &write, ROBOTS)?;
    copy_table(read, &write, INSTANCES)?;
    copy_table(read, &write, SCENES)?;
    copy_table(read, &write, RESERVES)?;
    copy_table(read, &write, REVISIONS)?;
    copy_table(read, &write, OBJECTS)?;
    copy_table(read, &write, JOBS)?;
    copy_table(read, &write, POINTS)?;
    copy_table(read, &write, TRIANGLES)?;
    write.commit()?;
    Ok(())
}

fn copy_table<K: Key + 'static, V: Value + 'static>(
    read: &ReadTransaction,
    write: &WriteTransaction,
    definition: TableDefinition<K, V>,
) -> Result<(), redb::Error> {
    let Some(from) = table(read, definition)? else { return Ok(()) };
    let mut to = write.open_table(definition)?;
    for entry in from.iter()? {
        let (key, value) = entry?;
        to.insert(key.value(), value.value())?;
    }
    Ok(())
}
