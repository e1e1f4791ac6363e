//! What a team knows of intruders: records of observers, joined without a clock.
//!
//! ```text
//!  RobotId ──▶ Ledger: floor, number ──▶ Record: version, state, position, names   (the observer alone writes it)
//!                └──▶ digest of part (observer % 8), in each hello
//!  all records ──▶ Standing: what is superseded ──▶ Object: connected records, `certain`, `may_be`
//! ```
//!
//! - **Join.** Of each record the newest version stands: the rule of Scuttlebutt (van Renesse and others, 2008). Unlike
//!   there, no highest version stands for those below it: digests cover each record, so a lost one shows.
//! - **Five sources** (seed 000, 4.4.2): own detection and own non-detection ([`View::look`]), a teammate's record and
//!   a synchro ([`View::join`]), and ageing ([`View::age`]). Ageing is a record, too: the observer writes it by its own
//!   clock, the leader for observers that are not fresh. So `certain` is the same for all that have the same records.
//! - **Forgetting.** An observer has at most [`RECORDS_MAX`] records. Before it writes one more, it raises its *floor*
//!   above the oldest ended record; older ones that still count it writes again. The floor travels with the new record,
//!   so forgetting sends nothing of its own. Older copies elsewhere are dropped by the floor.

mod look;
mod message;
mod record;
mod settings;
mod standing;

pub use message::{RECORDS_BYTES_MAX, Records};
pub use record::{Kept, Kind, Ledger, NAMES_MAX, Named, ObjectId, RECORDS_MAX, Record, State};
pub use settings::{Friend, ViewSettings};
pub use standing::Object;

use crate::group::PARTS;
use crate::ids::{Position, RobotId, Version};
use settings::{Numbers, Track};
use siphasher::sip::SipHasher13;
use standing::Standing;
use std::collections::{BTreeMap, BTreeSet};
use std::hash::Hasher;

/// Bytes that a synchro has at most; the rest goes with the next one. A whole ledger fits.
const SYNCHRO_BYTES_MAX: usize = 8192;

/// The records that a robot has.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct View {
    me: RobotId,
    map: u64,
    settings: ViewSettings,
    numbers: Numbers,
    ledgers: BTreeMap<RobotId, Ledger>,
    digests: [u32; PARTS],
    tracks: Vec<Track>,
    /// The observer with which the last synchro ended.
    cursor: u8,
}

impl View {
    /// An empty view of a robot that starts. `map` is the digest of the map on which positions are.
    pub fn new(me: RobotId, incarnation: u32, map: u64, settings: ViewSettings) -> Self {
        let numbers = Numbers { version: Version { incarnation, counter: 0 }, unsent: BTreeSet::new() };
        let (ledgers, digests) = (BTreeMap::new(), [0; PARTS]);
        Self { me, map, settings, numbers, ledgers, digests, tracks: Vec::new(), cursor: 0 }
    }

    /// The robot has a greater incarnation now.
    pub(crate) fn raise_incarnation(&mut self, incarnation: u32) {
        let version = Version { incarnation, counter: 0 };
        self.numbers.version = self.numbers.version.max(version);
    }

    /// Digest of the map on which positions are.
    pub fn map(&self) -> u64 {
        self.map
    }

    /// Digests of the parts: views with equal digests have equal records.
    pub fn digests(&self) -> [u32; PARTS] {
        self.digests
    }

    /// All records, by observer.
    pub fn ledgers(&self) -> &BTreeMap<RobotId, Ledger> {
        &self.ledgers
    }

    /// The intruders, by id.
    pub fn objects(&self) -> Vec<Object> {
        Standing::of(&self.ledgers).objects(&self.ledgers, self.settings.gate_mm)
    }

    /// Takes over all that is newer in a message, but nothing from another map. Returns the parts that it changed, a
    /// bit for each.
    pub fn join(&mut self, now_ns: u64, mut records: Records) -> u8 {
        if records.map != self.map {
            return 0;
        }
        let mut changed = 0;
        for (observer, ledger) in &mut records.ledgers {
            for kept in ledger.records.values_mut() {
                kept.seen_ns = now_ns.saturating_sub(kept.seen_ns);
            }
            if self.ledgers.entry(*observer).or_default().join(ledger) {
                changed |= part_bit(*observer);
            }
        }
        if let Some(own) = self.ledgers.get(&self.me) {
            // Records of an earlier incarnation, which lost them: what is written from now on is newer.
            let newest = own.records.values().map(|kept| kept.record.version).fold(own.floor, Version::max);
            self.numbers.version = self.numbers.version.max(newest);
        }
        self.digest(changed);
        changed
    }

    /// Own records that were not sent yet, if there are any.
    pub fn take_unsent(&mut self, now_ns: u64) -> Option<Records> {
        let unsent = std::mem::take(&mut self.numbers.unsent);
        let own = self.ledgers.get(&self.me).filter(|_| !unsent.is_empty())?;
        let mut ledger = aged(own, now_ns);
        ledger.records.retain(|number, _| unsent.contains(number));
        let ledgers = BTreeMap::from([(self.me, ledger)]);
        Some(Records { from: self.me, map: self.map, is_synchro: false, ledgers })
    }

    /// The records of some parts, a bit for each, as many as one message has room for; the next message goes on from
    /// there.
    pub fn synchro(&mut self, now_ns: u64, parts: u8) -> Records {
        let mut records = Records { from: self.me, map: self.map, is_synchro: true, ledgers: BTreeMap::new() };
        let mut bytes = message::HEAD_BYTES;
        let start = self.cursor;
        let (behind, before) = (self.ledgers.iter(), self.ledgers.iter());
        let order = behind.filter(|(it, _)| it.get() > start).chain(before.filter(|(it, _)| it.get() <= start));
        for (observer, ledger) in order.filter(|(it, _)| part_bit(**it) & parts != 0) {
            bytes += message::ledger_bytes(ledger);
            if bytes > SYNCHRO_BYTES_MAX {
                break;
            }
            records.ledgers.insert(*observer, aged(ledger, now_ns));
            self.cursor = observer.get();
        }
        records
    }

    /// A station makes up an intruder. Only [`Self::end_fake`] ends it.
    pub fn add_fake(&mut self, now_ns: u64, position: Position) -> ObjectId {
        let version = Version::default();
        let (state, kind) = (State::Seen, Kind::Fake);
        self.write(now_ns, None, Record { version, state, kind, position, may_be: None, names: Vec::new() })
    }

    /// A station moves an intruder that it has made up. False if there is no such one of this station.
    pub fn move_fake(&mut self, now_ns: u64, id: ObjectId, position: Position) -> bool {
        self.change_fake(now_ns, id, |record| Record { position, ..record })
    }

    /// A station ends an intruder that it has made up. False if there is no such one of this station.
    pub fn end_fake(&mut self, now_ns: u64, id: ObjectId) -> bool {
        self.change_fake(now_ns, id, |record| Record { state: State::Gone, ..record })
    }

    fn change_fake(&mut self, now_ns: u64, id: ObjectId, change: impl FnOnce(Record) -> Record) -> bool {
        let own = self.ledgers.get(&self.me).filter(|_| id.observer == self.me);
        let fake = own.and_then(|own| own.records.get(&id.number)).map(|kept| kept.record.clone());
        let Some(record) = fake.filter(|record| record.kind == Kind::Fake && !record.is_ended()) else { return false };
        self.write(now_ns, Some(id.number), change(record));
        true
    }

    /// Writes an own record in a new version: of an object, or of a new one.
    fn write(&mut self, seen_ns: u64, number: Option<Version>, record: Record) -> ObjectId {
        if number.is_none() {
            self.make_room();
        }
        self.numbers.version = self.numbers.version.next();
        let version = self.numbers.version;
        let number = number.unwrap_or(version);
        let own = self.ledgers.entry(self.me).or_default();
        own.records.insert(number, Kept { record: Record { version, ..record }, seen_ns });
        self.numbers.unsent.insert(number);
        self.digest(part_bit(self.me));
        ObjectId { observer: self.me, number }
    }

    /// Forgets the own record that matters least, if there are as many as there may be.
    fn make_room(&mut self) {
        let Some(own) = self.ledgers.get(&self.me).filter(|own| own.records.len() >= RECORDS_MAX) else { return };
        let standing = Standing::of(&self.ledgers);
        // First what has ended and names nothing that is there; then what exists; last what ends others' records.
        let rank = |kept: &Kept| match (kept.record.is_ended(), self.names_something(&kept.record)) {
            (true, false) => 0,
            (false, _) => 1,
            (true, true) => 2,
        };
        let victim = own.records.iter().min_by_key(|(_, kept)| (rank(kept), kept.record.version));
        let Some((victim, floor)) = victim.map(|(number, kept)| (*number, kept.record.version.next())) else { return };
        let mut again: Vec<(Version, Kept)> = own.records.clone().into_iter().collect();
        again.retain(|(number, kept)| *number != victim && kept.record.version < floor);
        again.sort_by_key(|(_, kept)| kept.record.version);
        for (number, mut kept) in again {
            // What others have said of the old version stands in the new one.
            kept.record.state = standing.state(ObjectId { observer: self.me, number }, &kept.record);
            self.write(kept.seen_ns, Some(number), kept.record);
        }
        if let Some(own) = self.ledgers.get_mut(&self.me) {
            own.records.remove(&victim);
            own.raise_floor(floor);
            self.numbers.unsent.retain(|number| own.records.contains_key(number));
        }
        self.digest(part_bit(self.me));
    }

    /// Whether a record names a record that is known in no newer version.
    fn names_something(&self, record: &Record) -> bool {
        record.names.iter().any(|named| {
            let there = self.ledgers.get(&named.object.observer).and_then(|it| it.records.get(&named.object.number));
            there.is_some_and(|kept| kept.record.version <= named.version)
        })
    }

    /// Computes the digests of some parts anew.
    fn digest(&mut self, parts: u8) {
        for part in (0..PARTS).filter(|part| parts >> part & 1 == 1) {
            let ledgers = self.ledgers.iter().filter(|(observer, _)| usize::from(observer.get()) % PARTS == part);
            self.digests[part] =
                ledgers.map(|(observer, ledger)| ledger_digest(*observer, ledger)).fold(0, |a, b| a ^ b);
        }
    }
}

/// The part of an observer's records, as a bit.
pub(crate) fn part_bit(observer: RobotId) -> u8 {
    1 << (usize::from(observer.get()) % PARTS)
}

/// Digest of a map's file, by which robots tell that they have the same one. Never 0, which stands for no map.
pub fn map_digest(file: &[u8]) -> u64 {
    let mut hasher = SipHasher13::new();
    hasher.write(file);
    hasher.finish().max(1)
}

/// Digest of what all robots can know of a ledger; 0 of one that says nothing.
fn ledger_digest(observer: RobotId, ledger: &Ledger) -> u32 {
    if *ledger == Ledger::default() {
        return 0;
    }
    let mut bytes = vec![observer.get()];
    crate::bytes::put_version(&mut bytes, ledger.floor);
    for (number, kept) in &ledger.records {
        crate::bytes::put_version(&mut bytes, *number);
        message::put_record(&mut bytes, &kept.record);
    }
    let mut hasher = SipHasher13::new();
    hasher.write(&bytes);
    hasher.finish() as u32
}

/// A ledger with ages in the place of times.
fn aged(ledger: &Ledger, now_ns: u64) -> Ledger {
    let mut ledger = ledger.clone();
    ledger.records.values_mut().for_each(|kept| kept.seen_ns = now_ns.saturating_sub(kept.seen_ns));
    ledger
}
