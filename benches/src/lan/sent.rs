//! What has left a node, as the kernel counts it at the node's device.

use rohrpost_bench_local::{Failure, OrFail};
use rohrpost_routers::lab::DEVICE;

/// Devices of the namespace of the process that reads it.
const DEVICES: &str = "/proc/self/net/dev";
/// Columns of a device there.
const BYTES: usize = 8;
const PACKETS: usize = 9;

/// What has left so far.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Sent {
    /// With heads of Ethernet.
    pub bytes: u64,
    /// Packets.
    pub packets: u64,
}

impl Sent {
    /// By the node in which the calling process is.
    ///
    /// # Errors
    /// When its device is not told.
    pub fn now() -> Result<Self, Failure> {
        let text = std::fs::read_to_string(DEVICES).or_fail(DEVICES)?;
        Self::parse(&text).ok_or_else(|| Failure::Failed(format!("{DEVICES} says nothing of `{DEVICE}`: {text}")))
    }

    fn parse(text: &str) -> Option<Self> {
        let of = |line: &str| {
            let (name, columns) = line.split_once(':')?;
            let columns: Vec<u64> = columns.split_whitespace().filter_map(|column| column.parse().ok()).collect();
            let is_it = name.trim() == DEVICE;
            is_it.then_some(Self { bytes: *columns.get(BYTES)?, packets: *columns.get(PACKETS)? })
        };
        text.lines().find_map(of)
    }

    /// What has left since.
    #[must_use]
    pub fn since(self, before: Self) -> Self {
        Self { bytes: self.bytes.saturating_sub(before.bytes), packets: self.packets.saturating_sub(before.packets) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_left_is_read_of_the_nodes_own_device() {
        let text = "Inter-|   Receive                                                |  Transmit\n \
                    name |bytes    packets errs drop fifo frame compressed multicast|bytes    packets errs\n    \
                    lo: 7 1 0 0 0 0 0 0 7 1 0 0 0 0 0 0\n   \
                    lan: 5190 44 0 0 0 0 0 0 1226 15 0 0 0 0 0 0\n";
        let sent = Sent::parse(text).unwrap();
        assert_eq!(sent, Sent { bytes: 1226, packets: 15 });
        assert_eq!(sent.since(Sent { bytes: 226, packets: 5 }), Sent { bytes: 1000, packets: 10 });
        assert_eq!(Sent::parse("Inter-|\n lo: 7 1 0 0 0 0 0 0 7 1\n"), None);
    }
}
