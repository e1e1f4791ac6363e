//! Seals what routers send to each other, and opens what they get. The page `docs/src/security.md` says what is promised, and what is not.
//!
//! ```text
//!  head 36, of which all but the check is signed │ what follows it, sealed │ tag 16
//!
//!  A                                   B
//!  ── question: challenge a ─────────▶      any life of A may have said it, today or last year: nothing begins by it
//!  ◀── answer to a: challenge b ──────      a is A's own, and new: this life of B lives. A takes its datagrams, and seals to it
//!  ── last word: answer to b ────────▶      so does B
//!  ══ packages, time: sealed by A's present life to B's present life ══▶
//! ```
//!
//! A *hello* (one of these three) is sealed from node to node, packages from life to life, time from life to node: so nothing that was recorded in
//! another life of either end is taken in this one. A challenge serves once, and not for long, then there is another; and a hello says from which
//! sequence on its life will be heard, so nothing that a life had sent before is taken either.
//!
//! ```text
//!  arrivals:   Gate: Opening (packages), Greeter ──── Acquaintances: who lives ────▶ departures: Sealing (packages)
//!                                                                        └────▶ clock:     Sealing, Opening (time)
//! ```
//!
//! No sockets, threads or clocks here. Sealing and opening take nothing from the heap and no lock; keys are derived when a life begins, which
//! nobody brings about who has no key.

mod acquaintances;
mod gate;
mod greeter;
mod hello;
mod keys;
mod opening;
mod overheard;
mod random;
mod rejection;
mod seal;
mod sealing;
mod tally;
mod waiting;

pub use acquaintances::{Acquaintances, Port, Who};
pub use gate::{ASK_EVERY_NS, Gate, Said};
pub use greeter::{ANSWERS_MAX, CHALLENGE_MAX_NS, Greeted, Greeter, PER_NS};
pub use hello::{HELLO_BYTES, Hello};
pub use keys::{InstallationKey, KEY_BYTES, KeyId, KeyRing};
pub use opening::{Greeting, Opened, Opening};
pub use random::{NoRandom, random};
pub use rejection::{NotOpened, Rejection};
pub use seal::TAG_BYTES;
pub use sealing::{Sealing, Unacquainted};
pub use tally::{Rejections, TELL_EVERY_NS, Tally};
pub use waiting::{HELLO_SLOT_BYTES, Waiting};

/// Bytes of a datagram that carries a hello.
pub const HELLO_DATAGRAM_BYTES: usize = crate::frame::HEAD_BYTES + HELLO_BYTES + TAG_BYTES;

#[cfg(test)]
mod tests;
