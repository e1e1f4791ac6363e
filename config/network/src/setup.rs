//! How routers send: whether it is sealed, how much, to whom, and on which level a package waits.

use crate::sizes::{HEADS_V4, HEADS_V6, TAG_BYTES};
use rohrpost_mailbox::{Name, Priority};
use std::time::Duration;

/// Most nodes of a system.
pub const NODES_MAX: usize = 64;
/// Levels of a router's queue; 0 goes first, the last takes what is not real time: see [`Network::level`].
pub const LEVELS: usize = 32;
/// Level of what is not real time; the real-time levels 0..=30 go before it.
pub const LEVEL_NOT_REAL_TIME: u8 = LEVELS as u8 - 1;
/// Where there are time slots, a router looks so often between two of them whether half of its transit mailbox is full; then it takes all.
pub const TRANSIT_LOOK: Duration = Duration::from_micros(1500);

/// Whether what routers say to each other is sealed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Security {
    /// Neither sealed nor signed, and the file says so in words.
    None,
    /// Sealed with keys.
    Keys,
}

impl Security {
    /// As the file writes it.
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Keys => "keys",
        }
    }

    /// Bytes behind what each datagram says.
    pub const fn tag_bytes(self) -> usize {
        match self {
            Self::None => 0,
            Self::Keys => TAG_BYTES,
        }
    }
}

/// How the routers of an installation send.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Network {
    /// Whether it is sealed.
    pub security: Security,
    /// UDP port of packages; time has the next one, and packages that are not real time the one behind that.
    pub port: u16,
    /// Largest IP packet that every link carries, in bytes.
    pub mtu: u16,
    /// Largest datagram, in bytes behind the heads of IP and UDP, and without what seals it.
    pub datagram_bytes_max: usize,
    /// Bytes a second that a router sends at most, the heads of IP and UDP and what seals counted; with time slots those that the link carries.
    pub rate_bytes_s: u64,
    /// Bytes of one sender's packages that its node's router keeps waiting.
    pub quota_bytes: usize,
    /// Classes below this id are not real time.
    pub bulk_below: u8,
}

/// Mailbox names of another node: all from the first to the last, by number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Route {
    /// First of them.
    pub first: Name,
    /// Last of them.
    pub last: Name,
    /// The node, by its place in the file.
    pub node: u8,
}

impl Network {
    /// UDP port of time.
    pub fn time_port(&self) -> u16 {
        self.port + 1
    }

    /// UDP port of packages that are not real time, where there are no time slots.
    pub fn rest_port(&self) -> u16 {
        self.port + 2
    }

    /// In which of a router's queues a package waits: 0 goes first, 30 is the last real-time level, [`LEVEL_NOT_REAL_TIME`] goes when all
    /// others are empty. The highest four bits of the priority count, as in RTnet (seed 002, 4.2); each of its 16 levels takes two of ours,
    /// so that there is room for what routers themselves have to say.
    pub fn level(&self, priority: Priority) -> u8 {
        level(priority, self.bulk_below)
    }

    /// What each datagram takes besides what it says: the heads of IP and UDP before it, and what seals it behind it.
    pub fn around_bytes(is_v6: bool, security: Security) -> usize {
        let heads = if is_v6 { HEADS_V6 } else { HEADS_V4 };
        heads + security.tag_bytes()
    }
}

/// The level of a priority, if classes below `bulk_below` are not real time.
pub fn level(priority: Priority, bulk_below: u8) -> u8 {
    if priority.0 < bulk_below { LEVEL_NOT_REAL_TIME } else { (15 - (priority.0 >> 4)) * 2 }
}
