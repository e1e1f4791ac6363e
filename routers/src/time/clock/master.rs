//! A clock as a master: it states the time, and answers when frames left and came.

use super::{Clock, Draft, Left, Slave};
use crate::frame::NodeIndex;
use crate::time::clock_model::EVEN_PPB;
use crate::time::election::{ElectionState, Origin};
use crate::time::message::{Reply, Request, Sync};
use crate::time::{Ignored, Stamp, Term};

/// Pause while a slave has too few samples.
const EAGER_NS: u64 = 20_000_000;
/// A master begins at most one epoch in this time.
const EPOCH_NS_MIN: u64 = 10_000_000_000;

impl Clock {
    pub(super) fn request(&mut self, received: Stamp, from: NodeIndex, request: &Request) -> Result<(), Ignored> {
        if request.id == 0 {
            self.election.hello(request, received.ns);
            self.keep_term();
            self.hello_in_slots(received, request);
            // A node that asks for a master gets its time at once.
            if matches!(self.election.state(), ElectionState::Master(_)) {
                self.slaves[usize::from(from)].next_ns = 0;
            }
            return Ok(());
        }
        let is_asked = self.slaves[usize::from(from)].syncs.iter().any(|left| left.id == request.id);
        if !is_asked || !matches!(self.election.state(), ElectionState::Master(_)) {
            return Err(Ignored::Unasked);
        }
        // It may come from a part of the network with a later term, and with a time that must not go back.
        self.election.is_told(request);
        self.keep_term();
        let slave = &mut self.slaves[usize::from(from)];
        if slave.answered_ns.is_none() || (request.eager && !slave.eager) {
            slave.next_ns = 0;
        }
        (slave.answered_ns, slave.eager) = (Some(received.ns), request.eager);
        if request.far {
            self.begin_epoch(received.ns, request.epoch);
        }
        let reply = Draft::Reply { id: request.id, came: received };
        let waits = |(to, draft): &(NodeIndex, Draft)| *to == from && matches!(draft, Draft::Reply { .. });
        let waiting = self.slots.as_ref().and_then(|_| self.drafts.iter().position(waits));
        // In time slots one answer per node is enough, however many questions came before the window. It keeps its
        // place: else a node that asks again and again would never be answered where not all answers fit.
        if let Some(at) = waiting {
            self.drafts[at] = (from, reply);
        } else if self.drafts.len() < self.drafts.capacity() {
            self.drafts.push_back((from, reply));
        }
        Ok(())
    }

    /// This node is master from now on. Its own time continues, or the one that it heard; else the first epoch begins
    /// by its wall clock.
    pub(super) fn become_master(&mut self, now_ns: u64, term: Term, origin: Origin) {
        self.line.stop_slew(now_ns);
        if origin == Origin::Heard {
            self.take_up_heard(now_ns);
        }
        if self.line.is_synchronised() {
            self.line.become_reference(now_ns);
        } else {
            let epoch = self.line.record().epoch.max(self.election.highest_epoch()).saturating_add(1);
            let system_ns = self.line.at(now_ns).ns;
            self.line.step(now_ns, epoch, system_ns, EVEN_PPB, 0, 0);
        }
        self.forget();
        self.drafts.clear();
        (self.term, self.began, self.timeline) = (term, term, term);
        (self.offset_ns, self.far, self.epoch_began_ns) = (0, false, 0);
        self.slaves.iter_mut().for_each(|slave| *slave = Slave { next_ns: now_ns, ..Slave::default() });
        let error_ns = self.line.record().error_ns;
        if let Some(slots) = &mut self.slots {
            slots.become_master(error_ns, origin);
        }
    }

    /// A master's own term may have been raised: its timeline continues.
    pub(super) fn keep_term(&mut self) {
        if let ElectionState::Master(term) = self.election.state() {
            self.term = term;
        }
    }

    /// Another master must yield and does not know of this one: it gets a Sync soon.
    pub(super) fn answer_master(&mut self, now_ns: u64, other: NodeIndex) {
        if matches!(self.election.state(), ElectionState::Master(_)) {
            let soon_ns = now_ns.saturating_add(self.exchange_ns);
            let slave = &mut self.slaves[usize::from(other)];
            slave.next_ns = slave.next_ns.min(soon_ns);
        }
    }

    /// A node is too far off to slew, or has seen a later epoch.
    pub(super) fn begin_epoch(&mut self, now_ns: u64, theirs: u64) {
        let own = self.line.record().epoch;
        let pause_ns = EPOCH_NS_MIN.max(self.interval_ns);
        let pauses = self.epoch_began_ns != 0 && now_ns.saturating_sub(self.epoch_began_ns) < pause_ns;
        if theirs >= own && !pauses {
            self.line.rename(theirs.saturating_add(1));
            self.epoch_began_ns = now_ns;
        }
    }

    /// A new epoch begins at this computer's clock, which was set, and a term with it: to others it is another time, of
    /// which they have measured nothing. In time slots it begins a whole number of cycles away, so that the windows
    /// stay where others expect them. False: this node is not the master.
    pub fn begin_time(&mut self, now_ns: u64, wall_ns: u64) -> bool {
        if !matches!(self.election.state(), ElectionState::Master(_)) {
            return false;
        }
        self.line.stop_slew(now_ns);
        let own_ns = self.line.at(now_ns).ns;
        let cycle_ns = if self.slots.is_some() { i128::from(self.interval_ns) } else { 1 };
        let by_ns = (i128::from(wall_ns) - i128::from(own_ns)) / cycle_ns * cycle_ns;
        let system_ns = u64::try_from(i128::from(own_ns) + by_ns).unwrap_or(own_ns);
        let epoch = self.line.record().epoch.max(self.election.highest_epoch()).saturating_add(1);
        let Some(term) = self.election.succeeds() else { return false };
        self.line.step(now_ns, epoch, system_ns, self.line.record().pace_ppb, 0, 0);
        self.become_master(now_ns, term, Origin::Own);
        true
    }

    pub(super) fn is_followed(&self, now_ns: u64) -> bool {
        self.slaves.iter().any(|slave| self.answers(slave, now_ns))
    }

    pub(super) fn answers(&self, slave: &Slave, now_ns: u64) -> bool {
        // In time slots a slave asks in its own slots alone.
        let asks_ns = self.slots.as_ref().map_or(self.interval_ns, |slots| slots.settings.slot_every_ns);
        let recently_ns = asks_ns.max(EAGER_NS).saturating_mul(4);
        slave.answered_ns.is_some_and(|answered| now_ns.saturating_sub(answered) < recently_ns)
    }

    pub(super) fn draft_sync(&mut self, now_ns: u64, node: NodeIndex) {
        let slave = &self.slaves[usize::from(node)];
        let answers = self.answers(slave, now_ns);
        let every_ns = match answers {
            // The node may not exist.
            false => self.interval_ns,
            true if slave.eager => self.exchange_ns.min(EAGER_NS),
            true => self.exchange_ns,
        };
        // In step with system time, so that the next master continues in step; slaves one after the other.
        let system_ns = self.line.at(now_ns).ns;
        let shift_ns = every_ns / u64::from(self.settings.nodes) * u64::from(node);
        let nominal_ns = system_ns.saturating_sub(shift_ns) / every_ns * every_ns + shift_ns;
        let next_ns = now_ns + (nominal_ns + every_ns).saturating_sub(system_ns).clamp(every_ns / 4, 2 * every_ns);
        self.slaves[usize::from(node)].next_ns = next_ns;
        if answers {
            self.drafts.push_back((node, Draft::WarmUp));
        }
        self.drafts.push_back((node, Draft::Sync { nominal_ns }));
    }

    pub(super) fn write_sync(&mut self, now_ns: u64, to: NodeIndex, nominal_ns: u64, sequence: u64) -> Option<Sync> {
        let ElectionState::Master(term) = self.election.state() else { return None };
        self.last_id += 1;
        let (id, at) = (self.last_id, Stamp::by_us(now_ns));
        let syncs = &mut self.slaves[usize::from(to)].syncs;
        syncs.rotate_right(1);
        syncs[0] = Left { id, sequence, at };
        let (epoch, error_ns) = (self.line.record().epoch, self.line.error_ns(now_ns));
        let cycle = nominal_ns / self.interval_ns;
        let (sent_ns, began, followed) = (self.line.at(now_ns).ns, self.began, self.is_followed(now_ns));
        let replacement = false;
        Some(Sync { id, cycle, nominal_ns, sent_ns, error_ns, epoch, term, began, followed, replacement })
    }

    pub(super) fn write_reply(&mut self, now_ns: u64, to: NodeIndex, id: u64, came: Stamp) -> Option<Reply> {
        let ElectionState::Master(term) = self.election.state() else { return None };
        let left = self.slaves[usize::from(to)].syncs.iter().find(|left| left.id == id)?.at;
        Some(Reply {
            id,
            sync_ns: self.line.at(left.ns).ns,
            request_ns: self.line.at(came.ns).ns,
            sent_ns: self.line.at(now_ns).ns,
            error_ns: self.line.error_ns(now_ns),
            epoch: self.line.record().epoch,
            term,
            began: self.began,
            doubt_ns: left.doubt_ns.max(came.doubt_ns),
            sync_by_kernel: left.by_kernel,
            request_by_kernel: came.by_kernel,
        })
    }
}
