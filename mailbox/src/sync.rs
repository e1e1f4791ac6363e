//! The atomics that the slot core is written with: the processor's, or loom's when the model checker compiles this
//! very source (see `mailbox/proof/loom`).

pub(crate) use core::sync::atomic::{AtomicU32, AtomicU64, Ordering, fence};

/// Stands where SeqCst accesses before and SeqCst loads after must keep their order. The accesses do that by
/// themselves, and on x86-64 for nothing, where a fence costs as much as all other steps of publishing. The model
/// checker knows that order of fences alone, and has one here.
#[inline(always)]
pub(crate) fn seq_cst_accesses() {}

/// Asks for a line to be brought here for writing. A hint: it changes nothing, and may be of any address.
#[inline(always)]
pub(crate) fn prefetch_to_write<T>(at: *const T) {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: the instruction never faults and writes nothing; processors without it take it for no operation.
    unsafe {
        std::arch::asm!("prefetchw [{0}]", in(reg) at, options(nostack, preserves_flags, readonly));
    }
    #[cfg(target_arch = "aarch64")]
    // SAFETY: the instruction never faults and writes nothing.
    unsafe {
        std::arch::asm!("prfm pstl1keep, [{0}]", in(reg) at, options(nostack, preserves_flags, readonly));
    }
}

/// The same for reading.
#[inline(always)]
pub(crate) fn prefetch_to_read<T>(at: *const T) {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: the instruction never faults.
    unsafe {
        std::arch::asm!("prefetcht0 [{0}]", in(reg) at, options(nostack, preserves_flags, readonly));
    }
    #[cfg(target_arch = "aarch64")]
    // SAFETY: the instruction never faults.
    unsafe {
        std::arch::asm!("prfm pldl1keep, [{0}]", in(reg) at, options(nostack, preserves_flags, readonly));
    }
}
