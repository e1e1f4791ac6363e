//! One window in use: what still fits in it.

use super::LATE_NS;
use super::table::{Window, WindowKind};
use super::wire::Wire;
use crate::time::Allowed;
use rohrpost_network::HAND_OVER;

/// What a window may carry.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Carries {
    /// A hello alone: the node hears unverified peers only.
    Hello,
    /// Datagrams of time, and a hello in a slot: a synchronisation window, or the node's time is coarse.
    Time,
    /// All that waits, time first.
    All,
}

/// The wire belongs to this node from `begin_ns` to `end_ns`.
#[derive(Clone, Debug)]
pub struct TransmitWindow {
    /// Which window, in system time.
    pub window: Window,
    /// Beginning, local ns.
    pub begin_ns: u64,
    /// End, local ns: here the guard begins.
    pub end_ns: u64,
    /// What it may carry.
    pub carries: Carries,
    /// From the call to the wire, ns.
    pub(super) lead_ns: u64,
    pub(super) wire: Wire,
    /// When the wire has carried what was handed over, local ns.
    free_ns: u64,
    /// How long the bounds assume the window busy with what was handed over, ns.
    planned_ns: u64,
    /// What bounds do not count was handed over.
    has_others: bool,
    datagrams: u64,
    wire_bytes: u64,
    /// When the last send call came back, local ns; 0: there was none.
    returned_ns: u64,
    /// It began too late, or took too long, for what bounds assume.
    pub(crate) fell_behind: bool,
}

impl TransmitWindow {
    pub(crate) fn new(window: Window, begin_ns: u64, end_ns: u64, carries: Carries, lead_ns: u64, wire: Wire) -> Self {
        Self {
            window,
            begin_ns,
            end_ns,
            carries,
            lead_ns,
            wire,
            free_ns: begin_ns,
            planned_ns: 0,
            has_others: false,
            datagrams: 0,
            wire_bytes: 0,
            returned_ns: 0,
            fell_behind: false,
        }
    }

    /// The largest datagram that would be off the wire before the guard if it were handed over now, in bytes. None:
    /// nothing fits.
    pub fn room_bytes(&self, now_ns: u64) -> Option<usize> {
        let starts_ns = self.starts_ns(now_ns);
        self.wire.datagram_bytes_in(self.end_ns.checked_sub(starts_ns)?)
    }

    /// Whether a datagram of this size would be off the wire before the guard.
    pub fn fits(&self, now_ns: u64, datagram_bytes: usize) -> bool {
        self.room_bytes(now_ns).is_some_and(|room_bytes| datagram_bytes <= room_bytes)
    }

    /// A datagram is being handed over now.
    pub fn takes(&mut self, now_ns: u64, datagram_bytes: usize) {
        let wire_ns = self.wire.ns(datagram_bytes);
        self.free_ns = self.starts_ns(now_ns).saturating_add(wire_ns);
        self.planned_ns += reckoned_ns(wire_ns);
        self.datagrams += 1;
        self.wire_bytes += self.wire.bytes(datagram_bytes) as u64;
    }

    /// The same for one that bounds do not count, since it leaves behind all that they promised this window. What comes
    /// later is promised the next one, and cannot be late in this one.
    pub(crate) fn takes_beside(&mut self, now_ns: u64, datagram_bytes: usize) {
        self.takes(now_ns, datagram_bytes);
        self.has_others = true;
    }

    /// The send call of a datagram came back now.
    pub fn returns(&mut self, now_ns: u64) {
        self.returned_ns = now_ns;
    }

    /// The last send call came back so long after the end, ns; 0: not after it.
    pub fn over_ns(&self) -> u64 {
        self.returned_ns.saturating_sub(self.end_ns)
    }

    /// Time from the handover of a datagram now until its last bit is at the other computer, behind a store-and-forward
    /// switch, ns. `to_wire_ns`: how long it takes to the wire, unless that is busy for longer.
    pub fn arrives_after_ns(&self, now_ns: u64, datagram_bytes: usize, to_wire_ns: u64) -> u64 {
        self.free_ns.saturating_sub(now_ns).max(to_wire_ns) + 2 * self.wire.ns(datagram_bytes)
    }

    /// How long the wire is still busy, ns: what is handed over meanwhile leaves no sooner.
    pub fn busy_ns(&self, now_ns: u64) -> u64 {
        self.free_ns.saturating_sub(now_ns.saturating_add(self.lead_ns))
    }

    /// Whether a datagram handed over now would be off the wire later than the bounds assume: the window began too
    /// late, or the thread was stalled.
    pub fn is_late(&self, now_ns: u64, datagram_bytes: usize) -> bool {
        let wire_ns = self.wire.ns(datagram_bytes);
        let reckoned_ns = self.reckoned_ns().saturating_add(reckoned_ns(wire_ns));
        !self.has_others && self.starts_ns(now_ns).saturating_add(wire_ns) > reckoned_ns
    }

    /// Whether the window has less room left now than the bounds assume.
    pub fn is_behind(&self, now_ns: u64) -> bool {
        self.starts_ns(now_ns) > self.reckoned_ns()
    }

    /// When the wire is free for the next datagram at the latest, by the bounds, local ns.
    fn reckoned_ns(&self) -> u64 {
        self.begin_ns.saturating_add(LATE_NS + self.planned_ns)
    }

    /// When a datagram handed over now is on the wire: not before those handed over earlier.
    fn starts_ns(&self, now_ns: u64) -> u64 {
        let at_once_ns = now_ns.saturating_add(self.lead_ns);
        self.free_ns.max(at_once_ns)
    }

    /// What was handed over is off the wire so long before the end, as planned, ns.
    pub fn spare_ns(&self) -> i64 {
        self.end_ns.wrapping_sub(self.free_ns).cast_signed()
    }

    /// Datagrams so far.
    pub fn datagrams(&self) -> u64 {
        self.datagrams
    }

    /// Bytes on the wire so far, with all headers.
    pub fn wire_bytes(&self) -> u64 {
        self.wire_bytes
    }

    /// Whether a hello may leave in it.
    pub fn carries_hello(&self) -> bool {
        matches!(self.window.kind, WindowKind::Slot { .. })
    }

    /// Whether a refusal may leave in it: a node that is not sure of the time sends nothing but hellos.
    pub fn carries_refusal(&self) -> bool {
        self.carries_hello() && self.carries == Carries::All
    }

    /// What the clock may send in it.
    pub fn allowed(&self) -> Allowed {
        match self.window.kind {
            _ if self.carries == Carries::Hello => Allowed::Nothing,
            WindowKind::Synchronisation { .. } => {
                Allowed::Synchronisation { cycle: self.window.cycle, nominal_ns: self.window.begin_ns }
            }
            WindowKind::Slot { .. } => Allowed::Slot,
        }
    }
}

/// How long the bounds assume a datagram to keep a window busy, ns: a short one waits for the thread.
fn reckoned_ns(wire_ns: u64) -> u64 {
    wire_ns.max(HAND_OVER.as_nanos() as u64)
}
