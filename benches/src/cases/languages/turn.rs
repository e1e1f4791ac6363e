//! What turns of all programs have in common.

use rohrpost_bench_local::harness::{Cell, Pause};
use rohrpost_bench_local::settings::Settings;

/// Of each message.
pub(super) const BYTES: usize = 64;

/// A turn of contenders that sleep, on two processors.
pub(super) fn cell(settings: &Settings) -> Cell {
    Cell { pause: Pause::UNTIL_ASLEEP, ..Cell::hop(BYTES, settings.count(Cell::HOP_MESSAGES)) }
}
