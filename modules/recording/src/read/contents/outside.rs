//! The records of a file outside of its chunks, and where reading goes on if one of them is damaged.

use super::{Contents, Ending, Item};
use crate::error::{Damage, ReadError};
use crate::format::op;
use crate::read::ahead::AheadRecord;
use crate::read::attachment::Attachment;
use crate::read::chunk;
use crate::read::definitions::Untaken;
use crate::read::frames::{HEAD_BYTES, Step};
use crate::read::resync;
use mcap::records::Record;

/// So much may be read again in a file of any length, besides twice its length: nested records could be read as often
/// as there are bytes.
const REREAD_BYTES_MAX: u64 = 16 << 20;

impl Contents {
    /// The next record of the file; none if it is nothing of its own.
    pub(super) fn next_outside(&mut self) -> Result<Option<Item>, ReadError> {
        let (step, unpacked) = self.step()?;
        let begins = self.begins;
        let behind_head = begins + HEAD_BYTES as u64;
        if let Some(unpacked) = unpacked {
            return Ok(self.enter_chunk(unpacked).err().map(|damage| Item::Damaged(begins, damage)));
        }
        match step {
            Step::Record(op) => {
                let is_exact = chunk::is_exact(op, self.frames.body());
                self.resume_at = if is_exact { self.frames.at() } else { behind_head };
                self.record(op)
            }
            Step::Cut(Some(op::CHUNK)) => self.cut_chunk(),
            Step::Cut(_) => self.go_on(Some(Damage::Cut), Ending::Open),
            Step::Damaged(damage @ Damage::Limit(_)) => {
                self.resume_at = behind_head;
                Ok(Some(Item::Damaged(begins, damage)))
            }
            Step::Damaged(damage) => self.go_on(Some(damage), Ending::Damaged),
            Step::End => self.go_on(None, Ending::Open),
        }
    }

    /// A chunk that does not end before the file does; or one that says so, and ends before by what stands in it.
    fn cut_chunk(&mut self) -> Result<Option<Item>, ReadError> {
        let (begins, body) = (self.begins, self.frames.body());
        let known = chunk::extent(body);
        if known.is_none() && body.len() >= chunk::EXTENT_BYTES {
            return self.go_on(Some(Damage::Cut), Ending::Open);
        }
        let Some(extent) = known.filter(|extent| *extent <= body.len() as u64) else {
            chunk::unpack_cut(body, &mut self.records);
            self.in_chunk = Some(0);
            self.is_cut = true;
            return Ok(Some(Item::Damaged(begins, Damage::Cut)));
        };
        let unpacked = chunk::unpack(body, &mut self.records);
        self.resume_at = begins + HEAD_BYTES as u64;
        if self.reads_again(self.resume_at + extent) {
            self.ending = Some(Ending::Damaged);
            return Ok(Some(Item::Damaged(begins, Damage::Cut)));
        }
        self.frames.seek(self.resume_at + extent)?;
        let damage = self.enter_chunk(unpacked).err();
        Ok(Some(Item::Damaged(begins, damage.unwrap_or(Damage::Record { op: op::CHUNK }))))
    }

    /// No record begins here: reading goes on where one does, if there is one. If not, a file ends like this.
    fn go_on(&mut self, damage: Option<Damage>, ending: Ending) -> Result<Option<Item>, ReadError> {
        let (begins, resume_at) = (self.begins, self.resume_at);
        let damaged = |damage| Some(Item::Damaged(begins, damage));
        self.ahead = None;
        if self.reads_again(resume_at) {
            self.ending = Some(Ending::Damaged);
            return Ok(damage.and_then(damaged));
        }
        match resync::find(&mut self.frames, resume_at, self.has_bare_messages)? {
            Some(at) => {
                self.go_to(at)?;
                Ok(damaged(damage.unwrap_or(Damage::Cut)))
            }
            None => {
                self.ending = Some(ending);
                // Where reading has come to.
                self.frames.seek(begins)?;
                Ok(damage.and_then(damaged))
            }
        }
    }

    /// Reading goes back from where it is to there. Whether that is too often.
    fn reads_again(&mut self, from: u64) -> bool {
        self.reread = self.reread.saturating_add(self.frames.at().saturating_sub(from));
        self.reread > REREAD_BYTES_MAX.saturating_add(self.frames.len().saturating_mul(2))
    }

    /// What is next in the file, and whether it is a chunk that was unpacked or could not be.
    fn step(&mut self) -> Result<(Step, Option<Result<(), Damage>>), ReadError> {
        let Some(ahead) = &mut self.ahead else {
            self.begins = self.frames.at();
            return Ok((self.frames.step()?, None));
        };
        let Some(AheadRecord { begins, ends, resume_at, step, mut body, unpacked }) = ahead.next() else {
            self.ahead = None;
            self.frames.seek(self.frames.at())?;
            return self.step();
        };
        self.begins = begins;
        self.resume_at = resume_at.unwrap_or(self.resume_at);
        self.frames.pass_to(ends);
        match unpacked {
            Some(_) => std::mem::swap(&mut self.records, &mut body),
            None => self.frames.swap_body(&mut body),
        }
        ahead.give_back(body);
        Ok((step?, unpacked))
    }

    fn record(&mut self, op: u8) -> Result<Option<Item>, ReadError> {
        let (begins, body) = (self.begins, self.frames.body());
        let len = body.len() as u64;
        // By one bit the type of a chunk, or of an index of messages, becomes another.
        let is_other = match op {
            op::CHUNK => false,
            // Its data may be anything, and have a chunk's length where a chunk has that.
            op::MESSAGE if chunk::extent(body) == Some(len) => chunk::is_proven(body, &mut self.records),
            op::MESSAGE => self.chunks > 0 && chunk::is_index(body, len),
            _ => chunk::extent(body) == Some(len),
        };
        if is_other {
            return Ok(Some(Item::Damaged(begins, Damage::NoRecord { op, len })));
        }
        let told = match op {
            op::CHUNK => {
                let unpacked = chunk::unpack(body, &mut self.records);
                self.enter_chunk(unpacked).map(|()| None)
            }
            op::MESSAGE => self.found(0..body.len(), false).map(|found| Some(Item::Message(found))),
            op::SCHEMA | op::CHANNEL if self.is_behind_data => Ok(None),
            op::SCHEMA | op::CHANNEL => match self.definitions.add(op, body) {
                Ok(()) => Ok(None),
                Err(Untaken::Damaged(damage)) => Err(damage),
                Err(Untaken::TooMuch(limit)) => return Err(self.too_much(limit)),
            },
            op::HEADER | op::METADATA => match mcap::parse_record(op, body) {
                Ok(Record::Metadata(metadata)) => Ok(Some(Item::Metadata(metadata))),
                Ok(Record::Header(header)) => {
                    self.definitions.know(&header);
                    self.header = Some(header);
                    Ok(None)
                }
                _ => Err(Damage::Record { op }),
            },
            op::ATTACHMENT => {
                let ends = self.frames.at();
                let told = Attachment::at(&mut self.frames, begins, ends - begins)?;
                self.frames.seek(ends)?;
                self.resume_at = if told.is_ok() { ends } else { self.resume_at };
                told.map(|attachment| Some(Item::Attachment(attachment)))
            }
            op::DATA_END => {
                self.is_behind_data |= len == size_of::<u32>() as u64;
                Ok(None)
            }
            op::FOOTER => {
                let is_whole = self.frames.is_at_end_magic()?;
                if !is_whole {
                    return self.go_on(None, Ending::Open);
                }
                self.ending = Some(Ending::Closed);
                Ok(None)
            }
            _ => Ok(None),
        };
        self.has_bare_messages |= matches!(told, Ok(Some(Item::Message(_))));
        Ok(told.unwrap_or_else(|damage| Some(Item::Damaged(begins, damage))))
    }

    fn enter_chunk(&mut self, unpacked: Result<(), Damage>) -> Result<(), Damage> {
        unpacked?;
        self.in_chunk = Some(0);
        self.chunks += 1;
        Ok(())
    }
}
