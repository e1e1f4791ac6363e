//! What leaves in a slot behind all packages: parts of replicas.
//!
//! ```text
//!  ├ time ┤ "still there" ┤ packages by level ┤ part ┤ part ┤ a package that came meanwhile ┤ part ┤   ░ guard ░
//!                                                                        the next does not fit ┘ it waits, made
//! ```
//!
//! The thread of the slots reads the rings itself. So a record waits in its ring and nowhere else, what is written last
//! may leave in the next slot, and no other thread has to be awake in time. To read a part is a copy: streams are found
//! and opened by another thread, which has the lock for that; meanwhile no part leaves, and nothing waits for it.
//!
//! Parts have a port and sequences of their own. No bound counts them: none leaves while a package could, so they delay
//! only what comes during the slot, by one datagram; and to that the bounds promise the next slot.

use super::platform::Platform;
use crate::frame::NodeIndex;
use crate::outbound::Outbound;
use crate::replication::{ReplicaSender, ReplicaStep};
use crate::settings::Settings;
use crate::tdma::TransmitWindow;
use rohrpost_mailbox::SystemTime;

/// Writes the next part for a slot into a datagram; its receiver and its length.
pub fn part_for_slot(
    sender: &mut ReplicaSender,
    queue: &mut Outbound,
    now_ns: u64,
    system: impl Fn(u64) -> SystemTime,
    datagram: &mut [u8],
) -> Option<(NodeIndex, usize)> {
    queue.look_at_peers(now_ns);
    match sender.poll(now_ns, system, queue, datagram) {
        ReplicaStep::Send { to, bytes } => Some((to, bytes)),
        ReplicaStep::Wait { .. } | ReplicaStep::Idle { .. } => None,
    }
}

/// The next part.
pub(super) struct NextPart {
    /// Room for the largest datagram, and its seal.
    datagram: Box<[u8]>,
    /// Receiver and length of one that was made and did not fit any more: it waits there for the next slot.
    made: Option<(NodeIndex, usize)>,
}

impl NextPart {
    pub(super) fn new(settings: &Settings) -> Self {
        let bytes = settings.network.datagram_bytes_max + settings.network.security.tag_bytes();
        Self { datagram: vec![0; bytes].into(), made: None }
    }

    /// Sends one part, if there is one and it fits; whether it did. Call it when no package may leave.
    pub(super) fn send_next(&mut self, on: &mut impl Platform, tx_window: &mut TransmitWindow) -> bool {
        if tx_window.room_bytes(on.local_ns()).is_none() {
            return false;
        }
        let made = self.made.take().or_else(|| on.next_part(&mut self.datagram));
        let Some((to, bytes)) = made else { return false };
        let now_ns = on.local_ns();
        if !tx_window.fits(now_ns, bytes) {
            self.made = made;
            return false;
        }
        on.send_part(to, &mut self.datagram, bytes);
        tx_window.returns(on.local_ns());
        tx_window.takes_beside(now_ns, bytes);
        true
    }
}
