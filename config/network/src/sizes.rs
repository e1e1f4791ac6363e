//! Sizes of what routers write, and the two paces of clocks that bounds are computed with.

use std::time::Duration;

/// What Ethernet adds to each packet: preamble 8, head 14, check 4, gap 12.
pub const ETHERNET_BYTES: usize = 8 + 14 + 4 + 12;
/// Before what a datagram of routers says.
pub const FRAME_HEAD_BYTES: usize = 36;
/// Before the bytes of a part of a package, the package's head included.
pub const FRAGMENT_HEAD_BYTES: usize = 32;
/// What a datagram of time says.
pub const TIME_BYTES: usize = 72;
/// What a datagram says that only says "still there".
pub const ALIVE_BYTES: usize = 24;
/// What a datagram says that refuses others.
pub const REFUSAL_BYTES: usize = 16;
/// What a datagram says by which nodes that seal get to know each other.
pub const HELLO_BYTES: usize = 32;
/// A router keeps the body of a package that waits in pieces of so many bytes.
pub const KEPT_IN_BYTES: u64 = 256;
/// A clock that was not compared with another yet is off by one, at most, in so long.
pub const RATE_MAX_PER: u32 = 4000;
/// System time is bent by one, at most, in so long, and the clock by which it is measured runs meanwhile as far off as [`RATE_MAX_PER`] says.
pub const BEND_MAX_PER: u32 = 1000;
/// A computer needs so long to hand over one datagram after the other: a quick link does not get more of them.
pub const HAND_OVER: Duration = Duration::from_micros(20);

/// Most that UDP over IPv4 carries, in bytes.
pub const PAYLOAD_MAX: usize = 65_507;
/// Behind what is sealed.
pub const TAG_BYTES: usize = 16;
/// Heads of IP and UDP, in bytes.
pub(crate) const HEADS_V4: usize = 20 + 8;
pub(crate) const HEADS_V6: usize = 40 + 8;
