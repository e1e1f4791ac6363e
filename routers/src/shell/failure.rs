//! Kinds of failures to send a datagram, as far as they make a difference, and their counters.

use std::io;
use std::sync::atomic::{AtomicU64, Ordering};

rohrpost_mailbox::causes! {
    /// What the kernel says instead of sending a datagram.
    pub enum Failure {
        /// The computer is there, but nothing listens at the port. Reported for an earlier datagram; this one was sent.
        NobodyThere = "nobody-there",
        /// No route to the address: the network is down, the route is missing, or a firewall forbids it.
        NoWay = "no-way",
        /// Longer than the path can carry.
        TooLong = "too-long",
        /// The kernel or the network card had no room.
        NoRoom = "no-room",
        /// The device's queue is full: the kernel takes no more without waiting.
        Full = "full",
        /// The peer has no session to seal with.
        Unacquainted = "unacquainted",
        /// Anything else.
        Other = "other",
    }
}

impl Failure {
    pub(super) fn of(error: &io::Error) -> Self {
        use nix::errno::Errno;
        match Errno::from_raw(error.raw_os_error().unwrap_or(0)) {
            Errno::ECONNREFUSED => Self::NobodyThere,
            Errno::ENETUNREACH
            | Errno::EHOSTUNREACH
            | Errno::ENETDOWN
            | Errno::EHOSTDOWN
            | Errno::EADDRNOTAVAIL
            | Errno::EINVAL
            | Errno::EACCES
            | Errno::EPERM => Self::NoWay,
            Errno::EMSGSIZE => Self::TooLong,
            Errno::ENOBUFS | Errno::ENOMEM => Self::NoRoom,
            Errno::EAGAIN => Self::Full,
            _ => Self::Other,
        }
    }

    /// Whether the datagram was not sent.
    pub const fn is_loss(self) -> bool {
        !matches!(self, Self::NobodyThere)
    }

    /// What happened, and what to do.
    pub const fn words(self) -> &'static str {
        match self {
            Self::NobodyThere => "nobody listens at its port; does its router run?",
            Self::NoWay => {
                "there is no way to its address; is the network up, and does a firewall forbid it? (`ip route get \
                 ADDRESS`)"
            }
            Self::TooLong => "the datagram was too long for the network; lower `mtu` in [network], on all nodes",
            Self::NoRoom => {
                "the kernel had no room; lower `rate` in [network], or with time slots `link` in [tdma], to what the \
                 network can carry"
            }
            Self::Full => {
                "its device has not sent what it was given before; does it stand still, or carry less than `rate` in \
                 [network], or with time slots `link` in [tdma], says (`ethtool DEVICE`), and is net.core.wmem_max \
                 enough for a slot (`sysctl`)?"
            }
            Self::Unacquainted => "its router has not shown yet that it has the same key",
            Self::Other => "the kernel refused it",
        }
    }
}

/// Counters of each of them.
#[derive(Default, Debug)]
pub struct Failures([AtomicU64; Failure::ALL.len()]);

impl Failures {
    pub(super) fn count(&self, failure: Failure) {
        self.0[failure as usize].fetch_add(1, Ordering::Relaxed);
    }

    /// The counter of this one.
    pub fn of(&self, failure: Failure) -> u64 {
        self.0[failure as usize].load(Ordering::Relaxed)
    }
}
