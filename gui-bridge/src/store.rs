//! What is to be drawn, between the module's thread, which must never wait, and the feeder, which may be stuck in
//! Rerun.
//!
//! ```text
//!   module's thread ──put──▶ entity: pending │ last   ──next──▶ feeder ──▶ Rerun
//!                            lines:  pending │ kept                │
//!                            layout          ▲──────── again ──────┘ a new stream gets the last of everything
//! ```
//!
//! An entity has one pending row: a newer one replaces it, component by component, and is taken when the entity's time
//! has come. Lines of text are things that happen, so they wait in a ring that drops the oldest. Whatever comes in, and
//! whatever the feeder does, no more than [`BYTES_MAX`] is held: lines and paths are counted, too.
//!
//! When there is no room, the newest still wins: an entity that is known gives up what was drawn of it for what is to
//! be drawn, so it can always change. Entities that are new find less room than those that are known.

use crate::blueprint::Layout;
use crate::error::LARGE_BYTES_MAX;
use rerun::EntityPath;
use std::collections::{BTreeSet, HashMap, VecDeque};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

mod entity;

pub(crate) use entity::Row;
use entity::{Entity, EntityRows, line_bytes};

/// Entities that a drawing has at most: a map of 4096 tiles, and room for all else.
pub const ENTITIES_MAX: usize = 16_384;
/// What is held, entities and lines together.
pub const BYTES_MAX: usize = 64 * 1024 * 1024;
/// Lines of text that wait, and as many that are kept for a viewer that comes later.
pub const LINES_MAX: usize = 1000;
/// What lines may hold of [`BYTES_MAX`]; entities have the rest.
const LINES_BYTES_MAX: usize = 8 * 1024 * 1024;
/// What entities may hold.
const ENTITIES_BYTES_MAX: usize = BYTES_MAX - LINES_BYTES_MAX;
/// Room into which an entity may grow, but no new one may come.
const RESERVE: usize = 8 * 1024 * 1024;
/// A line is no longer than this.
pub const LINE_BYTES_MAX: usize = 16 * 1024;
// A point of 12 bytes is drawn with 4 bytes of colour.
const _: () = assert!(LARGE_BYTES_MAX / 12 * 16 < ENTITIES_BYTES_MAX - RESERVE, "the largest cloud has room");

/// What the feeder does next.
pub(crate) enum Order {
    Row(EntityPath, Row),
    Layout(Arc<Layout>),
}

/// What became of all that was to be drawn.
#[rohrpost::data]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DrawingCounts {
    /// Rows that were handed to Rerun.
    pub drawn: u64,
    /// Rows that a newer one of the same entity replaced before they were drawn.
    pub replaced: u64,
    /// Lines that were pushed out by newer ones, and rows for which there was no room.
    pub dropped: u64,
    /// Times that drawing began anew: a viewer that was restarted, a file that was full.
    pub rebuilt: u64,
    /// Times that the viewer or the disk stood still, or that the disk took no more.
    pub stuck: u64,
}

struct Inner {
    entities: Vec<Entity>,
    index: HashMap<EntityPath, usize>,
    /// Entities with something pending: when it is due, its turn, which.
    due: BTreeSet<(Instant, u64, usize)>,
    turns: u64,
    /// What a new stream gets has its turn by then, and so many lines.
    repeated_at: (u64, usize),
    /// What entities hold.
    bytes: usize,
    lines_bytes: usize,
    lines: VecDeque<(EntityPath, Row)>,
    lines_kept: VecDeque<(EntityPath, Row)>,
    /// Whether a line has its turn before the next row.
    line_next: bool,
    layout: Option<Arc<Layout>>,
    layout_pending: bool,
    counts: DrawingCounts,
    closing: bool,
}

/// See the module's text.
pub(crate) struct Store {
    inner: Mutex<Inner>,
    changed: Condvar,
    /// An entity is drawn again only after this time.
    period: Duration,
}

impl Store {
    pub(crate) fn new(period: Duration) -> Self {
        let inner = Inner {
            entities: Vec::new(),
            index: HashMap::new(),
            due: BTreeSet::new(),
            turns: 0,
            repeated_at: (0, 0),
            bytes: 0,
            lines_bytes: 0,
            lines: VecDeque::new(),
            lines_kept: VecDeque::new(),
            line_next: false,
            layout: None,
            layout_pending: false,
            counts: DrawingCounts::default(),
            closing: false,
        };
        Self { inner: Mutex::new(inner), changed: Condvar::new(), period }
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        // Nothing in here panics rows way; and a drawing is worth less than the module that makes it.
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Something is to be drawn. Never waits for Rerun.
    pub(crate) fn put(&self, path: EntityPath, row: Row) {
        self.lock().put(path, row, self.period);
        self.changed.notify_one();
    }

    /// A line of text, which nothing replaces.
    pub(crate) fn line(&self, path: EntityPath, row: Row) {
        let mut inner = self.lock();
        if row.bytes() > LINE_BYTES_MAX {
            inner.counts.dropped += 1;
            return;
        }
        if inner.lines.len() == LINES_MAX {
            inner.drop_line();
        }
        let line = (path, row);
        inner.lines_bytes += line_bytes(&line);
        inner.lines.push_back(line);
        while inner.lines_bytes > LINES_BYTES_MAX {
            if !inner.forget_line() {
                inner.drop_line();
            }
        }
        drop(inner);
        self.changed.notify_one();
    }

    /// How the viewer arranges it from now on.
    pub(crate) fn arrange(&self, layout: Layout) {
        let mut inner = self.lock();
        inner.layout = Some(Arc::new(layout));
        inner.layout_pending = true;
        drop(inner);
        self.changed.notify_one();
    }

    pub(crate) fn layout(&self) -> Option<Arc<Layout>> {
        self.lock().layout.clone()
    }

    /// A stream begins that knows nothing: all is drawn again; `lines` too, unless the viewer has seen them.
    pub(crate) fn again(&self, lines: bool) {
        let mut inner = self.lock();
        inner.layout_pending = inner.layout.is_some();
        inner.due.clear();
        for at in 0..inner.entities.len() {
            let entity = &mut inner.entities[at];
            (entity.due, entity.drawn) = (None, None);
            entity.fixed.fold();
            entity.moving.fold();
            inner.queue(at, Duration::ZERO);
        }
        if lines {
            while inner.lines_kept.len() + inner.lines.len() > LINES_MAX && inner.forget_line() {}
            let mut kept = std::mem::take(&mut inner.lines_kept);
            kept.append(&mut inner.lines);
            inner.lines = kept;
        }
        inner.bytes = inner.entities.iter().map(Entity::bytes).sum();
        inner.repeated_at = (inner.turns, inner.lines.len());
    }

    /// Whether the stream has got all that was known when it began.
    pub(crate) fn has_repeated(&self) -> bool {
        let inner = self.lock();
        let (turn_then, lines) = inner.repeated_at;
        lines == 0 && inner.due.first().is_none_or(|(_, turn, _)| *turn > turn_then)
    }

    /// What is next, as soon as there is something; none when `give_up` says so or the store is closed and empty.
    pub(crate) fn next(&self, give_up: impl Fn() -> bool) -> Option<Order> {
        /// A feeder that was given up notices it within this time.
        const GLANCE: Duration = Duration::from_millis(100);
        let mut inner = self.lock();
        loop {
            if give_up() {
                return None;
            }
            let now = Instant::now();
            if let Some(order) = inner.take(now) {
                return Some(order);
            }
            if inner.closing && inner.due.is_empty() {
                return None;
            }
            let due = inner.due.first().map_or(GLANCE, |(due, ..)| due.saturating_duration_since(now));
            let (woken, _) = self.changed.wait_timeout(inner, due.min(GLANCE)).unwrap_or_else(PoisonError::into_inner);
            inner = woken;
        }
    }

    /// No more comes; what waits is due at once.
    pub(crate) fn close(&self) {
        self.lock().closing = true;
        self.changed.notify_all();
    }

    /// Whether nothing waits.
    pub(crate) fn is_empty(&self) -> bool {
        let inner = self.lock();
        inner.due.is_empty() && inner.lines.is_empty() && !inner.layout_pending
    }

    pub(crate) fn counts(&self) -> DrawingCounts {
        self.lock().counts
    }

    pub(crate) fn count(&self, change: impl FnOnce(&mut DrawingCounts)) {
        change(&mut self.lock().counts);
    }
}

impl Inner {
    fn put(&mut self, path: EntityPath, row: Row, period: Duration) {
        let known = self.index.get(&path).copied();
        let Some(at) = known.or_else(|| self.begin_entity(path, &row)) else {
            self.counts.dropped += 1;
            return;
        };
        let entity = &mut self.entities[at];
        let rows = if row.time.is_none() { &mut entity.fixed } else { &mut entity.moving };
        let mut before = rows.bytes();
        if self.bytes - before + rows.bytes_with(&row) > ENTITIES_BYTES_MAX {
            rows.fold();
            self.bytes = self.bytes - before + rows.bytes();
            before = rows.bytes();
        }
        if self.bytes - before + rows.bytes_with(&row) > ENTITIES_BYTES_MAX {
            self.counts.dropped += 1;
        } else {
            match &mut rows.pending {
                Some(pending) => {
                    // Another component, such as the place of a picture, replaces nothing.
                    self.counts.replaced += u64::from(pending.speaks_of(&row));
                    pending.replace_by(row);
                }
                none => *none = Some(row),
            }
            self.bytes = self.bytes - before + rows.bytes();
        }
        self.queue(at, period);
    }

    /// Makes room for an entity that comes with its first row, if there is some.
    fn begin_entity(&mut self, path: EntityPath, row: &Row) -> Option<usize> {
        let (fixed, moving) = (EntityRows::default(), EntityRows::default());
        let entity = Entity { path: path.clone(), fixed, moving, due: None, drawn: None };
        let bytes = entity.bytes();
        let at = self.entities.len();
        if at == ENTITIES_MAX || self.bytes + bytes + row.bytes() > ENTITIES_BYTES_MAX - RESERVE {
            return None;
        }
        self.bytes += bytes;
        self.entities.push(entity);
        self.index.insert(path, at);
        Some(at)
    }

    /// Puts an entity with something pending into the queue.
    fn queue(&mut self, at: usize, period: Duration) {
        let entity = &mut self.entities[at];
        if entity.due.is_some() || entity.fixed.pending.is_none() && entity.moving.pending.is_none() {
            return;
        }
        let now = Instant::now();
        let due = entity.drawn.map_or(now, |drawn| (drawn + period).max(now));
        self.turns += 1;
        entity.due = Some((due, self.turns));
        self.due.insert((due, self.turns, at));
    }

    fn take(&mut self, now: Instant) -> Option<Order> {
        if std::mem::take(&mut self.layout_pending) {
            return self.layout.clone().map(Order::Layout);
        }
        // Neither keeps the other waiting: a flood of lines, or a flood of rows.
        self.line_next = !self.line_next;
        let (path, row) = if self.line_next {
            self.take_line().or_else(|| self.take_row(now))
        } else {
            self.take_row(now).or_else(|| self.take_line())
        }?;
        self.counts.drawn += 1;
        Some(Order::Row(path, row))
    }

    fn take_line(&mut self) -> Option<(EntityPath, Row)> {
        let line = self.lines.pop_front()?;
        self.repeated_at.1 = self.repeated_at.1.saturating_sub(1);
        if self.lines_kept.len() == LINES_MAX {
            self.forget_line();
        }
        self.lines_kept.push_back(line.clone());
        Some(line)
    }

    /// The oldest line that waits is never drawn.
    fn drop_line(&mut self) {
        let Some(line) = self.lines.pop_front() else { return };
        self.lines_bytes -= line_bytes(&line);
        self.repeated_at.1 = self.repeated_at.1.saturating_sub(1);
        self.counts.dropped += 1;
    }

    /// The oldest line that was drawn is not kept any longer; false if there is none.
    fn forget_line(&mut self) -> bool {
        let Some(line) = self.lines_kept.pop_front() else { return false };
        self.lines_bytes -= line_bytes(&line);
        true
    }

    fn take_row(&mut self, now: Instant) -> Option<(EntityPath, Row)> {
        let (due, turn, at) = *self.due.first()?;
        if due > now && !self.closing {
            return None;
        }
        self.due.remove(&(due, turn, at));
        let entity = &mut self.entities[at];
        let before = entity.bytes();
        (entity.due, entity.drawn) = (None, Some(now));
        let rows = if entity.fixed.pending.is_some() { &mut entity.fixed } else { &mut entity.moving };
        let row = rows.pending.take()?;
        match &mut rows.last {
            Some(last) => last.replace_by(row.clone()),
            none => *none = Some(row.clone()),
        }
        self.bytes = self.bytes + entity.bytes() - before;
        let path = entity.path.clone();
        // Its other rows may be waiting still; for a new stream it is a part of what was known.
        let turns = self.turns;
        self.queue(at, Duration::ZERO);
        if turn <= self.repeated_at.0 && self.turns > turns {
            self.repeated_at.0 = self.turns;
        }
        Some((path, row))
    }
}

#[cfg(test)]
mod tests;
