//! Parts of replicas, as the thread of the time slots has them.

use super::super::sending::{NoPackages, Sending};
use crate::driver::{NotSent, Outlet, part_for_slot};
use crate::frame::NodeIndex;
use crate::replication::{OneWayClock, ReplicaSender};
use rohrpost_mailbox::monotonic_ns;
use std::sync::{Arc, Mutex};

/// Streams of this node that others have, and the sockets to these.
pub(in crate::shell) struct SlotParts {
    /// Another thread looks for streams meanwhile: this one never waits for it.
    pub(in crate::shell) sender: Arc<Mutex<ReplicaSender>>,
    pub(in crate::shell) sending: Sending<NoPackages>,
    pub(in crate::shell) clock: OneWayClock,
}

impl SlotParts {
    /// Writes the next part; its receiver and its length.
    pub(super) fn next(&mut self, datagram: &mut [u8]) -> Option<(NodeIndex, usize)> {
        let Self { sender, sending: Sending { outbound, .. }, clock } = self;
        let mut sender = sender.try_lock().ok()?;
        part_for_slot(&mut sender, outbound, monotonic_ns(), |ns| clock.at(ns), datagram)
    }

    /// Hands it to the kernel.
    pub(super) fn send(&mut self, to: NodeIndex, buffer: &mut [u8], bytes: usize) {
        let Self { sending, .. } = self;
        if let Err(NotSent) = sending.send(monotonic_ns(), to, buffer, bytes) {
            sending.outbound.unsent(&buffer[..bytes], &[], &mut NoPackages);
        }
    }
}
