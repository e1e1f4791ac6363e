//! The slot tables of the cases.

use crate::tdma::plan::{Declared, Plan};
use rohrpost_mailbox::Class;

/// RTnet's own cycle; slots that have room for a datagram of 1400 B for sure, on an ordinary link.
pub const LOADED: Plan = Plan {
    cycle_us: 5_000,
    synchronisation_us: 500,
    guard_us: 150,
    pitch_us: 430,
    link: "100 Mbit/s",
    masters: 2,
    flows: &[],
};

/// The shortest slots that have room for it with a guard of 150 µs: 50 µs late, six frames of routers and a datagram, 20 µs each.
pub const WIDE_GUARD: Plan = Plan { pitch_us: 320, link: "1 Gbit/s", ..LOADED };

/// As RTnet's pitch must be, which leaves 80 µs for the guard.
pub const SHORT_PITCH: Plan = Plan { pitch_us: 250, guard_us: 80, ..WIDE_GUARD };

/// The shortest that there can be, with the smallest guard that there can be.
pub const SHORTEST_PITCH: Plan = Plan { pitch_us: 210, guard_us: 40, ..WIDE_GUARD };

/// The shortest cycle: one master, and slots of the same kind.
pub const BRISK: Plan = Plan { cycle_us: 1_000, synchronisation_us: 210, masters: 1, ..SHORT_PITCH };

/// Slots with room for several packages: what is declared fits, and what floods has what is left.
pub const FLOWS: Plan = Plan { pitch_us: 1_300, flows: &[URGENT, STEADY, BULKY], ..LOADED };

const URGENT: Declared = Declared { class: (Class(200), "urgent"), hop: 1, bytes: 64, period_us: 9_000 };
const STEADY: Declared = Declared { class: (Class(160), "steady"), hop: 2, bytes: 1_000, period_us: 19_000 };
/// In five parts.
const BULKY: Declared = Declared { class: (Class(130), "bulky"), hop: 1, bytes: 6_000, period_us: 49_000 };
