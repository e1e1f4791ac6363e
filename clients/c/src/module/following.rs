//! What a module follows of others.

use super::current::with_context;
use crate::code::Code;
use crate::edge::{edge, failed, needed_text, place, say};
use rohrpost_native::{FollowRate, FollowedData};
use std::ffi::c_char;
use std::mem::MaybeUninit;
use std::time::Duration;

/// How a module follows data or a stream of another one.
#[repr(u8)]
#[derive(Clone, Copy)]
pub enum FollowHow {
    /// Each value, as data.
    Each = 0,
    /// Of values that wait only the newest, as data.
    Newest = 1,
    /// Each record of a stream of this node, in place.
    Records = 2,
    /// The newest value once in a period, as data.
    Period = 3,
}

/// Something that came of what a module follows.
#[repr(C)]
pub struct DataFollowed {
    /// The number that `rohrpost_module_follow` gave.
    pub follow: u32,
    /// Number of the data in the other's interface.
    pub number: u16,
    /// The value, until the function returns; of a stream's record in shared memory.
    pub value: *const u8,
    /// Its bytes.
    pub len: usize,
    /// When it was true, ns since 1970.
    pub stamp_ns: u64,
    /// Its number: of a subscription, or the lower bits of a record's.
    pub sequence: u32,
    /// Values missed before it; of a stream, records lost so far.
    pub missed: u32,
}

pub(super) fn followed(data: &FollowedData<'_>) -> DataFollowed {
    DataFollowed {
        follow: u32::try_from(data.follow).unwrap_or(u32::MAX),
        number: data.item.number,
        value: data.value.as_ptr(),
        len: data.value.len(),
        stamp_ns: data.stamp_ns,
        sequence: data.sequence,
        missed: data.missed,
    }
}

/// Follows data or a stream of another module, by the names of both, as one of `rohrpost_follow` says, once in
/// `period_ns` if that is a period. What comes is given to `received`, with the number that this gives. The other
/// module need not run yet. Only a function of the module may call this.
///
/// # Safety
/// Texts are null or end with a zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rohrpost_module_follow(
    module: *const c_char,
    item: *const c_char,
    how: u8,
    period_ns: u64,
    follow: Option<&mut MaybeUninit<u32>>,
) -> Code {
    edge(|| {
        // SAFETY: the caller's promise.
        let (module, item) = unsafe { (needed_text(module, "module")?, needed_text(item, "item")?) };
        let out = place(follow, "follow")?;
        let rates = [
            FollowRate::Each,
            FollowRate::Newest,
            FollowRate::Records,
            FollowRate::Every(Duration::from_nanos(period_ns)),
        ];
        let words = format_args!("`how` is {how}; it is one of rohrpost_follow, 0 to 3");
        let rate = *rates.get(usize::from(how)).ok_or_else(|| say(Code::Value, words))?;
        let number = with_context(|context| context.follow(module, item, rate).map_err(failed))?;
        out.write(u32::try_from(number).unwrap_or(u32::MAX));
        Ok(())
    })
}
