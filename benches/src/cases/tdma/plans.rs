//! The slot tables of the cases.

use crate::tdma::plan::{Declared, Plan};
use rohrpost_mailbox::{Class, StreamShape};
use std::time::Duration;

/// RTnet's own cycle; slots with room for a datagram of 1400 B on an ordinary link.
pub const LOADED: Plan = Plan {
    cycle_us: 5_000,
    synchronisation_us: 500,
    guard_us: 150,
    pitch_us: 430,
    link: "100 Mbit/s",
    masters: 2,
    flows: &[],
    records: None,
};

/// The shortest slots for such a datagram with a guard of 150 µs: 50 µs late, six frames of routers and a datagram, 20
/// µs each.
pub const WIDE_GUARD: Plan = Plan { pitch_us: 320, link: "1 Gbit/s", ..LOADED };

/// RTnet's distance of slots, which leaves 80 µs for the guard.
pub const SHORT_PITCH: Plan = Plan { pitch_us: 250, guard_us: 80, ..WIDE_GUARD };

/// The shortest possible slots, with the smallest possible guard.
pub const SHORTEST_PITCH: Plan = Plan { pitch_us: 210, guard_us: 40, ..WIDE_GUARD };

/// The shortest cycle: one master, and slots of the same kind.
pub const BRISK: Plan = Plan { cycle_us: 1_000, synchronisation_us: 210, masters: 1, ..SHORT_PITCH };

/// Slots with room for several packages: declared flows fit, and flooding modules share the rest.
pub const FLOWS: Plan = Plan { pitch_us: 1_300, flows: &[URGENT, STEADY, BULKY], ..LOADED };

/// The same with a stream on each node that the next one has as a replica.
pub const REPLICAS: Plan = Plan { records: Some(RECORDS), ..FLOWS };

/// In twelve parts. A replica that is behind by half of them goes on with the newest.
const RECORDS: StreamShape = StreamShape { record_bytes: 16 << 10, keep: 16, readers: 4, late: Duration::ZERO };

const URGENT: Declared = Declared { class: (Class(200), "urgent"), hop: 1, bytes: 64, period_us: 9_000 };
const STEADY: Declared = Declared { class: (Class(160), "steady"), hop: 2, bytes: 1_000, period_us: 19_000 };
/// In five fragments.
const BULKY: Declared = Declared { class: (Class(130), "bulky"), hop: 1, bytes: 6_000, period_us: 49_000 };
