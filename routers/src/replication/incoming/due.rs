//! What is due with time: requests for parts that are missing, and the end of what nothing comes of any more.

use super::super::requests::OutgoingRequest;
use super::{IncomingReplica, NEWER, Now, OLDER};
use crate::frame::PartRequest;

impl IncomingReplica {
    /// Does what is due with time. Says whether something is waited for.
    pub(in crate::replication) fn poll(&mut self, now: Now<'_>) -> bool {
        let deadline_ns = self.settings.deadline_ns;
        if self.open[OLDER].is_open() {
            let holds_up = self.open[NEWER].is_whole() && now.ns.saturating_sub(self.whole_ns) >= self.answer_time.ns();
            if holds_up || self.open[OLDER].is_given_up(now.ns, deadline_ns) {
                self.give_up(OLDER);
                self.publish_if_whole(now);
            }
        }
        [OLDER, NEWER].into_iter().for_each(|at| self.ask_if_due(now.ns, at));
        self.waits(now.ns)
    }

    /// Whether something is due with time.
    pub(in crate::replication) fn waits(&self, now_ns: u64) -> bool {
        let [older, newer] = &self.open;
        let may_ask = newer.is_open() && !newer.is_given_up(now_ns, self.settings.deadline_ns);
        self.requests.is_some() && (older.is_open() || may_ask)
    }

    /// Asks for what is missing of an open record, if it is time.
    pub(super) fn ask_if_due(&mut self, now_ns: u64, at: usize) {
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
