//! What robots tell each other so that no two enter a cell.

use crate::bytes::{Malformed, Reader, put_version};
use crate::coordination::post::Post;
use crate::grid::Cell;
use crate::ids::{RobotId, Version};
use crate::view::ObjectId;
use std::collections::BTreeMap;

/// First byte.
const KIND: u8 = b'T';
/// Second byte: changes with the layout.
const LAYOUT: u8 = 1;

/// A cell that a robot wants to enter.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Claim {
    /// Another one for each claim of the robot.
    pub number: u32,
    /// Which cell.
    pub cell: Cell,
}

/// Where a robot stands at the start of a round, and where it goes.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct Stance {
    /// Where it stands.
    pub cell: Cell,
    /// Where it goes while there is no intruder; `None`: nowhere, but it steps aside.
    pub goal: Option<Cell>,
    /// The side of an intruder that it holds, or goes to.
    pub post: Option<Post>,
    /// Whether the robot does not move whatever others do: it is lost, or halted.
    pub is_frozen: bool,
}

/// What one robot says to all: at once when something changes, and each beat.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct TrafficMessage {
    /// The sender.
    pub from: RobotId,
    /// Rises with each message.
    pub version: Version,
    /// Digest of the map on which its cells are.
    pub map: u64,
    /// Cells that it is in: one, or two while it goes from one to the other. None if it never knew any.
    pub held: Vec<Cell>,
    /// The cell that it wants to enter next.
    pub claim: Option<Claim>,
    /// Claims of others that it leaves the cells to, by their numbers.
    pub echoes: BTreeMap<RobotId, u32>,
    /// The round of planning that it takes part in.
    pub round: u32,
    /// What it plans from in this round; `None` until it stands.
    pub stance: Option<Stance>,
    /// Digest of all stances that it knows in this round.
    pub digest: u64,
    /// Moment of the round's plan that it has reached.
    pub moment: u32,
}

impl TrafficMessage {
    /// The bytes to send.
    pub fn encode(&self) -> Vec<u8> {
        let goal = self.stance.and_then(|stance| stance.goal);
        let post = self.stance.and_then(|stance| stance.post);
        let is_frozen = self.stance.is_some_and(|stance| stance.is_frozen);
        let flags = [self.claim.is_some(), self.stance.is_some(), goal.is_some(), post.is_some(), is_frozen];
        let flags = flags.into_iter().rev().fold(0, |flags, flag| flags << 1 | u8::from(flag));
        let mut bytes = vec![KIND, LAYOUT, self.from.get(), flags, self.held.len() as u8, self.echoes.len() as u8];
        put_version(&mut bytes, self.version);
        bytes.extend(self.map.to_le_bytes());
        bytes.extend(self.digest.to_le_bytes());
        bytes.extend([self.round, self.moment].map(u32::to_le_bytes).concat());
        let cells = self.held.iter().copied().chain(self.claim.map(|claim| claim.cell));
        for cell in cells.chain(self.stance.map(|stance| stance.cell)).chain(goal) {
            bytes.extend([cell.column, cell.row].map(u32::to_le_bytes).concat());
        }
        self.claim.into_iter().for_each(|claim| bytes.extend(claim.number.to_le_bytes()));
        if let Some(Post { intruder, right, down }) = post {
            bytes.push(intruder.observer.get());
            put_version(&mut bytes, intruder.number);
            bytes.extend([right, down].map(i32::to_le_bytes).concat());
        }
        for (robot, number) in &self.echoes {
            bytes.push(robot.get());
            bytes.extend(number.to_le_bytes());
        }
        bytes
    }

    /// Reads a message.
    ///
    /// # Errors
    /// If the bytes are no such message, or anything follows them.
    pub fn decode(bytes: &[u8]) -> Result<Self, Malformed> {
        let mut reader = Reader::new(bytes);
        let [kind, layout] = reader.array()?;
        reader.check(kind == KIND && layout == LAYOUT, "a traffic message begins with T and layout 1")?;
        let from = reader.robot()?;
        let [flags, held, echoes] = reader.array()?;
        reader.check(flags < 32 && held <= 2, "five flags, and at most two cells")?;
        let has = |flag: u8| flags >> flag & 1 == 1;
        reader.check(has(1) || flags >> 2 == 0, "goal, post and being frozen belong to a stance")?;
        let version = reader.version()?;
        let (map, digest) = (reader.u64()?, reader.u64()?);
        let (round, moment) = (reader.u32()?, reader.u32()?);
        let mut cell = |is_there: bool| -> Result<Option<Cell>, Malformed> {
            is_there.then(|| Ok(Cell { column: reader.u32()?, row: reader.u32()? })).transpose()
        };
        let held = (0..held).filter_map(|_| cell(true).transpose()).collect::<Result<Vec<Cell>, Malformed>>()?;
        let (claimed, stands, goal) = (cell(has(0))?, cell(has(1))?, cell(has(2))?);
        let claim = match claimed {
            Some(cell) => Some(Claim { number: reader.u32()?, cell }),
            None => None,
        };
        let post = if has(3) { Some(read_post(&mut reader)?) } else { None };
        let mut numbers = BTreeMap::new();
        for _ in 0..echoes {
            let robot = reader.robot()?;
            let is_next = numbers.last_key_value().is_none_or(|(last, _)| *last < robot);
            reader.check(is_next, "echoes come by rising robots")?;
            numbers.insert(robot, reader.u32()?);
        }
        reader.end()?;
        let stance = stands.map(|cell| Stance { cell, goal, post, is_frozen: has(4) });
        Ok(Self { from, version, map, held, claim, echoes: numbers, round, stance, digest, moment })
    }
}

fn read_post(reader: &mut Reader<'_>) -> Result<Post, Malformed> {
    let intruder = ObjectId { observer: reader.robot()?, number: reader.version()? };
    let (right, down) = (i32::from_le_bytes(reader.array()?), i32::from_le_bytes(reader.array()?));
    Ok(Post { intruder, right, down })
}
