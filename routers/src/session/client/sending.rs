//! What goes to the server: packages, questions for the time, and what becomes of each.

use super::{Client, ClientHost, ClientPackage, ClientState, Registration};
use crate::admission::capped;
use crate::queue::QueueShare;
use crate::report::NotDelivered;
use crate::session::WAIT_MAX_NS;
use crate::session::counts::Cause;
use crate::session::frame::{Carried, Ranges, SessionMessage};
use crate::session::ledger::Ledger;
use crate::session::outgoing::{Fates, Outgoing, Parcel, add_part, is_stale};
use rohrpost_mailbox::{Name, Priority};

impl Client {
    /// A package is to go to the server.
    pub fn send(&mut self, now_ns: u64, package: &ClientPackage<'_>, host: &mut impl ClientHost) {
        let head = capped(&package.head);
        self.out.came(head.priority);
        let is_long_down = !self.is_up() && now_ns.saturating_sub(self.down_ns) > WAIT_MAX_NS;
        let lost = is_long_down.then_some(Cause::Offline);
        let lost = lost.or_else(|| is_stale(now_ns, package.published_ns).then_some(Cause::Stale));
        let shift_ns = self.shift_ns(now_ns).filter(|_| !self.is_blocked);
        let level = self.settings.levels[usize::from(head.priority.0)];
        self.with_ledger(now_ns, host, |outgoing, ledger| match lost {
            Some(cause) => ledger.lost(&head, package.body, cause),
            None => {
                let ClientPackage { body, published_ns, hops, .. } = *package;
                // Of the node's modules each has its part of memory. Which goes first is for their importance to say.
                let share = QueueShare { sender: head.from.with_local(0).raw(), party: 0 };
                outgoing.accept(shift_ns, &Parcel { head: &head, body, published_ns, hops, level, share }, ledger);
            }
        });
    }

    /// A package for all systems came to its own system without the server, or was lost here. That nobody has its
    /// mailbox open is a loss only where this client hosts the name: the server counts on it then, and says nothing.
    pub fn reached_itself(&mut self, to: Name, priority: Priority, delivered: Result<(), NotDelivered>) {
        let hosts = self.ranges.iter().any(|range| range.has(to));
        if delivered == Err(NotDelivered::NoMailbox) && !hosts {
            return;
        }
        self.out.came(priority);
        match delivered {
            Ok(()) => self.out.passed(priority),
            Err(why) => self.out.lost(priority, why.into()),
        }
    }

    /// From our clock to the server's session clock, as long as packages may leave: to the earliest that it may be
    /// there, so that no package looks younger than it is.
    fn shift_ns(&self, now_ns: u64) -> Option<i64> {
        let session = self.estimate.session(now_ns).filter(|_| self.is_up())?;
        let earliest_ns = session.ns.saturating_sub(session.error_ns);
        Some((i128::from(earliest_ns) - i128::from(now_ns)).clamp(i64::MIN.into(), i64::MAX.into()) as i64)
    }

    /// Asks for the time, also while the stream takes nothing: packages that have not begun to leave go behind the
    /// question.
    pub(super) fn ask(&mut self, now_ns: u64) {
        if self.state == ClientState::Member && self.asking.is_due(now_ns) {
            let end = self.outgoing.hurry(&SessionMessage::Ask(now_ns));
            self.asking.asks(now_ns, end);
        }
    }

    pub(super) fn refill(&mut self, now_ns: u64, host: &mut impl ClientHost) {
        if self.state != ClientState::Member || !self.outgoing.ready().is_empty() {
            return;
        }
        if matches!(self.registration, Registration::Due(at_ns) if now_ns >= at_ns) {
            self.number = self.number.wrapping_add(1);
            self.registration = Registration::Asked;
            let mut bytes = Vec::new();
            self.outgoing.say(&SessionMessage::Register(Ranges::new(self.number, &self.ranges, &mut bytes)));
        }
        if let Some(shift_ns) = self.shift_ns(now_ns) {
            self.with_ledger(now_ns, host, |outgoing, ledger| outgoing.refill(now_ns, shift_ns, ledger));
        }
    }

    /// Parts of replicas may leave and come from now on, or not any more.
    pub(super) fn set_line(&mut self, now_ns: u64, is_there: bool, host: &mut impl ClientHost) {
        let was_there = std::mem::replace(&mut self.has_line, is_there);
        let Some(replicas) = host.replicas().filter(|_| was_there != is_there) else { return };
        let server = replicas.server();
        if is_there { replicas.came(now_ns, server) } else { replicas.left(now_ns, server) }
    }

    /// Makes the next part of a replica ready, if nothing else is, and no packages go first. Those of a node are of one
    /// party.
    pub(super) fn add_part(&mut self, now_ns: u64, host: &mut impl ClientHost) {
        self.has_parts = false;
        let Some(server) = host.replicas().map(|replicas| replicas.server()).filter(|_| self.is_up()) else { return };
        (_, self.has_parts) = add_part(&mut self.outgoing, now_ns, (server, 0), host);
    }

    /// Does something with what leaves, and answers the commands of this end that are lost thereby.
    pub(super) fn with_ledger<H: ClientHost>(
        &mut self,
        now_ns: u64,
        host: &mut H,
        work: impl FnOnce(&mut Outgoing, &mut Ledger<'_, H>),
    ) {
        let mut ledger = Ledger::new(&self.out, &mut *host, None);
        work(&mut self.outgoing, &mut ledger);
        for (head, body) in ledger.into_answers() {
            // A sender that has gone, or takes no more answers, waits for its timeout.
            let _ = host.deliver(&Carried { hops: 0, published_ns: now_ns, head, body: &body });
        }
    }
}
