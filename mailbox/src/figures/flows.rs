//! What everybody on a node sends, read from their tables (see `traffic`). Reading changes nothing.

use crate::clock::monotonic_ns;
use crate::figures::traffic::{FlowRow, Key, SECONDS_KEPT, TableView, Writer};
use crate::name::Name;
use crate::node::directory::Node;
use crate::node::entry::ParticipantInfo;
use crate::node::participant::Participant;
use crate::package::Type;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// A row is changed within nanoseconds, unless its writer was just put aside: then it gets time to go on. So many naps
/// are for all rows of all participants together, since launch looks too: neither a writer that was stopped in there
/// nor a damaged table may hold it up.
const TRIES_AT_ONCE: usize = 8;
const NAPS: u32 = 24;
const NAP: Duration = Duration::from_micros(100);

/// Packages of one type that one participant sends from one name to one mailbox, or values of one kind that it
/// publishes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FlowInfo {
    /// The process that sends.
    pub pid: u32,
    /// The module that it is; [`Name::NONE`] for one without a name.
    pub module: Name,
    /// Tells this use of the name from earlier ones: counts of different incarnations cannot be subtracted.
    pub incarnation: u32,
    /// The name in the packages' heads that answers go to.
    pub from: Name,
    /// The mailbox; [`Name::NONE`] for what is published (see [`FlowInfo::is_publication`]) and for the rest.
    pub to: Name,
    /// Type of the packages. Type 0 to no mailbox is the rest: packages that found no row of their own.
    pub kind: Type,
    /// Packages that were accepted, or values published.
    pub packages: u64,
    /// Bytes of their bodies. Of a published value, its own bytes, counted once however many subscribe.
    pub bytes: u64,
    /// Packages that were not accepted; their sender was told. Not a slot that was asked for and not lent
    /// ([`Sender::loan`](crate::Sender::loan)): it had no type yet, and only its mailbox counts it.
    pub refused: u64,
    /// When the first was sent, monotonic clock, ns; 0 in the rest.
    pub first_ns: u64,
    /// When the last was sent, monotonic clock, ns; 0 in the rest.
    pub last_ns: u64,
    /// Sum of the squares of the times from one to the next, ns².
    pub interval_squares_ns2: u128,
    /// Published values: sum of the ages (system time less stamp) that they had, ns.
    pub age_sum_ns: u64,
    /// Extremes of the last seconds in which something was sent, in no order.
    pub seconds: Vec<FlowSecond>,
}

/// Extremes of one second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlowSecond {
    /// Which second of the monotonic clock.
    pub second: u64,
    /// Shortest and longest time to a package of this second from the one before, ns; none when it was the first of
    /// all.
    pub interval_ns: Option<(u64, u64)>,
    /// Smallest and largest body.
    pub bytes: (u32, u32),
}

impl FlowInfo {
    /// Whether it counts published values, each once, and not the packages that carry them to subscribers.
    pub fn is_publication(&self) -> bool {
        self.to == Name::NONE && self.kind != Type(0)
    }

    /// Whether `other` is the same flow at another time, so that counts can be subtracted. One that lost its row to
    /// others and came back is not: it counts from 0 again, and its first package is another.
    pub fn is_same(&self, other: &Self) -> bool {
        let none_yet = self.packages == 0 || other.packages == 0;
        self.is_like(other) && (none_yet || self.first_ns == other.first_ns)
    }

    fn is_like(&self, other: &Self) -> bool {
        (self.incarnation, self.to, self.from, self.kind) == (other.incarnation, other.to, other.from, other.kind)
    }

    /// Packages a second between the last package that `earlier` saw and the last of all: exact, whenever one looks.
    /// None when there was no package since. Without `earlier`, or with one of another first package, since the first.
    pub fn rate_since(&self, earlier: Option<&Self>) -> Option<f64> {
        let (packages, from_ns) =
            match earlier.filter(|earlier| earlier.packages > 0 && earlier.first_ns == self.first_ns) {
                Some(earlier) => (self.packages.checked_sub(earlier.packages)?, earlier.last_ns),
                None => (self.packages.checked_sub(1)?, self.first_ns),
            };
        let ns = self.last_ns.checked_sub(from_ns)?;
        (packages > 0 && ns > 0).then(|| packages as f64 * 1e9 / ns as f64)
    }

    /// Adds what another sender of the same participant sends to the same place. Another process wrote it, so it may be
    /// anything.
    fn add(&mut self, other: Self) {
        self.packages = self.packages.saturating_add(other.packages);
        self.bytes = self.bytes.saturating_add(other.bytes);
        self.refused = self.refused.saturating_add(other.refused);
        let first = [self.first_ns, other.first_ns].into_iter().filter(|first| *first > 0);
        self.first_ns = first.min().unwrap_or(0);
        self.last_ns = self.last_ns.max(other.last_ns);
        self.interval_squares_ns2 = self.interval_squares_ns2.saturating_add(other.interval_squares_ns2);
        self.age_sum_ns = self.age_sum_ns.saturating_add(other.age_sum_ns);
        for more in other.seconds {
            match self.seconds.iter_mut().find(|second| second.second == more.second) {
                Some(second) => second.add(&more),
                None => self.seconds.push(more),
            }
        }
    }
}

impl FlowSecond {
    fn add(&mut self, other: &Self) {
        let both = self.interval_ns.zip(other.interval_ns).map(|(a, b)| (a.0.min(b.0), a.1.max(b.1)));
        self.interval_ns = both.or(self.interval_ns).or(other.interval_ns);
        self.bytes = (self.bytes.0.min(other.bytes.0), self.bytes.1.max(other.bytes.1));
    }
}

impl Node {
    /// What all participants that live send: each flow once. A package that is sent just now may be missing.
    pub fn traffic(&self) -> Vec<FlowInfo> {
        let mut flows = Vec::new();
        let mut naps = NAPS;
        for (claimant, participant) in self.living() {
            let Some(table) = TableView::open(self.directory(), claimant) else { continue };
            let first = flows.len();
            for flow in table.rows().iter().filter_map(|row| look(row, &participant, &mut naps)) {
                match flows[first..].iter_mut().find(|known: &&mut FlowInfo| known.is_like(&flow)) {
                    Some(known) => known.add(flow),
                    None => flows.push(flow),
                }
            }
        }
        flows
    }
}

/// A row as it stands, if anything was counted there. Takes from `naps` what it needs.
fn look(row: &FlowRow, participant: &ParticipantInfo, naps: &mut u32) -> Option<FlowInfo> {
    let mut tries = 0;
    while tries < TRIES_AT_ONCE || *naps > 0 {
        if let Some(flow) = row.read(|row| read(row, participant)) {
            return flow;
        }
        tries += 1;
        if tries >= TRIES_AT_ONCE && *naps > 0 {
            *naps -= 1;
            std::thread::sleep(NAP);
        }
    }
    // Its writer was stopped in there: its last package may be counted in half of the fields.
    read(row, participant)
}

fn read(row: &FlowRow, participant: &ParticipantInfo) -> Option<FlowInfo> {
    let load = |field: &std::sync::atomic::AtomicU64| field.load(Ordering::Relaxed);
    let (packages, refused) = (load(&row.packages), load(&row.refused));
    if packages == 0 && refused == 0 {
        return None;
    }
    let Key { to, from, kind } = row.key();
    let mut seconds = Vec::with_capacity(SECONDS_KEPT);
    for second in row.seconds.iter().filter(|second| load(&second.second) != 0) {
        let interval_ns = (load(&second.interval_min_ns), load(&second.interval_max_ns));
        let bytes = [&second.bytes_min, &second.bytes_max].map(|bytes| bytes.load(Ordering::Relaxed));
        seconds.push(FlowSecond {
            second: load(&second.second),
            interval_ns: (interval_ns.0 <= interval_ns.1).then_some(interval_ns),
            bytes: bytes.into(),
        });
    }
    Some(FlowInfo {
        pid: participant.pid,
        module: participant.module,
        incarnation: participant.incarnation,
        from,
        to,
        kind,
        packages,
        bytes: load(&row.bytes),
        refused,
        first_ns: load(&row.first_ns),
        last_ns: load(&row.last_ns),
        interval_squares_ns2: row.squares_ns2(),
        age_sum_ns: load(&row.age_ns),
        seconds,
    })
}

/// Counts what a participant publishes: each value once, however many subscribe.
pub struct Publications {
    participant: Arc<Participant>,
    writer: Writer,
}

impl Publications {
    /// Counts in the table of this participant.
    pub fn new(participant: &Arc<Participant>) -> Self {
        Self { participant: participant.clone(), writer: participant.traffic().writer() }
    }

    /// A value of so many bytes was published, so long after it was true. No heap, lock or system call.
    pub fn published(&mut self, from: Name, kind: Type, bytes: usize, age: Duration) {
        let age_ns = u64::try_from(age.as_nanos()).unwrap_or(u64::MAX);
        let key = Key { to: Name::NONE, from, kind };
        self.writer.accepted(self.participant.traffic(), key, bytes, monotonic_ns(), age_ns);
    }
}

impl Drop for Publications {
    fn drop(&mut self) {
        self.writer.leave(self.participant.traffic());
    }
}
