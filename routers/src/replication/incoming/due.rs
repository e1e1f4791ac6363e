//! What is due with time: requests for parts that are missing, and the end of what nothing comes of any more.

use super::super::gathering::Gathering;
use super::super::requests::OutgoingRequest;
use super::{IncomingReplica, Now};
use crate::frame::PartRequest;

impl IncomingReplica {
    /// Does what is due with time. Says whether something is waited for.
    pub(in crate::replication) fn poll(&mut self, now: Now<'_>) -> bool {
        while self.open.len() > 1 && self.is_waited_for_no_more(now.ns) {
            self.give_up_oldest();
            self.publish_whole(now);
        }
        self.ask_if_due(now.ns);
        self.waits(now.ns)
    }

    /// Whether the oldest record is given up: nothing came of it for long, or a newer one that is whole has waited for
    /// as long as an answer takes.
    fn is_waited_for_no_more(&self, now_ns: u64) -> bool {
        let answer_ns = self.answer_time.ns();
        let holds_up = self.open.iter().any(|open| open.has_waited(now_ns, answer_ns));
        holds_up || self.open.first().is_some_and(|oldest| oldest.is_given_up(now_ns, self.settings.deadline_ns))
    }

    /// Whether something is due with time.
    pub(in crate::replication) fn waits(&self, now_ns: u64) -> bool {
        let may_ask = |newest: &Gathering| !newest.is_given_up(now_ns, self.settings.deadline_ns);
        self.requests.is_some() && (self.open.len() > 1 || self.open.last().is_some_and(may_ask))
    }

    /// Asks for what is missing of open records, the oldest first, if it is time.
    pub(super) fn ask_if_due(&mut self, now_ns: u64) {
        (0..self.open.len()).for_each(|at| self.ask_for(now_ns, at));
    }

    fn ask_for(&mut self, now_ns: u64, at: usize) {
        let (Some(requests), open) = (&mut self.requests, &mut self.open[at]) else { return };
        if !open.is_due(now_ns, (self.settings.deadline_ns, self.answer_time.ns())) {
            return;
        }
        let mut last = None;
        for (first, parts) in open.missing() {
            let request = PartRequest {
                place: self.place,
                generation: open.life.generation,
                first: first as u32,
                router: open.life.router,
                sequence: open.sequence,
                parts,
            };
            let to = OutgoingRequest { to: self.settings.node, request };
            // What leaves is counted, and this thread alone fills the ring.
            if requests.is_full() || !self.answer_time.may_ask(now_ns) || requests.push(to).is_err() {
                break;
            }
            self.counts.asked.add(parts.iter().map(|word| u64::from(word.count_ones())).sum());
            last = request.asked().last();
        }
        if let Some(last) = last {
            open.asked(now_ns, last);
            self.has_asked = true;
        }
    }
}
