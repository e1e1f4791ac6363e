//! The core's crash points: here, places where a thread may be put aside or die.

use std::cell::Cell;
use std::thread;

/// A step of an operation on shared memory.
macro_rules! step {
    ($what:literal) => {
        $crate::step::reached($what)
    };
}
pub(crate) use step;

thread_local! {
    static DICE: Cell<u64> = const { Cell::new(0x9e37_79b9_7f4a_7c15) };
}

/// A number of this thread's own series.
pub(crate) fn dice() -> u64 {
    DICE.with(|dice| {
        let mut x = dice.get();
        x ^= x << 13;
        x ^= x >> 7;
        x ^= x << 17;
        dice.set(x);
        x
    })
}

/// Begins another series; not 0.
pub(crate) fn shake(seed: u64) {
    DICE.with(|dice| dice.set(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1));
}

/// One step in sixteen hands the processor to another thread: with two processors, most orders would be rare without.
pub(crate) fn reached(_what: &'static str) {
    if dice().is_multiple_of(16) {
        thread::yield_now();
    }
}
