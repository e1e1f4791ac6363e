//! How what is open ends: published, or given up.

use super::super::alarms::note_missing;
use super::super::answer_time::Unanswered;
use super::super::counts::ReplicaLoss;
use super::super::gathering::Life;
use super::{IncomingReplica, Now};

impl IncomingReplica {
    /// A newer record begins: nothing more comes of the others by itself. If there is no room beside them, the oldest
    /// is given up.
    pub(super) fn make_room(&mut self, now: Now<'_>) {
        if self.requests.is_none() {
            return self.cut();
        }
        if let Some(last) = self.open.last_mut() {
            last.is_passed();
        }
        let deadline_ns = self.settings.deadline_ns;
        while self.open.first().is_some_and(|oldest| oldest.is_given_up(now.ns, deadline_ns)) || !self.open.has_room() {
            self.give_up_oldest();
            self.publish_whole(now);
        }
    }

    /// Nothing is waited for any more.
    pub(super) fn settle(&mut self, now: Now<'_>) {
        self.end_through(now, u64::MAX);
    }

    /// Nothing is waited for of records up to this one: what is whole of them is published.
    pub(super) fn end_through(&mut self, now: Now<'_>, sequence: u64) {
        self.publish_whole(now);
        while self.open.first().is_some_and(|oldest| oldest.sequence <= sequence) {
            self.give_up_oldest();
            self.publish_whole(now);
        }
    }

    /// Publishes what is whole and waits for nothing older.
    pub(super) fn publish_whole(&mut self, now: Now<'_>) {
        self.publish_before(now, u64::MAX);
    }

    /// Publishes records before this one that are whole and wait for nothing older.
    pub(super) fn publish_before(&mut self, now: Now<'_>, sequence: u64) {
        while self.open.first().is_some_and(|oldest| oldest.is_whole() && oldest.sequence < sequence) {
            self.publish_oldest(now);
        }
    }

    /// A part came too late. If it was asked for, that says how long an answer takes.
    pub(super) fn late(&mut self, now_ns: u64, life: Life, sequence: u64) {
        self.lose(ReplicaLoss::Late);
        if let Some(unanswered) = self.unanswered.take_if(|it| (it.life, it.sequence) == (life, sequence)) {
            self.answer_time.answered(now_ns.saturating_sub(unanswered.asked_ns), unanswered.requests);
        }
    }

    /// Makes the oldest open record, which is whole, the newest of the ring.
    fn publish_oldest(&mut self, now: Now<'_>) {
        let Some(open) = self.open.pop_oldest() else { return };
        let (life, was_asked) = (open.life, open.was_asked());
        let (Some(arriving), Some(writer)) = (open.arriving, &mut self.writer) else { return };
        let (record, next) = (arriving.record, writer.next());
        let before = self.sampled.filter(|_| self.life == Some(life));
        let sampled = before.map_or(0, |before| arriving.sampled.wrapping_sub(before));
        if let Err(why) = writer.finish(record.sequence, sampled.into()) {
            self.tell(&why.to_string());
            return self.lose(ReplicaLoss::Unwritable);
        }
        let (counts, gap) = (&*self.counts, record.sequence.saturating_sub(next));
        counts.gaps.add(gap);
        counts.records.add(1);
        counts.bytes.add(record.len_bytes as u64);
        counts.completed.add(was_asked.into());
        (self.life, self.sampled) = (Some(life), Some(arriving.sampled));
        note_missing(&mut self.missing_told, now.ns, gap.saturating_sub(sampled.into()), &self.settings);
        self.delays.note(now.ns, &(now.system)(), &arriving, (&self.settings, counts));
    }

    /// Gives up the oldest record that is open: it is left out.
    pub(super) fn give_up_oldest(&mut self) {
        let Some(open) = self.open.pop_oldest() else { return };
        let (life, sequence) = (open.life, open.sequence);
        if let Some((asked_ns, requests)) = open.asked_in_vain() {
            let given_up = Unanswered { life, sequence, asked_ns, requests };
            // One at a time: else of many that are lost none would ever be answered.
            let waits = self.unanswered.as_ref().is_some_and(|it| it.is_awaited(asked_ns));
            self.unanswered = if waits { self.unanswered.take() } else { Some(given_up) };
        }
        self.writer.iter_mut().for_each(|writer| writer.give_up(sequence));
        self.given_up = Some((life, sequence));
        self.lose(ReplicaLoss::Incomplete);
    }
}
