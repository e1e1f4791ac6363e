//! A datagram that was made for a slot and missed it.

use crate::frame::{Fragment, FrameKind, NodeIndex};
use crate::outbound::kind_of_own;
use rohrpost_mailbox::Head;
use rohrpost_network::{LEVEL_NOT_REAL_TIME, Network};

/// It waits for another slot at most so long.
pub const HELD_NS_MAX: u64 = 100_000_000;

/// Its receiver and its length; it stands at the beginning of the buffer.
#[derive(Clone, Copy)]
pub(super) struct HeldDatagram {
    pub(super) to: NodeIndex,
    pub(super) bytes: usize,
    pub(super) made_ns: u64,
}

impl HeldDatagram {
    pub(super) fn is_old(&self, now_ns: u64) -> bool {
        now_ns.saturating_sub(self.made_ns) > HELD_NS_MAX
    }
}

/// Whether a datagram of this router carries real-time packages or a router message. What is most important stands
/// first in it. Where it is to be sealed, it has no check yet.
pub(super) fn is_real_time(datagram: &[u8], network: &Network) -> bool {
    let Some((kind, _, rest)) = kind_of_own(datagram) else { return false };
    let head = match kind {
        FrameKind::Packages => Head::from_bytes(rest).ok(),
        FrameKind::Fragment => Fragment::parse(rest).ok().map(|part| part.head),
        // What routers say to each other has its place before all packages.
        _ => None,
    };
    head.is_none_or(|head| network.level(head.priority) != LEVEL_NOT_REAL_TIME)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{ALIVE_BYTES, FrameHead, HEAD_BYTES};
    use crate::harness::{ENVELOPE, End, START, head, module};

    #[test]
    fn a_datagram_is_as_important_as_what_stands_first_in_it() {
        let mut end = End::new(0, |_| {});
        let network = end.settings.network;
        for (bodies, real_time, why) in [
            (&[(16, 10)][..], true, "the least that is real time"),
            (&[(15, 10)], false, "the most that is not"),
            (&[(90, 10), (3, 10)], true, "in company"),
            (&[(90, 3000)], true, "in parts"),
            (&[(3, 3000)], false, "in parts, not real time"),
        ] {
            for (priority, len) in bodies {
                end.queue(START, head(module(100, 1), module(100, 0), *priority), &vec![0; *len]);
            }
            let mut datagram = [0; 1472];
            let mut first = true;
            while let Some((_, bytes)) = end.outbound.poll_slot(START, (1472, &mut datagram), None, &mut end.log) {
                let (frame, rest) = FrameHead::parse(&datagram[..bytes]).unwrap();
                let (says, rest_bytes) = (frame.kind == FrameKind::Alive, rest.len());
                // As it is where it is to be sealed.
                datagram[HEAD_BYTES - 4..HEAD_BYTES].fill(0);
                assert!(!says || rest_bytes == ALIVE_BYTES && is_real_time(&datagram[..bytes], &network));
                if !says && std::mem::take(&mut first) {
                    assert_eq!(is_real_time(&datagram[..bytes], &network), real_time, "{why}");
                }
            }
            assert!(!first, "{why}: nothing left");
        }
        assert!(!is_real_time(&ENVELOPE, &network), "it is none");
    }

    #[test]
    fn it_does_not_wait_for_ever() {
        let held = HeldDatagram { to: 1, bytes: 10, made_ns: START };
        assert!(!held.is_old(START + HELD_NS_MAX) && held.is_old(START + HELD_NS_MAX + 1));
    }
}
