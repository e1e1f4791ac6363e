//! A clock as a slave: it asks the master after each Sync, and slews its page's line to the result.

use super::{Clock, Draft, EXCHANGE_NS_MIN, PendingExchange, rate_of};
use crate::frame::FrameHead;
use crate::time::clock_model::{EVEN_PPB, wander_ns_s};
use crate::time::election::{ElectionState, Followed, SyncOutcome};
use crate::time::history::{Estimate, OffsetSample};
use crate::time::message::{Reply, Request, Sync};
use crate::time::{Exchanges, Ignored, RATE_MAX_PPB, STEP_MIN_NS, Stamp};

/// Samples that a slave needs before it trusts them, and before it is content.
const SAMPLES_MIN: u32 = 4;
const SAMPLES_EAGER: u32 = 8;
/// A slave answers a Sync at most this late, in time slots a cycle if that is longer: meanwhile its clock drifts from
/// the master's.
const ANSWER_NS_MAX: u64 = 50_000_000;
/// A slave corrects its offset within this time, or four exchanges.
const SERVO_NS_MIN: u64 = 250_000_000;
/// The stated growth of the bound holds for this long, and at least for four intervals; then a greater one is stated.
const HORIZON_NS_MIN: u64 = 2_000_000_000;

impl Clock {
    pub(super) fn sync(&mut self, now_ns: u64, received: Stamp, head: &FrameHead, sync: &Sync) -> Result<(), Ignored> {
        if sync.replacement {
            return self.replaced(received, head, sync);
        }
        let is_contested = self.is_contested(received.ns);
        let was_master = matches!(self.election.state(), ElectionState::Master(_));
        let followed = self.is_followed(now_ns);
        let heard = self.election.sync(head.from, head.incarnation, sync, received.ns, followed);
        match heard {
            SyncOutcome::Ignored => {
                self.keep_term();
                self.answer_master(now_ns, head.from);
                return Err(Ignored::Late);
            }
            SyncOutcome::Turned => {
                self.line.stop_slew(now_ns);
                self.forget();
                if was_master {
                    self.drafts.clear();
                }
            }
            // The same master under a later term: the timeline continues.
            SyncOutcome::Followed if self.timeline == sync.began => self.term = sync.term,
            SyncOutcome::Followed => {}
        }
        self.heard_in_slots(received, sync, heard == SyncOutcome::Turned && is_contested, heard == SyncOutcome::Turned);
        let pauses = received.ns.saturating_sub(self.asked_ns) < self.pause_ns();
        if pauses || now_ns.saturating_sub(received.ns) > self.answer_ns_max() {
            return Ok(());
        }
        self.asked_ns = received.ns;
        self.asked.rotate_right(1);
        self.asked[0] = PendingExchange { id: sync.id, sync_came: received, ..PendingExchange::default() };
        // The newest question is enough when several Syncs came at once.
        self.drafts.clear();
        self.drafts.push_back((head.from, Draft::WarmUp));
        self.drafts.push_back((head.from, Draft::Request { id: sync.id }));
        Ok(())
    }

    pub(super) fn reply(
        &mut self,
        now_ns: u64,
        received: Stamp,
        head: &FrameHead,
        reply: &Reply,
    ) -> Result<(), Ignored> {
        let ElectionState::Slave(master) = self.election.state() else { return Err(Ignored::Unasked) };
        if (head.from, head.incarnation, reply.began) != (master.node, master.incarnation, master.began) {
            return Err(Ignored::Unasked);
        }
        let mut asked = self.asked.iter_mut();
        let asked = asked.find(|asked| asked.id == reply.id && asked.request_sent_ns != 0);
        let asked = asked.map(std::mem::take).ok_or(Ignored::Unasked)?;
        self.election.reply(reply.epoch, reply.error_ns, received.ns);
        self.hears(head.from, head.incarnation, received.ns);
        let sample = sample(&asked, reply).ok_or(Ignored::NegativeDelay)?;
        let stamped = [reply.sync_by_kernel, reply.request_by_kernel];
        let by_kernel = stamped == [true; 2] && asked.sync_came.by_kernel && asked.request_left.by_kernel;
        self.exchanges = Exchanges { count: self.exchanges.count + 1, by_kernel };
        self.history.add(sample);
        if self.history.samples() >= SAMPLES_MIN {
            self.scheduler(now_ns, sample);
        }
        Ok(())
    }

    /// The servo: from the measurement to the target of the line.
    pub(super) fn scheduler(&mut self, now_ns: u64, newest: OffsetSample) {
        let ElectionState::Slave(master) = self.election.state() else { return };
        let Some(estimate) = self.history.estimate(now_ns, self.usual_rate) else {
            self.forget();
            self.history.add(newest);
            return;
        };
        self.usual_rate = estimate.rate;
        if self.slots.is_some() {
            self.history.fades(estimate.rate_high - estimate.rate_low);
        }
        let pace_ppb = EVEN_PPB.saturating_add_signed((estimate.rate * 1e9).round() as i64);
        let drift_ns_s = self.drift_ns_s(&estimate, pace_ppb);
        let target_ns = now_ns.saturating_add_signed(estimate.offset_ns);
        let epoch = self.line.record().epoch;
        let by_ns = target_ns.wrapping_sub(self.line.at(now_ns).ns).cast_signed();
        if master.epoch > epoch {
            let error_ns = self.bound_ns(&estimate, estimate.offset_ns, &master);
            self.line.step(now_ns, master.epoch, target_ns, pace_ppb, error_ns, drift_ns_s);
        } else if master.epoch < epoch || by_ns.unsigned_abs() > STEP_MIN_NS {
            self.far = true;
            self.slots.iter_mut().for_each(|slots| slots.unsure = true);
            return;
        } else {
            let page_ns = self.line.at(now_ns).ns.wrapping_sub(now_ns).cast_signed();
            let target_error_ns = self.bound_ns(&estimate, estimate.offset_ns, &master);
            let error_ns = self.bound_ns(&estimate, page_ns, &master).max(target_error_ns);
            let within_ns = self.exchange_ns.saturating_mul(4).max(SERVO_NS_MIN);
            self.line.bend(now_ns, by_ns, within_ns, pace_ppb, error_ns, drift_ns_s);
        }
        (self.term, self.timeline, self.far, self.offset_ns) = (master.term, master.began, false, by_ns);
        self.stated = (now_ns.saturating_add(self.horizon_ns()), self.horizon_ns());
        self.slots.iter_mut().for_each(|slots| slots.goes_by(master.error_ns));
    }

    /// The shortest pause between two questions.
    fn pause_ns(&self) -> u64 {
        let is_eager = self.history.samples() < SAMPLES_EAGER;
        match &self.slots {
            None => self.exchange_ns.min(EXCHANGE_NS_MIN) / 2,
            // The newest Sync is the one to ask after, as long as no slot came to ask in.
            Some(_) if is_eager || self.has_question() => 0,
            Some(_) => EXCHANGE_NS_MIN.saturating_sub(self.interval_ns / 2),
        }
    }

    /// In time slots the thread may read a Sync as late as before this node's own slot, and asks in that slot.
    fn answer_ns_max(&self) -> u64 {
        if self.slots.is_some() { ANSWER_NS_MAX.max(self.interval_ns) } else { ANSWER_NS_MAX }
    }

    fn has_question(&self) -> bool {
        self.drafts.iter().any(|(_, draft)| matches!(draft, Draft::Request { id: 1.. }))
    }

    /// Error bound of a line that is `offset_ns` from the local clock now.
    pub(super) fn bound_ns(&self, estimate: &Estimate, offset_ns: i64, master: &Followed) -> u64 {
        let (above, below) = (estimate.high_ns.saturating_sub(offset_ns), offset_ns.saturating_sub(estimate.low_ns));
        let off_ns = above.max(below).unsigned_abs();
        off_ns.saturating_add(master.error_ns)
    }

    /// Growth of the bound until the horizon, ns a second.
    pub(super) fn drift_ns_s(&self, estimate: &Estimate, pace_ppb: u64) -> u64 {
        let pace = rate_of(pace_ppb);
        let off = (pace - estimate.rate_low).max(estimate.rate_high - pace).max(0.0);
        (off * 1e9).ceil() as u64 + wander_ns_s(self.horizon_ns()) + 1
    }

    pub(super) fn horizon_ns(&self) -> u64 {
        self.interval_ns.saturating_mul(4).max(HORIZON_NS_MIN)
    }

    /// Without a master for longer than the horizon, the rate may have changed more: the bound grows faster.
    pub(super) fn keep_bound(&mut self, now_ns: u64) {
        let (until_ns, span_ns) = self.stated;
        if until_ns <= now_ns && self.is_held_over() {
            let record = self.line.record();
            let drift_ns_s = record.drift_ns_s.saturating_add(wander_ns_s(span_ns));
            self.line.restate(record.error_ns, drift_ns_s.min(2 * RATE_MAX_PPB.unsigned_abs()));
            self.stated = (now_ns.saturating_add(span_ns), span_ns.saturating_mul(2));
        }
    }

    pub(super) fn is_held_over(&self) -> bool {
        let is_master = matches!(self.election.state(), ElectionState::Master(_));
        let at_most = self.line.record().drift_ns_s >= 2 * RATE_MAX_PPB.unsigned_abs();
        self.line.is_synchronised() && !is_master && !at_most
    }

    pub(super) fn write_request(&mut self, now_ns: u64, id: u64, sequence: u64) -> Option<Request> {
        if id != 0 {
            let asked = self.asked.iter_mut().find(|asked| asked.id == id)?;
            asked.sequence = sequence;
            (asked.request_sent_ns, asked.request_left) = (now_ns, Stamp::by_us(now_ns));
        }
        let told = if id == 0 { self.sure(now_ns) } else { None };
        Some(Request {
            id,
            sent_ns: told.map_or(0, |own| own.system_ns(now_ns)),
            error_ns: told.map_or_else(|| self.line.error_ns(now_ns), |own| own.bound_ns(now_ns)),
            epoch: self.line.record().epoch,
            term: self.term,
            eager: self.history.samples() < SAMPLES_EAGER,
            far: self.far,
            timed: if self.slots.is_some() { told.is_some() } else { self.line.is_synchronised() },
        })
    }
}

/// The interval that an exchange leaves for `system − local` when the Request left. None when the frames took negative
/// time.
fn sample(asked: &PendingExchange, reply: &Reply) -> Option<OffsetSample> {
    let PendingExchange { sync_came, request_left, .. } = asked;
    let (came_ns, left_ns) = (sync_came.ns, request_left.ns);
    let waited_ns = left_ns.checked_sub(came_ns)?;
    let low_ns = reply.sync_ns.wrapping_sub(came_ns).cast_signed();
    let high_ns = reply.request_ns.wrapping_sub(left_ns).cast_signed();
    if high_ns <= low_ns {
        return None;
    }
    // Between both stamps of this node its clock drifted; the master's are whole numbers.
    let drifted_ns = u128::from(waited_ns) * RATE_MAX_PPB as u128 / 1_000_000_000;
    let doubt_ns = u64::from(sync_came.doubt_ns.max(request_left.doubt_ns)) + u64::from(reply.doubt_ns);
    let doubt_ns = doubt_ns.saturating_add(drifted_ns as u64).saturating_add(2).cast_signed();
    Some(OffsetSample {
        local_ns: left_ns,
        low_ns: low_ns.saturating_sub(doubt_ns),
        high_ns: high_ns.saturating_add(doubt_ns),
    })
}
