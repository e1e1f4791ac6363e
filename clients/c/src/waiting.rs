//! Waiting for several mailboxes, streams and descriptors at once.

use crate::code::Code;
use crate::edge::{edge, failed, place, say, waiting};
use crate::node::NodeHandle;
use crate::objects::{NodeObject, ReaderObject, ReceiverObject};
use crate::table::{self, Table};
use arrayvec::ArrayVec;
use rohrpost_mailbox::{Interest, Participant, Source, Watch, Watches, wait_any};
use std::ffi::c_int;
use std::mem::MaybeUninit;
use std::os::fd::BorrowedFd;
use std::sync::Arc;
use std::time::Instant;

/// Most mailboxes and streams that one call waits for.
pub const ROHRPOST_SOURCES_MAX: usize = 64;

/// Something can be read, or will never be again.
pub const ROHRPOST_READ: u8 = 1;
/// There is room to write.
pub const ROHRPOST_WRITE: u8 = 2;

/// A mailbox or stream to wait for: the `id` of a receiver or of a reader.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct WaitSource {
    /// The handle's.
    pub id: u64,
}

/// A watched descriptor for which there is something to do.
#[repr(C)]
pub struct ReadyDescriptor {
    /// The number that `rohrpost_watch` gave.
    pub watch: u32,
    /// A read will not wait: it brings bytes, the end, or an error.
    pub readable: bool,
    /// A write will not wait: it takes bytes, or brings an error.
    pub writable: bool,
}

/// Watches a file descriptor for `interest`, bits `ROHRPOST_READ` and `ROHRPOST_WRITE`: `rohrpost_wait` returns when it
/// is ready. The library keeps a duplicate of the descriptor, the caller keeps its own.
///
/// Until `rohrpost_unwatch`. Thread: that of the node.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_watch(
    node: NodeHandle,
    descriptor: c_int,
    interest: u8,
    watch: Option<&mut MaybeUninit<u32>>,
) -> Code {
    edge(|| {
        let (out, interest) = (place(watch, "watch")?, interest_of(interest)?);
        let descriptor = open_descriptor(descriptor)?;
        table::with(node.id, |node: &mut NodeObject| {
            let watch = watches(node)?.add(&descriptor, interest).map_err(failed)?;
            out.write(watch.number());
            Ok(())
        })
    })
}

/// What a descriptor is watched for.
pub(crate) fn interest_of(bits: u8) -> Result<Interest, Code> {
    const BOTH: u8 = ROHRPOST_READ | ROHRPOST_WRITE;
    match bits {
        ROHRPOST_READ => Ok(Interest::Read),
        ROHRPOST_WRITE => Ok(Interest::Write),
        BOTH => Ok(Interest::Both),
        other => Err(say(Code::Value, format_args!("`interest` is {other}; it is 1, 2 or 3"))),
    }
}

/// A descriptor of C's, if it is open. It is duplicated at once.
pub(crate) fn open_descriptor(descriptor: c_int) -> Result<BorrowedFd<'static>, Code> {
    // SAFETY: the call asks only whether there is such a descriptor.
    if descriptor < 0 || unsafe { libc::fcntl(descriptor, libc::F_GETFD) } < 0 {
        return Err(say(Code::Value, format_args!("{descriptor} is no open file descriptor")));
    }
    // SAFETY: it is open, and C keeps it open during the call, which duplicates it.
    Ok(unsafe { BorrowedFd::borrow_raw(descriptor) })
}

/// The node's watches, made when the first descriptor is watched.
fn watches(node: &mut NodeObject) -> Result<&mut Watches, Code> {
    let made = match node.watches.take() {
        Some(watches) => watches,
        None => Watches::new(&node.participant).map_err(failed)?,
    };
    Ok(node.watches.insert(made))
}

/// Watches it no longer. Thread: that of the node.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_unwatch(node: NodeHandle, watch: u32) -> Code {
    edge(|| {
        table::with(node.id, |node: &mut NodeObject| {
            let removed = node.watches.as_mut().is_some_and(|watches| watches.remove(Watch::from_number(watch)));
            if removed {
                Ok(())
            } else {
                Err(say(Code::Value, format_args!("watch {watch}: there is none (any more)")))
            }
        })
    })
}

/// Waits until one of `count` mailboxes and streams has something or a watched descriptor is ready, at most
/// `timeout_ns`, 0: not at all, below 0: for ever; `ROHRPOST_NOTHING` when nothing is there then. It may return early
/// for no reason, also for a signal: take from each what is there, and wait again. What has a package or record in hand
/// cannot be waited for: release it first.
///
/// Thread: that of the node and of all sources, which were opened by this node.
///
/// # Safety
/// `sources` is null, or points to `count` of them.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rohrpost_wait(
    node: NodeHandle,
    sources: *const WaitSource,
    count: usize,
    timeout_ns: i64,
) -> Code {
    edge(|| {
        if count > ROHRPOST_SOURCES_MAX {
            return Err(say(Code::TooLarge, format_args!("{count} sources; {ROHRPOST_SOURCES_MAX} are possible")));
        }
        // SAFETY: the caller's promise; a `WaitSource` is as large as its number.
        let bytes = unsafe { crate::edge::bytes(sources.cast(), count * size_of::<WaitSource>(), "sources") }?;
        let ids = || bytes.chunks_exact(8).filter_map(|id| id.first_chunk()).map(|id| u64::from_ne_bytes(*id));
        // In one use of the table: a handler of signals can close nothing meanwhile.
        table::with_table(|table| {
            let participant = table.find::<NodeObject>(node.id)?.participant.clone();
            let mut pointers = ArrayVec::<*mut dyn Source, ROHRPOST_SOURCES_MAX>::new();
            for (at, id) in ids().enumerate() {
                if ids().take(at).any(|other| other == id) {
                    return Err(say(Code::Value, format_args!("source {at} is there twice")));
                }
                pointers.push(source(table, id, &participant)?);
            }
            // SAFETY: each points to what a handle of this thread owns, at an address of its own; all are different,
            // nothing is borrowed from them, and nothing else of this thread uses the table meanwhile.
            let mut sources: ArrayVec<&mut dyn Source, ROHRPOST_SOURCES_MAX> =
                pointers.iter().map(|pointer| unsafe { &mut **pointer }).collect();
            wait(table.find(node.id)?, &mut sources, timeout_ns)
        })
    })
}

/// `ROHRPOST_BUSY` while a package or record of this receiver or reader is in hand. Thread: that of the source.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_source_idle(source: WaitSource) -> Code {
    edge(|| {
        let is_idle = match table::is_a::<ReaderObject>(source.id) {
            true => table::with(source.id, |reader: &mut ReaderObject| Ok(reader.free().is_some())),
            false => table::with(source.id, |receiver: &mut ReceiverObject| Ok(receiver.free().is_some())),
        }?;
        if is_idle { Ok(()) } else { Err(busy()) }
    })
}

fn busy() -> Code {
    say(Code::Busy, format_args!("a source has something in hand: release it first"))
}

/// Where the receiver or reader of a handle is.
fn source(table: &mut Table, id: u64, participant: &Arc<Participant>) -> Result<*mut dyn Source, Code> {
    let own = |other: &Arc<Participant>| match Arc::ptr_eq(other, participant) {
        true => Ok(()),
        false => Err(say(Code::Value, format_args!("a source was opened by another node than this one"))),
    };
    if table::is_a::<ReaderObject>(id) {
        let reader = table.find::<ReaderObject>(id)?.free().ok_or_else(busy)?;
        own(reader.participant())?;
        Ok(std::ptr::from_mut(reader) as *mut dyn Source)
    } else {
        let receiver = table.find::<ReceiverObject>(id)?.free().ok_or_else(busy)?;
        own(receiver.participant())?;
        Ok(std::ptr::from_mut(receiver) as *mut dyn Source)
    }
}

fn wait(node: &mut NodeObject, sources: &mut [&mut dyn Source], timeout_ns: i64) -> Result<(), Code> {
    let waiting = waiting(timeout_ns, 0);
    match &mut node.watches {
        Some(watches) if !watches.is_empty() => _ = watches.wait_any(sources, waiting, || false),
        _ if sources.is_empty() => _ = node.participant.wait(waiting, || false),
        _ => _ = wait_any(sources, waiting, || false),
    }
    let is_over = waiting.deadline.is_some_and(|deadline| Instant::now() >= deadline);
    // What was there before, and what came at the last moment.
    let is_ready = node.watches.as_ref().is_some_and(Watches::has_ready);
    let is_there = is_ready || sources.iter().any(|source| source.may_have());
    if is_over && !is_there { Err(Code::Nothing) } else { Ok(()) }
}

/// Tells a descriptor that was ready when `rohrpost_wait` returned; each is told once, then `ROHRPOST_NOTHING`. Thread:
/// that of the node.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_next_ready(node: NodeHandle, ready: Option<&mut MaybeUninit<ReadyDescriptor>>) -> Code {
    edge(|| {
        let out = place(ready, "ready")?;
        table::with(node.id, |node: &mut NodeObject| {
            let ready = node.watches.as_mut().and_then(Watches::next_ready).ok_or(Code::Nothing)?;
            let (watch, readable, writable) = (ready.watch.number(), ready.readable, ready.writable);
            out.write(ReadyDescriptor { watch, readable, writable });
            Ok(())
        })
    })
}
