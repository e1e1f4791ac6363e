//! What the cores of packages tell of, written into the oracle: losses, deliveries, events.

use crate::sim::host::Closed;
use crate::sim::package::Role;
use crate::sim::promise::Promise;
use crate::sim::station::Io;
use rohrpost_mailbox::{Head, Kind, Options};
use rohrpost_routers::counts::Cause;
use rohrpost_routers::driver::HELD_NS_MAX;
use rohrpost_routers::frame::NodeIndex;
use rohrpost_routers::inbound::SOCKET_MAX_NS;
use rohrpost_routers::report::{Deliver, NotDelivered, Report, RouterEvent};

/// A datagram that came.
#[derive(Clone, Copy)]
pub(super) struct Came {
    /// To this computer, ns of its monotonic clock.
    pub(super) at_ns: u64,
    /// Life of its sender, as it says.
    pub(super) incarnation: u64,
    /// It has whole packages, and nothing that was sent behind it came before it.
    pub(super) is_newest: bool,
}

pub(super) struct Watch<'a, 'b> {
    pub(super) io: &'a mut Io<'b>,
    /// The datagram that is being looked at.
    pub(super) came: Option<Came>,
    pub(super) is_out: bool,
    /// The router began so short a time ago that the wire may hold copies of what its last incarnation took.
    pub(super) is_young: bool,
    pub(super) undelivered: &'a mut Vec<Head>,
}

impl<'a, 'b> Watch<'a, 'b> {
    /// Of the sending half.
    pub(super) fn out(io: &'a mut Io<'b>, undelivered: &'a mut Vec<Head>) -> Self {
        Self { io, came: None, is_out: true, is_young: false, undelivered }
    }
}

impl Report for Watch<'_, '_> {
    fn lost(&mut self, peer: Option<NodeIndex>, head: &Head, _body: &[u8], cause: Cause) {
        let io = &mut *self.io;
        io.oracle.saw(cause.word());
        io.line(|| format!("{}: from or to {peer:?}, {head:?}", cause.word()));
        if cause == Cause::Late && io.plan.is_in_order() {
            io.oracle.broken(io.now, Promise::Order, format!("late, and nothing was reordered: {head:?}"));
        }
        if cause == Cause::Late && self.came.is_some_and(|came| came.is_newest) {
            io.oracle.broken(io.now, Promise::Rejection, format!("late, and nothing newer came: {head:?}"));
        }
        let number = if self.is_out {
            io.oracle.lost_before(io.now, io.life, head, cause)
        } else {
            io.oracle.lost_behind(io.now, io.life, head)
        };
        let role = number.map(|number| io.oracle.packages[number as usize].role);
        if cause == Cause::ForeignName && matches!(role, Some(Role::Held { .. })) {
            io.oracle.saw("a holder is refused");
        }
        // One that was handed out before may have been delivered then; so may the copy that a router finds on the wire
        // when it begins.
        let is_first = !head.options.has(Options::REDELIVERED) && (self.is_out || !self.is_young);
        // Of these the caller's next try comes through, or brings another answer.
        let is_final = !matches!(cause, Cause::Socket | Cause::Late | Cause::Incomplete);
        let is_known = matches!(head.kind.kind(), Kind::Command(_)) && is_first && is_final;
        match number {
            Some(number) if self.is_out && is_known => io.host.returned.push(number),
            Some(_) if is_known => self.undelivered.push(*head),
            _ => {}
        }
    }
}

impl Deliver for Watch<'_, '_> {
    fn deliver(&mut self, from: NodeIndex, head: &Head, body: &[u8]) -> Result<(), NotDelivered> {
        let io = &mut *self.io;
        let Some(number) = io.oracle.arrives(io.now, io.node, head, body) else { return Ok(()) };
        let taken = io.host.deliver(head.to, number);
        io.line(|| format!("delivers {number} from {from}: {taken:?}"));
        taken.map_err(|closed| match closed {
            Closed::Absent => NotDelivered::NoMailbox,
            Closed::Full => NotDelivered::MailboxFull,
        })?;
        io.oracle.saw("delivered");
        if self.came.is_some_and(|came| io.now.monotonic_ns.saturating_sub(came.at_ns) > SOCKET_MAX_NS) {
            io.oracle.broken(
                io.now,
                Promise::Fresh,
                format!("package {number} waited in the socket, and is delivered"),
            );
        }
        let incarnation = self.came.map_or(0, |came| came.incarnation);
        io.oracle.delivered(io.now, (incarnation, io.life), number, head.options.has(Options::REDELIVERED));
        Ok(())
    }

    fn event(&mut self, event: RouterEvent) {
        self.io.line(|| format!("{event:?}"));
    }
}

/// What missed its slot leaves soon, or is lost.
pub(super) fn still_fresh(io: &mut Io<'_>, since_ns: u64) {
    if io.now.monotonic_ns - since_ns > HELD_NS_MAX {
        io.oracle.broken(io.now, Promise::Fresh, format!("a datagram leaves that was made at {since_ns} ns"));
    }
}
