//! A clock in time slots without time that hears unverified frames. They tell it when to ask, and delay a time of its
//! own; nothing else.

use super::Clock;
use super::other_tables::claim;
use crate::frame::{FrameHead, NodeIndex};
use crate::time::election::ElectionState;
use crate::time::message::TimeMessage;
use crate::time::unverified::TimeReport;
use crate::time::{Ignored, Stamp, TimeEstimate};

impl Clock {
    /// Whether unverified frames help: those for [`Clock::overhear`].
    pub fn overhears(&self, now_ns: u64) -> bool {
        let is_listening = || self.election.state() == ElectionState::Listening && self.sure(now_ns).is_none();
        self.slots.is_some() && (self.is_beginning() || is_listening())
    }

    /// Takes a datagram of time that some incarnation of its node sent at some time, to this node.
    ///
    /// # Errors
    /// [`Ignored`]: it changed nothing.
    pub fn overhear(&mut self, now_ns: u64, received: Stamp, head: &FrameHead, rest: &[u8]) -> Result<(), Ignored> {
        let is_other = head.digest != self.settings.digest;
        if !self.is_ours(&FrameHead { digest: self.settings.digest, ..*head }) {
            return Err(Ignored::Stranger);
        }
        if self.is_unsteady(now_ns) {
            return Err(Ignored::Unsteady);
        }
        let message = TimeMessage::parse(head.kind, rest)?;
        let theirs = claim(head, &message).filter(|_| is_other);
        if self.is_parted(now_ns) {
            if theirs.is_some() {
                self.others.overhears(head.from, received.ns, head.digest);
            }
            return Err(Ignored::OtherTable);
        }
        let told = match &message {
            TimeMessage::Sync(sync) if sync.replacement => None,
            TimeMessage::Sync(sync) => Some(TimeReport { epoch: sync.epoch, system_ns: sync.sent_ns, error_ns: 0 }),
            TimeMessage::Request(hello) if hello.id == 0 && hello.timed => {
                Some(TimeReport { epoch: hello.epoch, system_ns: hello.sent_ns, error_ns: hello.error_ns })
            }
            _ => return Err(Ignored::Unproven),
        };
        let is_wanted = self.overhears(now_ns);
        let slots = self.slots.as_mut().filter(|_| is_wanted).ok_or(Ignored::Unproven)?;
        let said = (head.from, head.incarnation, head.sequence);
        if !slots.overheard.hears(said, received.ns, told) {
            return Err(Ignored::Late);
        }
        let is_patient = slots.overheard.is_patient(now_ns);
        self.election.overhears(&slots.overheard);
        let yields = match (message, theirs) {
            (_, Some(theirs)) => theirs > self.claim(now_ns),
            (TimeMessage::Sync(sync), None) => self.election.would_yield(head.from, &sync, self.is_followed(now_ns)),
            _ => false,
        };
        if is_patient && self.is_beginning() && yields {
            self.step_back(now_ns);
        }
        Ok(())
    }

    /// No node follows this master yet, and another's time may be older: it listens again.
    pub(super) fn step_back(&mut self, now_ns: u64) {
        self.election.steps_back(now_ns);
        self.line.stop_slew(now_ns);
        self.forget();
        self.drafts.clear();
        if let Some(slots) = &mut self.slots {
            (slots.unsure, slots.beginning) = (true, 0);
        }
    }

    /// The peer to ask for a sign of life, and the time to use: none without enough frames. For hellos alone.
    pub fn overheard(&self, now_ns: u64) -> Option<(NodeIndex, TimeEstimate)> {
        let slots = self.slots.as_ref()?;
        let (delay_max_ns, allowance_ns) = (slots.settings.delay_max_ns, slots.settings.allowance_ns);
        slots.overheard.estimate(now_ns, delay_max_ns, allowance_ns)
    }

    /// A hello left by [`Self::overheard`]: the next uses another node's time, if there is one.
    pub fn asked_overheard(&mut self, now_ns: u64) {
        if let Some(slots) = &mut self.slots {
            let (delay_max_ns, allowance_ns) = (slots.settings.delay_max_ns, slots.settings.allowance_ns);
            slots.overheard.next_turn(now_ns, delay_max_ns, allowance_ns);
        }
    }
}
