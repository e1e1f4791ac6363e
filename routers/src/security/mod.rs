//! Seals what routers send to each other, and opens what they get. The page `docs/src/security.md` says what is
//! promised, and what is not.
//!
//! ```text
//!  head 36, of which all but the check is signed │ what follows it, sealed │ tag 16
//!
//!  A                                   B
//!  ── challenge a ───────────────────▶      may be a replay from any incarnation of A: nothing begins by it
//!  ◀── response to a, challenge b ────      a is A's own, and new: this incarnation of B lives. A opens its datagrams,
//!                                           and seals to it
//!  ── response to b ─────────────────▶      B does the same
//!  ══ packages, time: sealed by A's present incarnation to B's present incarnation ══▶
//! ```
//!
//! A *hello* (one of these three) is sealed from node to node, packages from incarnation to incarnation, time from
//! incarnation to node: so nothing that was recorded in another incarnation of either end is taken in this one. A
//! challenge serves once, and not for long, then there is another; and a hello says from which sequence on its
//! incarnation will be heard, so nothing that an incarnation had sent before is taken either.
//!
//! ```text
//!  rx_thread:    Gate: Opening (packages), Handshake ──▶ PeerSessions ─┬─▶ tx_thread:    Sealing (packages)
//!  rest-in:      Gate: Opening (rest) ◀────────────────────────────────┼─▶ rest-out:     Sealing (rest)
//!  replicas-in:  Gate: Opening (replicas) ◀────────────────────────────┼─▶ replicas-out: Sealing (replicas)
//!                                                                      └─▶ clock:        Sealing, Opening (time)
//! ```
//!
//! No nonce serves twice with one key, and nothing opens twice:
//!
//! - A key is for one port, one direction, and one incarnation of each end ([`Port`]); so ports may count alike.
//! - At a port one thread writes heads, from the counters of that port; their sequence is the nonce, and the same
//!   thread seals. Should two do so: a sequence is used up by one atomic operation, and a thread that meets a used one
//!   panics before it seals.
//! - At a port one thread opens, with a window for each peer's incarnation. Hellos say where those of packages and time
//!   begin. What else is sealed, is sealed to a present incarnation, so its window begins with the first datagram; and
//!   an incarnation that is taken for the present one again goes on behind what was opened of it.
//!
//! No sockets, threads or clocks here. Sealing and opening use no heap and no lock. Keys are derived when an
//! incarnation begins, and only holders of a key can cause that.

mod gate;
mod handshake;
mod hello;
mod hello_queue;
mod keys;
mod opening;
mod peer_sessions;
mod rejection;
mod seal;
mod sealing;
mod tally;
mod team_seal;
mod unverified;

pub use crate::port::Port;
pub use gate::{ASK_EVERY_NS, Gate, OutgoingHello};
pub use handshake::{ANSWERS_MAX, CHALLENGE_MAX_NS, Handshake, HelloOutcome, PER_NS};
pub use hello::{HELLO_BYTES, Hello};
pub use hello_queue::{HELLO_SLOT_BYTES, HelloQueue};
pub use keys::{InstallationKey, KEY_BYTES, KeyId, KeyRing, NoRandom, random};
pub use opening::{Opened, OpenedHello, Opening};
pub use peer_sessions::{PeerSessions, RouterIdentity};
pub use rejection::{NotOpened, Rejection};
pub use seal::TAG_BYTES;
pub use sealing::{NoSession, Sealing};
pub use tally::{Rejections, TELL_EVERY_NS, Tally};
pub(crate) use team_seal::TeamSeal;

/// Bytes of a datagram that carries a hello.
pub const HELLO_DATAGRAM_BYTES: usize = crate::frame::HEAD_BYTES + HELLO_BYTES + TAG_BYTES;

#[cfg(test)]
mod tests;
