//! A hello: what a robot sends each beat. Layout: docs/src/wire.md.

use crate::bytes::{Malformed, Reader, put_position, put_version};
use crate::ids::{Position, RobotId, Version};

/// Bytes before the entries.
pub const HELLO_HEAD_BYTES: usize = 96;
/// Bytes of an entry.
pub const HELLO_ENTRY_BYTES: usize = 12;
/// Parts of a view that have digests of their own: the ledger of observer `n` is in part `n % 8`.
pub const PARTS: usize = 8;
/// Longest way of a counter from robot to robot. One that has come so far goes no further.
pub const HOPS_MAX: u8 = 31;

/// First byte of a hello.
const KIND: u8 = b'H';
/// Second byte: changes with the layout.
const LAYOUT: u8 = 1;
/// Unit of [`Entry::age_ns`] on the wire.
const AGE_UNIT_NS: u64 = 128_000;
/// Ages of so many units or more are not told.
const AGE_UNITS_MAX: u32 = (1 << 18) - 1;
const AGREES: u8 = 1;
const HAS_POSE: u8 = 2;
const HAS_REFERENCE: u8 = 4;

/// What a robot says of itself, and of the robots that it knows to be alive.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct Hello {
    /// The sender.
    pub from: RobotId,
    /// The incarnation, and the counter that rises with each hello.
    pub version: Version,
    /// Digest of the map on which its positions are.
    pub map: u64,
    /// The sender's clock when it sent this, ns.
    pub sent_ns: u64,
    /// Digests of the parts of its view.
    pub digests: [u32; PARTS],
    /// Part of the digest of its tree of events; 0 without one: [`crate::events::Tree::short_digest`].
    pub tree: u16,
    /// Whether its view has the digests of all fresh robots that it hears itself.
    pub agrees: bool,
    /// Where it is; `None` while it does not know.
    pub pose: Option<Pose>,
    /// How the leader's clock differs from the sender's.
    pub reference: Option<Reference>,
    /// All other robots that are fresh for the sender, by ascending id.
    pub entries: Vec<Entry>,
}

/// Where a robot is and how it moves.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct Pose {
    /// On the team's map.
    pub position: Position,
    /// Counterclockwise from x, milliradians.
    pub heading_mrad: i16,
    /// Forward, mm/s.
    pub speed_mm_s: i16,
}

/// A clock, as the sender of a hello knows it.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Reference {
    /// The robot that has this clock.
    pub robot: RobotId,
    /// The incarnation: a restarted robot may have another clock.
    pub incarnation: u32,
    /// That clock minus the sender's, ns.
    pub offset_ns: i64,
    /// Greatest error of the offset, ns.
    pub bound_ns: u64,
}

/// The newest counter of another robot.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Entry {
    /// The robot.
    pub robot: RobotId,
    /// Incarnation and counter of its newest hello.
    pub version: Version,
    /// Robots between it and the sender; 0: the sender heard that hello itself.
    pub hops: u8,
    /// For how long the sender and those before it have had the counter, ns: without the time on the air, and rounded
    /// down to a multiple of 128 µs.
    pub age_ns: u64,
    /// [`Hello::agrees`] of that hello.
    pub agrees: bool,
}

impl Entry {
    /// Whether the entry can be sent: not from too far away, not too old.
    pub(crate) fn is_tellable(&self) -> bool {
        self.hops <= HOPS_MAX && self.age_ns / AGE_UNIT_NS < u64::from(AGE_UNITS_MAX)
    }

    fn encode(&self, bytes: &mut Vec<u8>) {
        bytes.push(self.robot.get());
        put_version(bytes, self.version);
        let units = (self.age_ns / AGE_UNIT_NS).min(u64::from(AGE_UNITS_MAX) - 1) as u32;
        let last = units | u32::from(self.hops.min(HOPS_MAX)) << 18 | u32::from(self.agrees) << 23;
        bytes.extend(&last.to_le_bytes()[..3]);
    }

    fn decode(reader: &mut Reader<'_>) -> Result<Self, Malformed> {
        let (robot, version) = (reader.robot()?, reader.version()?);
        let [a, b, c] = reader.array()?;
        let last = u32::from_le_bytes([a, b, c, 0]);
        let units = last & AGE_UNITS_MAX;
        reader.check(units < AGE_UNITS_MAX, "an entry is younger than 33.5 s")?;
        let (hops, agrees) = ((last >> 18) as u8 & HOPS_MAX, last >> 23 == 1);
        Ok(Self { robot, version, hops, age_ns: u64::from(units) * AGE_UNIT_NS, agrees })
    }
}

impl Hello {
    /// What the sender says of a robot.
    pub fn entry(&self, robot: RobotId) -> Option<&Entry> {
        self.entries.binary_search_by_key(&robot, |entry| entry.robot).ok().map(|index| &self.entries[index])
    }

    /// The bytes to send: 96, and 12 for each entry.
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(HELLO_HEAD_BYTES + HELLO_ENTRY_BYTES * self.entries.len());
        let flag = |set: bool, bit: u8| if set { bit } else { 0 };
        let flags = flag(self.agrees, AGREES)
            | flag(self.pose.is_some(), HAS_POSE)
            | flag(self.reference.is_some(), HAS_REFERENCE);
        bytes.extend([KIND, LAYOUT, flags, self.from.get()]);
        put_version(&mut bytes, self.version);
        let pose = self.pose.unwrap_or_default();
        bytes.extend([self.entries.len() as u8, self.reference.map_or(0, |reference| reference.robot.get())]);
        bytes.extend(pose.speed_mm_s.to_le_bytes());
        bytes.extend(self.map.to_le_bytes());
        bytes.extend(self.sent_ns.to_le_bytes());
        self.digests.iter().for_each(|digest| bytes.extend(digest.to_le_bytes()));
        put_position(&mut bytes, pose.position);
        bytes.extend(pose.heading_mrad.to_le_bytes());
        bytes.extend(self.tree.to_le_bytes());
        let (incarnation, offset_ns, bound_ns) = self
            .reference
            .map_or((0, 0, 0), |reference| (reference.incarnation, reference.offset_ns, reference.bound_ns));
        bytes.extend(incarnation.to_le_bytes());
        bytes.extend(offset_ns.to_le_bytes());
        bytes.extend(bound_ns.to_le_bytes());
        self.entries.iter().for_each(|entry| entry.encode(&mut bytes));
        bytes
    }

    /// Reads a hello.
    ///
    /// # Errors
    /// If the bytes are no hello, or not exactly one.
    pub fn decode(bytes: &[u8]) -> Result<Self, Malformed> {
        let mut reader = Reader::new(bytes);
        let [kind, layout, flags] = reader.array()?;
        reader.check(kind == KIND && layout == LAYOUT, "a hello begins with `H` and layout 1")?;
        reader.check(flags & !(AGREES | HAS_POSE | HAS_REFERENCE) == 0, "a hello has three flags")?;
        let (from, version) = (reader.robot()?, reader.version()?);
        let [count, reference] = reader.array()?;
        let speed_mm_s = reader.i16()?;
        let (map, sent_ns) = (reader.u64()?, reader.u64()?);
        let mut digests = [0; PARTS];
        for digest in &mut digests {
            *digest = reader.u32()?;
        }
        let (position, heading_mrad) = (reader.position()?, reader.i16()?);
        let pose = Pose { position, heading_mrad, speed_mm_s };
        let has_pose = flags & HAS_POSE != 0;
        reader.check(has_pose || pose == Pose::default(), "without a pose its fields are 0")?;
        let tree = u16::from_le_bytes(reader.array()?);
        let reference = read_reference(&mut reader, flags & HAS_REFERENCE != 0, reference)?;
        let mut entries: Vec<Entry> = Vec::with_capacity(count.into());
        for _ in 0..count {
            let entry = Entry::decode(&mut reader)?;
            let is_next = entries.last().is_none_or(|last| last.robot < entry.robot) && entry.robot != from;
            reader.check(is_next, "entries ascend, without the sender")?;
            entries.push(entry);
        }
        reader.end()?;
        let pose = has_pose.then_some(pose);
        let agrees = flags & AGREES != 0;
        Ok(Self { from, version, map, sent_ns, digests, tree, agrees, pose, reference, entries })
    }
}

fn read_reference(reader: &mut Reader<'_>, is_there: bool, robot: u8) -> Result<Option<Reference>, Malformed> {
    let (incarnation, offset, bound_ns) = (reader.u32()?, reader.u64()?, reader.u64()?);
    if !is_there {
        let is_zero = robot == 0 && incarnation == 0 && offset == 0 && bound_ns == 0;
        return reader.check(is_zero, "without a reference its fields are 0").map(|()| None);
    }
    let robot = RobotId::new(robot).ok_or_else(|| reader.wrong("the reference is a robot of 1 to 254"))?;
    Ok(Some(Reference { robot, incarnation, offset_ns: offset.cast_signed(), bound_ns }))
}
