//! Rows of a drawing, the entities that have them, and the bytes that both occupy.

use rerun::{EntityPath, SerializedComponentBatch, TimePoint};
use std::time::Instant;

/// A row besides its arrays: its time on two timelines, a tree.
const ROW_BYTES: usize = 512;
/// An entity besides its rows and its name: its places in index and queue, with the room that those leave empty.
const ENTITY_BYTES: usize = 2 * size_of::<Entity>() + 256;

/// What an entity shows at one time.
#[derive(Clone)]
pub(crate) struct Row {
    /// None: at all times.
    pub(crate) time: Option<TimePoint>,
    pub(crate) components: Vec<SerializedComponentBatch>,
}

impl Row {
    pub(super) fn bytes(&self) -> usize {
        ROW_BYTES + self.components.iter().map(batch_bytes).sum::<usize>()
    }

    /// What it holds of components that the other speaks of, too.
    pub(super) fn bytes_shared_with(&self, other: &Self) -> usize {
        let spoken_of = |batch: &&SerializedComponentBatch| {
            other.components.iter().any(|component| component.descriptor == batch.descriptor)
        };
        self.components.iter().filter(spoken_of).map(batch_bytes).sum()
    }

    pub(super) fn speaks_of(&self, other: &Self) -> bool {
        let same = |batch: &SerializedComponentBatch| other.components.iter().any(|b| b.descriptor == batch.descriptor);
        self.components.iter().any(same)
    }

    /// Takes over what is newer, and keeps what that does not speak of.
    pub(super) fn replace_by(&mut self, newer: Self) {
        self.time = newer.time;
        for batch in newer.components {
            match self.components.iter_mut().find(|old| old.descriptor == batch.descriptor) {
                Some(old) => *old = batch,
                None => self.components.push(batch),
            }
        }
    }
}

fn batch_bytes(batch: &SerializedComponentBatch) -> usize {
    size_of::<SerializedComponentBatch>() + batch.array.get_array_memory_size()
}

/// Its parts are among Rerun's names, too.
pub(super) fn path_bytes(path: &EntityPath) -> usize {
    path.iter().map(|part| 64 + 2 * part.unescaped_str().len()).sum()
}

pub(super) fn line_bytes((path, row): &(EntityPath, Row)) -> usize {
    path_bytes(path) + row.bytes()
}

/// The two halves of an entity: what holds for all times, and what is true now.
#[derive(Default)]
pub(super) struct EntityRows {
    pub(super) pending: Option<Row>,
    pub(super) last: Option<Row>,
}

impl EntityRows {
    pub(super) fn bytes(&self) -> usize {
        [&self.pending, &self.last].into_iter().flatten().map(Row::bytes).sum()
    }

    /// What it holds when `row` has come.
    pub(super) fn bytes_with(&self, row: &Row) -> usize {
        let replaced = self.pending.as_ref().map_or(0, |pending| ROW_BYTES + pending.bytes_shared_with(row));
        self.bytes() + row.bytes() - replaced
    }

    /// What was drawn and what is to be drawn become one row, that is to be drawn.
    pub(super) fn fold(&mut self) {
        let Some(mut row) = self.last.take() else { return };
        if let Some(newer) = self.pending.take() {
            row.replace_by(newer);
        }
        self.pending = Some(row);
    }
}

pub(super) struct Entity {
    pub(super) path: EntityPath,
    pub(super) fixed: EntityRows,
    pub(super) moving: EntityRows,
    /// When it is in the queue, and under which key.
    pub(super) due: Option<(Instant, u64)>,
    pub(super) drawn: Option<Instant>,
}

impl Entity {
    pub(super) fn bytes(&self) -> usize {
        ENTITY_BYTES + path_bytes(&self.path) + self.fixed.bytes() + self.moving.bytes()
    }
}
