//! What a participant sends, in memory that anyone may read: to which name, from which, which type, how much and how
//! often. Looking at it sends nothing and asks nobody, so it changes nothing.
//!
//! ```text
//! traffic.N  =  header (64 B)  +  128 rows (256 B each), one for each receiver, sender's name and type of package
//!                                 │ ▲
//!            a Sender owns a row ─┘ └─ an earlier Sender of the same left the row idle, counts and all
//! ```
//!
//! A row has one writer, which loads and stores: sending to where it sent before costs no read-modify-write, no lock
//! and no search. The last row takes packages that find no other, from all of the participant's senders; it counts, and
//! tells no times. A value published that finds none is not counted, since it is no package; those that carry it to
//! subscribers are. A new participant of the same index makes a new file: readers of the old one are not confused.

use crate::cell::SeqCount;
use crate::memory::files::{Directory, allocate};
use crate::memory::layout::{MAGIC, VERSION};
use crate::memory::mapping::{Located, Mapping, Shared, Use};
use crate::name::Name;
use crate::node::beside::unfinished;
use crate::node::directory::Node;
use crate::node::error::NodeError;
use crate::package::Type;
use crate::slots::word::Claimant;
use crate::step::step;
use std::mem::offset_of;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

/// Rows of a participant; the last takes the rest.
pub(crate) const FLOWS: usize = 128;
const REST: usize = FLOWS - 1;
/// Seconds of which each row remembers the extremes.
pub(crate) const SECONDS_KEPT: usize = 4;
/// Rows that a writer finds without a search: more kinds of package than most send to one mailbox.
const RECENT: usize = 4;

/// [`FlowRow::writer`] of a row that was never used, and of one that its writer has left.
const UNUSED: u32 = 0;
const IDLE: u32 = u32::MAX;

/// The first line of the file.
#[repr(C, align(64))]
struct Header {
    magic: AtomicU64,
    version: AtomicU32,
    participant: AtomicU32,
    incarnation: AtomicU32,
    rows: AtomicU32,
}

/// Extremes of one second of the monotonic clock.
#[repr(C)]
pub(crate) struct Second {
    /// Which second; 0: none yet.
    pub(crate) second: AtomicU64,
    /// Shortest and longest time since the package before, ns; of packages that came in this second.
    pub(crate) interval_min_ns: AtomicU64,
    pub(crate) interval_max_ns: AtomicU64,
    /// Smallest and largest body.
    pub(crate) bytes_min: AtomicU32,
    pub(crate) bytes_max: AtomicU32,
}

#[repr(C, align(64))]
pub(crate) struct FlowRow {
    writer: AtomicU32,
    /// Guards all that follows.
    sequence: SeqCount,
    pub(crate) to: AtomicU32,
    pub(crate) from: AtomicU32,
    /// As the 16 bits of a head.
    pub(crate) kind: AtomicU32,
    padding: AtomicU32,
    pub(crate) packages: AtomicU64,
    pub(crate) bytes: AtomicU64,
    pub(crate) refused: AtomicU64,
    pub(crate) first_ns: AtomicU64,
    pub(crate) last_ns: AtomicU64,
    /// Sum of the squares of the intervals, ns²: the lower and the upper half. Exact, so that what came before a window
    /// can be subtracted, also after an hour of silence.
    pub(crate) squares: [AtomicU64; 2],
    /// Publications: sum of the ages that values had.
    pub(crate) age_ns: AtomicU64,
    spare: [AtomicU64; 5],
    pub(crate) seconds: [Second; SECONDS_KEPT],
}

/// The file `traffic.N`.
#[repr(C)]
pub(crate) struct TrafficPage {
    header: Header,
    rows: [FlowRow; FLOWS],
}

// SAFETY: made of atomics alone.
unsafe impl Shared for TrafficPage {}

const _: () = assert!(size_of::<Header>() == 64 && size_of::<Second>() == 32 && size_of::<FlowRow>() == 256);
const _: () = assert!(offset_of!(FlowRow, packages) == 24 && offset_of!(FlowRow, seconds) == 128);

/// What a row counts.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(crate) struct Key {
    pub(crate) to: Name,
    pub(crate) from: Name,
    pub(crate) kind: Type,
}

impl Key {
    /// Published values are sent to nobody by themselves.
    fn is_publication(&self) -> bool {
        self.to == Name::NONE
    }
}

/// A participant's table, which only it writes.
pub(crate) struct Table {
    page: Located<TrafficPage>,
    /// Its name.
    file: String,
    /// Numbers its writers.
    writers: AtomicU32,
}

fn file_name(participant: u16) -> String {
    format!("traffic.{participant}")
}

impl Table {
    /// Makes the file, whole, in place of what an earlier participant of this index left. The caller holds the index's
    /// lock.
    pub(crate) fn make(node: &Node, me: Claimant) -> Result<Self, NodeError> {
        let name = file_name(me.participant);
        let (directory, unfinished) = (node.directory(), unfinished(&name));
        let made = || {
            let file = directory.make_anew(&unfinished)?;
            step!("traffic: file");
            allocate(&file, size_of::<TrafficPage>())?;
            let mapping = Mapping::new(&file, size_of::<TrafficPage>(), Use::Keep)?;
            let page = mapping.locate::<TrafficPage>(0);
            let header = &page.header;
            header.version.store(VERSION, Ordering::Relaxed);
            header.participant.store(me.participant.into(), Ordering::Relaxed);
            header.incarnation.store(me.incarnation, Ordering::Relaxed);
            header.rows.store(FLOWS as u32, Ordering::Relaxed);
            header.magic.store(MAGIC, Ordering::Release);
            step!("traffic: formatted");
            directory.rename(&unfinished, &name)?;
            step!("traffic: named");
            Ok(page)
        };
        match made() {
            Ok(page) => Ok(Self { page, file: name, writers: AtomicU32::new(0) }),
            Err(error) => {
                let _ = directory.remove(&unfinished);
                Err(NodeError::of(&node.path().join(name), error))
            }
        }
    }

    /// Takes the file's name away. The caller holds the index's lock, in this very directory.
    pub(crate) fn remove(&self, node: &Node) {
        let _ = node.directory().remove(&self.file);
    }

    fn rows(&self) -> &[FlowRow; FLOWS] {
        &self.page.rows
    }

    /// One that counts in rows of its own.
    pub(crate) fn writer(&self) -> Writer {
        // Neither of the two that mean something else; a number that comes round again finds its row's old writer long
        // gone.
        let me = self.writers.fetch_add(1, Ordering::Relaxed) % (IDLE - 1) + 1;
        Writer { me, recent: [None; RECENT] }
    }

    /// A row for this key: the one that an earlier writer of the same left, a new one, the idlest of others, or the
    /// last.
    #[cold]
    fn claim(&self, me: u32, key: Key) -> usize {
        let rows = &self.rows()[..REST];
        let take = |row: &FlowRow, from: u32| {
            row.writer.compare_exchange(from, me, Ordering::Acquire, Ordering::Relaxed).is_ok()
        };
        if let Some(at) = rows.iter().position(|row| row.writer() == IDLE && row.key() == key && take(row, IDLE)) {
            // Another sender that saw it idle may have taken it for another key meanwhile.
            if rows[at].key() == key {
                return at;
            }
            rows[at].writer.store(IDLE, Ordering::Release);
        }
        if let Some(at) = rows.iter().position(|row| row.writer() == UNUSED && take(row, UNUSED)) {
            rows[at].write(|row| row.set_key(key));
            step!("traffic: row");
            return at;
        }
        let idle = rows.iter().enumerate().filter(|(_, row)| row.writer() == IDLE);
        match idle.min_by_key(|(_, row)| row.last_ns.load(Ordering::Relaxed)).map(|(at, _)| at) {
            Some(at) if take(&rows[at], IDLE) => {
                rows[at].write(|row| {
                    if !row.key().is_publication() {
                        self.add_to_rest(row);
                    }
                    row.set_key(key);
                });
                at
            }
            _ => REST,
        }
    }

    /// What a row has counted goes to the rest, so that sums stay what they are. While the row is being written, so
    /// that a reader that sees it empty, and then looks at the rest, finds it there; one that saw it full a moment
    /// before sees it twice, never not at all.
    fn add_to_rest(&self, row: &FlowRow) {
        let rest = &self.rows()[REST];
        let pairs = [(&row.packages, &rest.packages), (&row.bytes, &rest.bytes), (&row.refused, &rest.refused)];
        for (from, to) in pairs {
            to.fetch_add(from.load(Ordering::Relaxed), Ordering::Relaxed);
        }
    }
}

/// A table as others read it.
pub(crate) struct TableView(Located<TrafficPage>);

impl TableView {
    /// The table of this participant, if it is there, whole, and of this use of the index.
    pub(crate) fn open(node: &Directory, claimant: Claimant) -> Option<Self> {
        let file = node.open_to_read(&file_name(claimant.participant)).ok()?;
        let mapping = Mapping::new(&file, size_of::<TrafficPage>(), Use::Look).ok()?;
        let page = mapping.locate::<TrafficPage>(0);
        let header = &page.header;
        let said = [&header.version, &header.participant, &header.incarnation, &header.rows];
        let expected = [VERSION, claimant.participant.into(), claimant.incarnation, FLOWS as u32];
        let same = header.magic.load(Ordering::Acquire) == MAGIC
            && said.iter().zip(expected).all(|(said, expected)| said.load(Ordering::Relaxed) == expected);
        same.then_some(Self(page))
    }

    pub(crate) fn rows(&self) -> &[FlowRow; FLOWS] {
        &self.0.rows
    }
}

/// Counts in rows of its own.
pub(crate) struct Writer {
    me: u32,
    /// What it sent last, and where that is counted; the last first.
    recent: [Option<(Key, usize)>; RECENT],
}

impl Writer {
    /// A package was accepted, or a value published, at this moment of the monotonic clock.
    #[inline(always)]
    pub(crate) fn accepted(&mut self, table: &Table, key: Key, bytes: usize, at_ns: u64, age_ns: u64) {
        let at = self.row(table, key);
        let row = &table.rows()[at];
        if at == REST && key.is_publication() {
            return;
        }
        if at == REST {
            // Shared by all writers of the participant, and rare.
            row.packages.fetch_add(1, Ordering::Relaxed);
            row.bytes.fetch_add(bytes as u64, Ordering::Relaxed);
        } else {
            row.write(|row| row.count(bytes, at_ns, age_ns));
        }
    }

    /// A package was not accepted, and its sender is told.
    pub(crate) fn refused(&mut self, table: &Table, key: Key) {
        let at = self.row(table, key);
        let row = &table.rows()[at];
        if at == REST {
            row.refused.fetch_add(1, Ordering::Relaxed);
        } else {
            row.write(|row| add(&row.refused, 1));
        }
    }

    #[inline(always)]
    fn row(&mut self, table: &Table, key: Key) -> usize {
        match self.recent[0] {
            Some((last, at)) if last == key => at,
            _ => self.row_of_another(table, key),
        }
    }

    /// The row of another key than the last.
    fn row_of_another(&mut self, table: &Table, key: Key) -> usize {
        let known = |recent: &Option<(Key, usize)>| recent.is_some_and(|(known, _)| known == key);
        if let Some(place) = self.recent.iter().position(known) {
            self.recent[..=place].rotate_right(1);
        } else {
            self.recent.rotate_right(1);
            self.recent[0] = Some((key, self.row_in(table, key)));
        }
        self.recent[0].map_or(REST, |(_, at)| at)
    }

    fn row_in(&self, table: &Table, key: Key) -> usize {
        let own = |row: &FlowRow| row.writer() == self.me && row.key() == key;
        table.rows()[..REST].iter().position(own).unwrap_or_else(|| table.claim(self.me, key))
    }

    /// Leaves its rows to others. Afterwards it has none.
    pub(crate) fn leave(&mut self, table: &Table) {
        self.recent = [None; RECENT];
        for row in table.rows()[..REST].iter().filter(|row| row.writer() == self.me) {
            // ORDERING: Release; the next writer continues from what was written here.
            row.writer.store(IDLE, Ordering::Release);
        }
    }
}

/// By the only writer of a row.
fn add(count: &AtomicU64, more: u64) {
    count.store(count.load(Ordering::Relaxed).wrapping_add(more), Ordering::Relaxed);
}

impl FlowRow {
    fn writer(&self) -> u32 {
        self.writer.load(Ordering::Acquire)
    }

    pub(crate) fn key(&self) -> Key {
        Key {
            to: Name::from_raw(self.to.load(Ordering::Relaxed)),
            from: Name::from_raw(self.from.load(Ordering::Relaxed)),
            kind: Type(self.kind.load(Ordering::Relaxed) as i16),
        }
    }

    /// Changes fields so that readers see all of the change or none. By the row's writer alone.
    fn write(&self, change: impl FnOnce(&Self)) {
        self.sequence.write(|| change(self));
    }

    /// What `look` sees while nobody changes it; none when its writer is inside just now, as it is for nanoseconds.
    pub(crate) fn read<T>(&self, look: impl FnOnce(&Self) -> T) -> Option<T> {
        self.sequence.read(|| look(self)).map(|(_, seen)| seen)
    }

    fn set_key(&self, key: Key) {
        self.to.store(key.to.raw(), Ordering::Relaxed);
        self.from.store(key.from.raw(), Ordering::Relaxed);
        self.kind.store(u32::from(key.kind.0 as u16), Ordering::Relaxed);
        let counts = [&self.packages, &self.bytes, &self.refused, &self.first_ns, &self.last_ns, &self.age_ns];
        counts.into_iter().chain(&self.squares).for_each(|count| count.store(0, Ordering::Relaxed));
        self.seconds.iter().for_each(|second| second.second.store(0, Ordering::Relaxed));
    }

    pub(crate) fn squares_ns2(&self) -> u128 {
        let [low, high] = [0, 1].map(|half| u128::from(self.squares[half].load(Ordering::Relaxed)));
        high << 64 | low
    }

    #[inline(always)]
    fn count(&self, bytes: usize, at_ns: u64, age_ns: u64) {
        let interval_ns = if self.packages.load(Ordering::Relaxed) == 0 {
            self.first_ns.store(at_ns, Ordering::Relaxed);
            None
        } else {
            let interval_ns = at_ns.saturating_sub(self.last_ns.load(Ordering::Relaxed));
            let squares = self.squares_ns2().wrapping_add(u128::from(interval_ns).pow(2));
            self.squares[0].store(squares as u64, Ordering::Relaxed);
            self.squares[1].store((squares >> 64) as u64, Ordering::Relaxed);
            Some(interval_ns)
        };
        self.last_ns.store(at_ns, Ordering::Relaxed);
        add(&self.packages, 1);
        add(&self.bytes, bytes as u64);
        add(&self.age_ns, age_ns);
        self.seconds[(at_ns / 1_000_000_000) as usize % SECONDS_KEPT].count(at_ns, interval_ns, bytes as u32);
    }
}

impl Second {
    #[inline(always)]
    fn count(&self, at_ns: u64, interval_ns: Option<u64>, bytes: u32) {
        let second = at_ns / 1_000_000_000;
        if self.second.load(Ordering::Relaxed) != second {
            self.second.store(second, Ordering::Relaxed);
            self.interval_min_ns.store(u64::MAX, Ordering::Relaxed);
            self.interval_max_ns.store(0, Ordering::Relaxed);
            self.bytes_min.store(u32::MAX, Ordering::Relaxed);
            self.bytes_max.store(0, Ordering::Relaxed);
        }
        if let Some(interval_ns) = interval_ns {
            let (min, max) = (&self.interval_min_ns, &self.interval_max_ns);
            min.store(min.load(Ordering::Relaxed).min(interval_ns), Ordering::Relaxed);
            max.store(max.load(Ordering::Relaxed).max(interval_ns), Ordering::Relaxed);
        }
        let (min, max) = (&self.bytes_min, &self.bytes_max);
        min.store(min.load(Ordering::Relaxed).min(bytes), Ordering::Relaxed);
        max.store(max.load(Ordering::Relaxed).max(bytes), Ordering::Relaxed);
    }
}
