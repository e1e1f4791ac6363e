//! Reading a stream.

use super::{RecordStamp, StreamNumber, id, stamp};
use crate::code::Code;
use crate::edge::{edge, failed, place, say, waiting};
use crate::node::NodeHandle;
use crate::objects::{NodeObject, ReaderObject};
use crate::table;
use rohrpost_mailbox::{Around, HeldRecord, Next, RecordInfo, StreamReader};
use std::mem::MaybeUninit;

/// One of a stream's readers, with a position of its own.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct ReaderHandle {
    /// Which; 0 is none.
    pub id: u64,
}

/// What is said of a record.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct RecordAbout {
    /// Its number in the stream, from 0 on.
    pub sequence: u64,
    /// When it was produced.
    pub stamp: RecordStamp,
    /// When it was written, on the monotonic clock, ns.
    pub written_ns: u64,
    /// Tells the runs of its writer apart.
    pub incarnation: u32,
}

/// A record in hand.
#[repr(C)]
pub struct Record {
    /// What is said of it.
    pub about: RecordAbout,
    /// Its bytes, in shared memory.
    pub body: *const u8,
    /// How many.
    pub len: usize,
}

/// The records around a time; both are the same when one has this very stamp.
#[repr(C)]
pub struct RecordsAround {
    /// The nearest that is not after.
    pub before: RecordAbout,
    /// The nearest that is not before.
    pub after: RecordAbout,
}

/// Records that a reader did not get, by cause.
#[repr(C)]
pub struct RecordsMissed {
    /// Lost on the way from the node that writes the stream.
    pub lost: u64,
    /// Left out by the sampling of a replica.
    pub sampled: u64,
    /// Overwritten before they were read.
    pub passed_over: u64,
}

fn about(info: RecordInfo) -> RecordAbout {
    let stamp = RecordStamp { epoch: info.stamp.epoch, ns: info.stamp.ns };
    let (sequence, written_ns, incarnation) = (info.sequence, info.written_ns, info.incarnation);
    RecordAbout { sequence, stamp, written_ns, incarnation }
}

fn in_hand(record: &HeldRecord<'_>) -> Record {
    Record { about: about(record.info()), body: record.body().as_ptr(), len: record.body().len() }
}

/// Opens a stream to read, from what is written next on. There may be no such stream yet. Takes one of its places for
/// readers.
///
/// The caller owns the reader, and closes it by `rohrpost_stream_reader_close`. Thread: that of the node, as for all
/// calls with the reader.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_stream_reader_open(
    node: NodeHandle,
    stream: StreamNumber,
    reader: Option<&mut MaybeUninit<ReaderHandle>>,
) -> Code {
    edge(|| {
        let out = place(reader, "reader")?.write(ReaderHandle { id: 0 });
        out.id = table::open(|| {
            let participant = table::with(node.id, |node: &mut NodeObject| Ok(node.participant.clone()))?;
            Ok(ReaderObject::new(participant.stream_reader(id(stream)).map_err(failed)?))
        })?;
        Ok(())
    })
}

/// Closes a reader.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_stream_reader_close(reader: ReaderHandle) -> Code {
    edge(|| table::close::<ReaderObject>(reader.id).map(drop))
}

/// Takes the next record, to be read in place. Waits for one at most `timeout_ns`, 0: not at all, below 0: for ever,
/// which no signal ends (`rohrpost_wait` returns then); `ROHRPOST_NOTHING` when there is none. `ROHRPOST_LOST` when the
/// writer has passed this reader: `lost`, which may be null, is how many records; then call it again.
///
/// The record is in hand until the next call that takes one from this reader, whatever that returns, or until it is
/// released or the reader is closed; meanwhile the writer goes round it. Its bytes are aligned to nothing.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_stream_next(
    reader: ReaderHandle,
    timeout_ns: i64,
    record: Option<&mut MaybeUninit<Record>>,
    lost: Option<&mut MaybeUninit<u64>>,
) -> Code {
    let mut passed = 0;
    let code = hand_out(reader, record, |reader| {
        let next = match timeout_ns {
            0 => reader.try_next(),
            timeout_ns => reader.next_timeout(waiting(timeout_ns, 0)),
        };
        match next.map_err(failed)? {
            Next::Record(record) => Ok(record),
            Next::Lost(count) => {
                passed = count;
                Err(Code::Lost)
            }
            Next::Nothing => Err(Code::Nothing),
        }
    });
    if let (Some(lost), 0..) = (lost, code as i32) {
        lost.write(passed);
    }
    code
}

/// Takes the newest record, to be read in place, as `rohrpost_stream_next` does; the position stays.
/// `ROHRPOST_NOTHING` before the first.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_stream_newest(reader: ReaderHandle, record: Option<&mut MaybeUninit<Record>>) -> Code {
    hand_out(reader, record, |reader| reader.newest().map_err(failed)?.ok_or(Code::Nothing))
}

/// Takes the record of this sequence, to be read in place, as `rohrpost_stream_next` does; the position stays.
/// `ROHRPOST_NOTHING` when it is there no more, or not yet.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_stream_record(
    reader: ReaderHandle,
    sequence: u64,
    record: Option<&mut MaybeUninit<Record>>,
) -> Code {
    hand_out(reader, record, |reader| reader.record(sequence).ok_or(Code::Nothing))
}

fn hand_out(
    reader: ReaderHandle,
    record: Option<&mut MaybeUninit<Record>>,
    take: impl FnOnce(&'static mut StreamReader) -> Result<HeldRecord<'static>, Code>,
) -> Code {
    edge(|| {
        let out = place(record, "record")?;
        table::with(reader.id, |reader: &mut ReaderObject| {
            let tell = |record: &mut HeldRecord<'_>| _ = out.write(in_hand(record));
            // SAFETY: nothing of the reader is kept but the record.
            unsafe { reader.lend(take, tell) }
        })
    })
}

/// A reader with nothing in hand.
fn idle(reader: &mut ReaderObject) -> Result<&mut StreamReader, Code> {
    let busy = || say(Code::Busy, format_args!("this reader has a record in hand: release it first"));
    reader.free().ok_or_else(busy)
}

/// The two records around a time, for interpolation; `rohrpost_stream_record` reads each. `ROHRPOST_BUSY` while a
/// record is in hand: release it first. `ROHRPOST_NOTHING` when there are none (yet): the last error says exactly why.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_stream_around(
    reader: ReaderHandle,
    at: RecordStamp,
    records: Option<&mut MaybeUninit<RecordsAround>>,
) -> Code {
    edge(|| {
        let out = place(records, "records")?;
        let around = |reader: &mut ReaderObject| idle(reader)?.around(stamp(at)).map_err(failed);
        let found = table::with(reader.id, around)?;
        let nothing = |why: std::fmt::Arguments<'_>| Err(say(Code::Nothing, why));
        match found {
            Around::Records { before, after } => {
                out.write(RecordsAround { before: about(before), after: about(after) });
                Ok(())
            }
            Around::Empty => nothing(format_args!("nothing was written yet")),
            Around::BeforeOldest { by_ns } => {
                nothing(format_args!("{by_ns} ns before the oldest record that is known to be near"))
            }
            Around::NotYet { by_ns } => nothing(format_args!("for {by_ns} ns, a record may still come that is nearer")),
            Around::OtherEpoch { newest } => nothing(format_args!("the stream has records of epoch {newest} by now")),
        }
    })
}

/// Lets the writer have the place of the record in hand, if there is one.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_stream_reader_release(reader: ReaderHandle) -> Code {
    edge(|| {
        table::with(reader.id, |reader: &mut ReaderObject| {
            reader.lent().take();
            Ok(())
        })
    })
}

/// How many records this reader did not get since it was opened, by cause. `ROHRPOST_BUSY` while a record is in hand:
/// release it first.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_stream_missed(
    reader: ReaderHandle,
    missed: Option<&mut MaybeUninit<RecordsMissed>>,
) -> Code {
    edge(|| {
        let out = place(missed, "missed")?;
        let missed = table::with(reader.id, |reader: &mut ReaderObject| Ok(idle(reader)?.missed()))?;
        out.write(RecordsMissed { lost: missed.lost, sampled: missed.sampled, passed_over: missed.passed_over });
        Ok(())
    })
}
