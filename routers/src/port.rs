//! The UDP ports of a router.

/// Sequences of one port: those of a port where nothing is sealed begin at a multiple of it.
pub(crate) const SEQUENCES: u64 = 1 << 48;

/// Which of a router's ports, by its distance from the configured one. Each has sequences of its own, and keys of its
/// own where datagrams are sealed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(usize)]
pub enum Port {
    /// Packages.
    Packages = 0,
    /// Time.
    Time = 1,
    /// Packages that are not real time.
    Rest = 2,
    /// What the two ends of a replica send to each other.
    Replicas = 3,
}

impl Port {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Packages, Self::Time, Self::Rest, Self::Replicas];

    /// The first sequence of what is sent to this port where nothing is sealed. So a datagram shows which port it is
    /// for, and one that comes to another port changes nothing there. Time needs no range of its own: it has kinds of
    /// frames that no other port takes.
    pub const fn first_sequence(self) -> u64 {
        match self {
            Self::Packages | Self::Time => 0,
            Self::Rest | Self::Replicas => self as u64 * SEQUENCES,
        }
    }

    /// Whether a sequence is one of this port, where nothing is sealed.
    pub(crate) const fn has_sequence(self, sequence: u64) -> bool {
        let first = self.first_sequence();
        first <= sequence && sequence < first + SEQUENCES
    }
}
