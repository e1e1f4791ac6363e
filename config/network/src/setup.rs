//! How routers send: whether datagrams are sealed, rate and sizes, receivers, and the level on which a package waits.

use crate::sizes::{HEADS_V4, HEADS_V6, TAG_BYTES};
use rohrpost_mailbox::{Name, Priority};
use std::time::Duration;

/// Most nodes of a system.
pub const NODES_MAX: usize = 64;
/// Levels of a router's queue; 0 goes first, the last is for what is not real time: see [`Network::level`].
pub const LEVELS: usize = 32;
/// Level of what is not real time; the real-time levels 0..=30 go before it.
pub const LEVEL_NOT_REAL_TIME: u8 = LEVELS as u8 - 1;
/// With time slots, a router checks between slots this often whether half of its transit mailbox is full; then it takes
/// all.
pub const TRANSIT_LOOK: Duration = Duration::from_micros(1500);

/// Whether datagrams between routers are sealed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Security {
    /// Neither sealed nor signed, stated in the file.
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

    /// Bytes of the seal behind the content of each datagram.
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
    /// Whether datagrams are sealed.
    pub security: Security,
    /// UDP port of packages; time has the next one, packages that are not real time and parts of replicas the two
    /// after that.
    pub port: u16,
    /// Largest IP packet that every link carries, in bytes.
    pub mtu: u16,
    /// Largest datagram, in bytes, without headers of IP and UDP and without the seal.
    pub datagram_bytes_max: usize,
    /// Bytes a second that a router sends at most, with headers of IP and UDP and the seal; with time slots those that
    /// the link carries.
    pub rate_bytes_s: u64,
    /// Bytes of one sender's packages that may wait in its node's router.
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

    /// UDP port of packages that are not real time, without time slots.
    pub fn rest_port(&self) -> u16 {
        self.port + 2
    }

    /// UDP port of parts of replicas.
    pub fn replica_port(&self) -> u16 {
        self.port + 3
    }

    /// The level of a priority in a router's queue: 0 goes first, 30 is the last real-time level,
    /// [`LEVEL_NOT_REAL_TIME`] goes when all others are empty. The highest four bits of the priority count, as in
    /// RTnet. Each of these 16 levels takes two levels here, which leaves room for the routers' own messages.
    pub fn level(&self, priority: Priority) -> u8 {
        level(priority, self.bulk_below)
    }

    /// Overhead of each datagram: headers of IP and UDP before the content, and the seal behind it.
    pub fn around_bytes(is_v6: bool, security: Security) -> usize {
        let heads = if is_v6 { HEADS_V6 } else { HEADS_V4 };
        heads + security.tag_bytes()
    }
}

/// The level of a priority, if classes below `bulk_below` are not real time.
pub fn level(priority: Priority, bulk_below: u8) -> u8 {
    if priority.0 < bulk_below { LEVEL_NOT_REAL_TIME } else { (15 - (priority.0 >> 4)) * 2 }
}
