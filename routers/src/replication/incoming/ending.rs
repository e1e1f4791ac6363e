//! How what is open ends: published, or given up.

use super::super::answer_time::Unanswered;
use super::super::counts::ReplicaLoss;
use super::super::gathering::Life;
use super::{IncomingReplica, NEWER, Now, OLDER};

impl IncomingReplica {
    /// A third record begins: the older is given up, and the newer is the older one from now on.
    pub(super) fn make_room(&mut self, now: Now<'_>) {
        self.give_up(OLDER);
        if self.open[NEWER].is_whole() {
            self.publish(now, NEWER);
        } else if self.requests.is_some() {
            self.open.swap(OLDER, NEWER);
            self.open[OLDER].is_passed();
            if self.open[OLDER].is_given_up(now.ns, self.settings.deadline_ns) {
                self.give_up(OLDER);
            }
        } else {
            self.give_up(NEWER);
        }
    }

    /// Nothing is waited for any more.
    pub(super) fn settle(&mut self, now: Now<'_>) {
        self.give_up(OLDER);
        self.publish_if_whole(now);
        self.give_up(NEWER);
    }

    /// Nothing is waited for before the newer one.
    pub(super) fn publish_if_whole(&mut self, now: Now<'_>) {
        if self.open[NEWER].is_whole() {
            self.publish(now, NEWER);
        }
    }

    /// A part came too late. If it was asked for, that says how long an answer takes.
    pub(super) fn late(&mut self, now_ns: u64, life: Life, sequence: u64) -> Option<usize> {
        self.lose(ReplicaLoss::Late);
        if let Some(unanswered) = self.unanswered.take_if(|it| (it.life, it.sequence) == (life, sequence)) {
            self.answer_time.answered(now_ns.saturating_sub(unanswered.asked_ns), unanswered.requests);
        }
        None
    }

    /// Makes a record that is whole the newest of the ring.
    pub(super) fn publish(&mut self, now: Now<'_>, at: usize) {
        let open = &mut self.open[at];
        let (Some(arriving), Some(writer)) = (open.arriving, &mut self.writer) else { return open.close() };
        let (record, next) = (arriving.record, writer.next());
        open.close();
        let before = self.sampled.filter(|_| self.life == Some(open.life));
        let sampled = before.map_or(0, |before| arriving.sampled.wrapping_sub(before));
        if let Err(why) = writer.finish(record.sequence, sampled.into()) {
            self.tell(&why.to_string());
            return self.lose(ReplicaLoss::Unwritable);
        }
        let (open, counts) = (&self.open[at], &*self.counts);
        counts.gaps.add(record.sequence.saturating_sub(next));
        counts.records.add(1);
        counts.bytes.add(record.len_bytes as u64);
        counts.completed.add(open.was_asked().into());
        (self.life, self.sampled) = (Some(open.life), Some(arriving.sampled));
        self.delays.note(now.ns, &(now.system)(), &arriving, (&self.settings, counts));
    }

    /// Gives up what is open at a place: it is left out.
    pub(super) fn give_up(&mut self, at: usize) {
        let open = &mut self.open[at];
        if open.is_open() {
            self.writer.iter_mut().for_each(|writer| writer.give_up(open.sequence));
            open.close();
            let (life, sequence) = (open.life, open.sequence);
            self.given_up = Some((life, sequence));
            if let Some((asked_ns, requests)) = open.asked_in_vain() {
                let given_up = Unanswered { life, sequence, asked_ns, requests };
                // One at a time: else of many that are lost none would ever be answered.
                let waits = self.unanswered.as_ref().is_some_and(|it| it.is_awaited(asked_ns));
                self.unanswered = if waits { self.unanswered.take() } else { Some(given_up) };
            }
            self.lose(ReplicaLoss::Incomplete);
        }
    }
}
