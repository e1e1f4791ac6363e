//! Records of the module's own streams, written in place.

use super::asking::moment;
use super::current::with_context;
use crate::code::Code;
use crate::edge::{bytes, edge, failed, place, say};
use rohrpost_native::RecordRoom;
use std::cell::RefCell;
use std::ffi::c_void;
use std::mem::MaybeUninit;

thread_local! {
    /// The bytes of a record that is begun, of a stream with records too small to be written in place.
    static OWN: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
}

/// Begins a record of a stream with a type that ends with bytes: `front` are the values before them and a length of 0,
/// and `room` becomes the place for `len` bytes: in shared memory, or, of a stream with records of 4096 bytes at most,
/// beside it, from where they are copied. It is aligned to nothing. Fill them, then `rohrpost_module_finish` or
/// `rohrpost_module_abandon`, in the same function. Only a function of the module may call this, and those two.
///
/// # Safety
/// `front` is null, or points to `front_len` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rohrpost_module_begin(
    number: u16,
    stamp_ns: u64,
    front: *const c_void,
    front_len: usize,
    len: usize,
    room: Option<&mut MaybeUninit<*mut u8>>,
) -> Code {
    edge(|| {
        // SAFETY: the caller's promise.
        let (front, out) = (unsafe { bytes(front, front_len, "front") }?, place(room, "room")?);
        if isize::try_from(len).is_err() {
            return Err(say(Code::TooLarge, format_args!("{len} bytes are more than there can be")));
        }
        let room = with_context(|context| context.begin(number, moment(stamp_ns), front, len).map_err(failed))?;
        out.write(match room {
            RecordRoom::Shared(record, range) => record.address().as_ptr().wrapping_add(range.start),
            RecordRoom::Own(len) => OWN.with_borrow_mut(|own| {
                own.resize(len, 0);
                own.as_mut_ptr()
            }),
        });
        Ok(())
    })
}

/// Makes the record that is begun the newest of its stream; `sequence`, which may be null, is its number.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_module_finish(sequence: Option<&mut MaybeUninit<u64>>) -> Code {
    edge(|| {
        let number = with_context(|context| OWN.with_borrow(|own| context.finish(own)).map_err(failed))?;
        if let Some(sequence) = sequence {
            sequence.write(number);
        }
        Ok(())
    })
}

/// Gives up the record that is begun; nothing is written.
#[unsafe(no_mangle)]
pub extern "C" fn rohrpost_module_abandon() -> Code {
    edge(|| {
        with_context(|context| {
            context.abandon();
            Ok(())
        })
    })
}
