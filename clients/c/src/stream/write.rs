//! Writing a stream.

use super::{RecordStamp, RingShape, StreamNumber, id, shape, stamp};
use crate::code::Code;
use crate::edge::{bytes, edge, failed, place, say};
use crate::node::NodeHandle;
use crate::objects::{NodeObject, WriterObject};
use crate::table;
use rohrpost_mailbox::{OpenRecord, StreamWriter};
use std::ffi::c_void;
use std::mem::MaybeUninit;

/// The one writer of a stream.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct WriterHandle {
    /// Which; 0 is none.
    pub id: u64,
}

/// Makes this process the writer of a stream; with a null `shape`, of the usual one. Records that an earlier writer
/// left there stay, if the shape is the same.
///
/// The caller owns the writer, and closes it by `rohrpost_stream_writer_close`. Thread: that of the node, as for all
/// calls with the writer.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_stream_writer_open(
    node: NodeHandle,
    stream: StreamNumber,
    ring: Option<&RingShape>,
    writer: Option<&mut MaybeUninit<WriterHandle>>,
) -> Code {
    edge(|| {
        let out = place(writer, "writer")?.write(WriterHandle { id: 0 });
        let shape = ring.map(shape).unwrap_or_default();
        out.id = table::open(|| {
            let participant = table::with(node.id, |node: &mut NodeObject| Ok(node.participant.clone()))?;
            Ok(WriterObject::new(participant.stream_writer(id(stream), shape).map_err(failed)?))
        })?;
        Ok(())
    })
}

/// Closes a writer; a record that is begun is abandoned. The stream stays, and with it its records.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_stream_writer_close(writer: WriterHandle) -> Code {
    edge(|| table::close::<WriterObject>(writer.id).map(drop))
}

/// Writes a record of `len` bytes, which are copied; `sequence`, which may be null, becomes its number in the stream.
/// Slow readers do not hinder it.
///
/// # Safety
/// `body` is null, or points to `len` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rohrpost_stream_write(
    writer: WriterHandle,
    at: RecordStamp,
    body: *const c_void,
    len: usize,
    sequence: Option<&mut MaybeUninit<u64>>,
) -> Code {
    edge(|| {
        // SAFETY: the caller's promise.
        let body = unsafe { bytes(body, len, "body") }?;
        table::with(writer.id, |writer: &mut WriterObject| {
            tell(sequence, idle(writer)?.write(stamp(at), body).map_err(failed)?)
        })
    })
}

/// Begins a record that is written in place: `body` is its place, of `room` bytes, where anything may stand. Readers
/// see it when it is finished by `rohrpost_stream_finish`; until then, or until `rohrpost_stream_abandon`, the writer
/// is busy. The place is aligned to nothing.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_stream_begin(
    writer: WriterHandle,
    at: RecordStamp,
    body: Option<&mut MaybeUninit<*mut u8>>,
    room: Option<&mut MaybeUninit<usize>>,
) -> Code {
    edge(|| {
        let (body, room) = (place(body, "body")?, place(room, "room")?);
        table::with(writer.id, |writer: &mut WriterObject| {
            idle(writer)?;
            let tell = |record: &mut OpenRecord<'_>| {
                let lent = record.body_mut();
                room.write(lent.len());
                body.write(lent.as_mut_ptr());
            };
            // SAFETY: nothing of the writer is kept but the record.
            unsafe { writer.lend(|writer| writer.begin(stamp(at)), tell) }.map_err(failed)
        })
    })
}

/// Makes the first `len` bytes of what is begun the next record; `sequence` may be null. It is no longer begun then,
/// also when this fails.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_stream_finish(
    writer: WriterHandle,
    len: usize,
    sequence: Option<&mut MaybeUninit<u64>>,
) -> Code {
    edge(|| {
        table::with(writer.id, |writer: &mut WriterObject| {
            tell(sequence, begun(writer.lent().take())?.finish(len).map_err(failed)?)
        })
    })
}

/// Gives up what is begun: nothing is written.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_stream_abandon(writer: WriterHandle) -> Code {
    edge(|| table::with(writer.id, |writer: &mut WriterObject| begun(writer.lent().take()).map(drop)))
}

/// A writer that has begun nothing.
fn idle(writer: &mut WriterObject) -> Result<&mut StreamWriter, Code> {
    let busy = || say(Code::Busy, format_args!("this writer has begun a record: finish or abandon it first"));
    writer.free().ok_or_else(busy)
}

fn begun(record: Option<OpenRecord<'static>>) -> Result<OpenRecord<'static>, Code> {
    let nothing = || say(Code::Value, format_args!("this writer has begun nothing: call rohrpost_stream_begin first"));
    record.ok_or_else(nothing)
}

fn tell(out: Option<&mut MaybeUninit<u64>>, sequence: u64) -> Result<(), Code> {
    if let Some(out) = out {
        out.write(sequence);
    }
    Ok(())
}
