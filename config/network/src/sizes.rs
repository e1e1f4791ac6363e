//! Sizes of the routers' frames, and the two clock rates of the bounds.

use std::time::Duration;

/// Overhead of Ethernet for each packet: preamble 8, head 14, check 4, gap 12.
pub const ETHERNET_BYTES: usize = 8 + 14 + 4 + 12;
/// Head of a router's datagram.
pub const FRAME_HEAD_BYTES: usize = 36;
/// Head of a fragment of a package, the package's head included.
pub const FRAGMENT_HEAD_BYTES: usize = 32;
/// Head of a part of a record, behind that of its datagram.
pub const RECORD_PART_HEAD_BYTES: usize = 64;
/// Bytes of a record in each part by the TCP router but the last. An important package waits for no more than one part
/// that is ready.
pub const LINE_PART_BYTES: usize = 4096;
/// What stands before them: the head of a session's frame, and that of the part.
pub const LINE_PART_HEADS_BYTES: usize = 8 + RECORD_PART_HEAD_BYTES;
/// Content of a datagram of time.
pub const TIME_BYTES: usize = 72;
/// Content of a keep-alive.
pub const ALIVE_BYTES: usize = 24;
/// Content of a refusal.
pub const REFUSAL_BYTES: usize = 16;
/// Content of a hello, by which nodes that seal authenticate each other.
pub const HELLO_BYTES: usize = 32;
/// Size of the blocks in which a router keeps the body of a waiting package.
pub const KEPT_IN_BYTES: u64 = 256;
/// A clock that was not compared with another yet drifts by at most one part in this many.
pub const RATE_MAX_PER: u32 = 4000;
/// System time is slewed by at most one part in this many. The clock that measures it may drift by [`RATE_MAX_PER`]
/// meanwhile.
pub const BEND_MAX_PER: u32 = 1000;
/// Time of a computer to hand over one datagram: a fast link does not get more of them.
pub const HAND_OVER: Duration = Duration::from_micros(20);

/// Most that UDP over IPv4 carries, in bytes.
pub const PAYLOAD_MAX: usize = 65_507;
/// Behind sealed content.
pub const TAG_BYTES: usize = 16;
/// Headers of IP and UDP, in bytes.
pub(crate) const HEADS_V4: usize = 20 + 8;
pub(crate) const HEADS_V6: usize = 40 + 8;
