//! Records on their way: new ones of their observer, or those that a digest shows missing. Layout: docs/src/wire.md.

use super::record::{Kept, Kind, Ledger, NAMES_MAX, Named, ObjectId, RECORDS_MAX, Record, State};
use crate::bytes::{Malformed, Reader, put_position, put_version};
use crate::ids::RobotId;
use std::collections::BTreeMap;

/// First byte.
const KIND: u8 = b'R';
/// Second byte: changes with the layout.
const LAYOUT: u8 = 1;
/// Bytes of the largest message that is read or written: a package has room for them.
pub const RECORDS_BYTES_MAX: usize = 16_384;

/// Records of any observers.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct Records {
    /// The sender; it need not be the observer.
    pub from: RobotId,
    /// Digest of the map on which their positions are.
    pub map: u64,
    /// Whether the ledgers are whole, as a synchro has them; else they have what is new.
    pub is_synchro: bool,
    /// By observer. [`Kept::seen_ns`] is an age here, ns at sending; on the wire it is rounded down to ms.
    pub ledgers: BTreeMap<RobotId, Ledger>,
}

/// Bytes before the ledgers.
pub(crate) const HEAD_BYTES: usize = 16;

/// Bytes of a ledger in a message.
pub(crate) fn ledger_bytes(ledger: &Ledger) -> usize {
    10 + ledger.records.values().map(|kept| 32 + 17 * kept.record.names.len()).sum::<usize>()
}

impl Records {
    /// The bytes to send.
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = vec![KIND, LAYOUT, self.from.get(), self.ledgers.len() as u8, self.is_synchro.into(), 0, 0, 0];
        bytes.extend(self.map.to_le_bytes());
        for (observer, ledger) in &self.ledgers {
            bytes.extend([observer.get(), ledger.records.len() as u8]);
            put_version(&mut bytes, ledger.floor);
            for (number, kept) in &ledger.records {
                put_version(&mut bytes, *number);
                let age_ms = u32::try_from(kept.seen_ns / 1_000_000).unwrap_or(u32::MAX);
                bytes.extend(age_ms.to_le_bytes());
                put_record(&mut bytes, &kept.record);
            }
        }
        bytes
    }

    /// Reads a message.
    ///
    /// # Errors
    /// If the bytes are no records, or anything follows them.
    pub fn decode(bytes: &[u8]) -> Result<Self, Malformed> {
        let mut reader = Reader::new(bytes);
        reader.check(bytes.len() <= RECORDS_BYTES_MAX, "records have at most 16384 bytes")?;
        let is_head = reader.array()? == [KIND, LAYOUT];
        reader.check(is_head, "records begin with `R` and layout 1")?;
        let (from, count) = (reader.robot()?, reader.u8()?);
        let is_synchro = reader.u32()?;
        reader.check(is_synchro <= 1, "a synchro has 1 here, others 0, and three bytes are 0")?;
        let map = reader.u64()?;
        let mut ledgers = BTreeMap::new();
        for _ in 0..count {
            let observer = reader.robot()?;
            let is_next = ledgers.last_key_value().is_none_or(|(last, _)| *last < observer);
            reader.check(is_next, "observers ascend")?;
            ledgers.insert(observer, read_ledger(&mut reader)?);
        }
        reader.end()?;
        Ok(Self { from, map, is_synchro: is_synchro == 1, ledgers })
    }
}

fn read_ledger(reader: &mut Reader<'_>) -> Result<Ledger, Malformed> {
    let count = reader.u8()?;
    reader.check(usize::from(count) <= RECORDS_MAX, "an observer has at most 32 records")?;
    let mut ledger = Ledger { floor: reader.version()?, records: BTreeMap::new() };
    for _ in 0..count {
        let number = reader.version()?;
        let is_next = ledger.records.last_key_value().is_none_or(|(last, _)| *last < number);
        reader.check(is_next, "numbers ascend")?;
        let seen_ns = u64::from(reader.u32()?) * 1_000_000;
        let record = read_record(reader)?;
        reader.check(record.version >= number, "no record is older than its object")?;
        reader.check(record.version >= ledger.floor, "no record is below the floor")?;
        ledger.records.insert(number, Kept { record, seen_ns });
    }
    Ok(ledger)
}

/// 20 bytes, and 17 for each name.
pub(crate) fn put_record(bytes: &mut Vec<u8>, record: &Record) {
    put_version(bytes, record.version);
    let may_be = record.may_be.map_or(0, RobotId::get);
    bytes.extend([record.state as u8, record.kind as u8, may_be, record.names.len() as u8]);
    put_position(bytes, record.position);
    for named in &record.names {
        bytes.push(named.object.observer.get());
        put_version(bytes, named.object.number);
        put_version(bytes, named.version);
    }
}

fn read_record(reader: &mut Reader<'_>) -> Result<Record, Malformed> {
    let version = reader.version()?;
    let [state, kind, may_be, count] = reader.array()?;
    let states = [State::Seen, State::Uncertain, State::Empty, State::Gone];
    let state = *states.get(usize::from(state)).ok_or_else(|| reader.wrong("a state is 0 to 3"))?;
    let kinds = [Kind::Intruder, Kind::Fake];
    let kind = *kinds.get(usize::from(kind)).ok_or_else(|| reader.wrong("a kind is 0 or 1"))?;
    reader.check(may_be < u8::MAX, "a robot's number is 1 to 254, or 0 for none")?;
    reader.check(usize::from(count) <= NAMES_MAX, "a record names at most 8 others")?;
    let (position, may_be) = (reader.position()?, RobotId::new(may_be));
    let mut names: Vec<Named> = Vec::with_capacity(count.into());
    for _ in 0..count {
        let object = ObjectId { observer: reader.robot()?, number: reader.version()? };
        let named = Named { object, version: reader.version()? };
        reader.check(names.last().is_none_or(|last| last < &named), "names ascend")?;
        names.push(named);
    }
    Ok(Record { version, state, kind, position, may_be, names })
}
