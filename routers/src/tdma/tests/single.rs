//! One node, and a master made of plain messages: exact to the nanosecond.

use super::world::{CYCLE, MASTERS, SECOND, US, table, tdma};
use crate::frame::{FrameHead, FrameKind as Frame};
use crate::harness::{time_frame, time_settings};
use crate::tdma::{Carries, GATE_NS, LATE_NS, Next, Planned, Silent, SlotScheduler, WindowVerdict};
use crate::time::message::{Reply, Sync, TimeMessage};
use crate::time::{Allowed, Clock, Stamp, Step, TIME_BYTES, Term};

/// Its clock shows this much less than system time.
const OFFSET: u64 = 1_000 * SECOND;
const TERM: Term = Term(1 << 8 | 255);

/// Node 2, which hears node 0.
struct Lonely {
    clock: Clock,
    scheduler: SlotScheduler,
    now_ns: u64,
    cycle: u64,
    id: u64,
}

impl Lonely {
    fn new() -> Self {
        let settings = time_settings(2, &MASTERS, tdma().cycle);
        let now_ns = 10 * SECOND;
        let table = table(2);
        let clock = Clock::new(settings, now_ns, 0, None).in_slots(table.for_clock());
        Self { clock, scheduler: SlotScheduler::new(table, 100 * US), now_ns, cycle: (now_ns + OFFSET) / CYCLE, id: 0 }
    }

    fn hears(&mut self, from: u8, at_ns: u64, message: &TimeMessage) {
        let (head, rest) = time_frame((from, 2), self.id, message);
        let came = Stamp { ns: at_ns, doubt_ns: 0, by_kernel: true };
        self.clock.handle(at_ns, came, &head, &rest).unwrap();
    }

    fn sync(&self, sent_ns: u64) -> Sync {
        let nominal_ns = self.cycle * CYCLE;
        let sync =
            Sync { id: self.id, cycle: self.cycle, nominal_ns, sent_ns, epoch: 1, term: TERM, ..Sync::default() };
        Sync { began: TERM, followed: true, ..sync }
    }

    /// The master's Sync of the next cycle, with a delay of 10 µs.
    fn hears_sync(&mut self) {
        (self.cycle, self.id) = (self.cycle + 1, self.id + 1);
        self.now_ns = self.cycle * CYCLE - OFFSET + 10 * US;
        let sync = self.sync(self.cycle * CYCLE);
        self.hears(0, self.now_ns, &TimeMessage::Sync(sync));
    }

    /// Its next window, validated at this moment after its call.
    fn validated(&mut self, after_ns: i64) -> (Planned, WindowVerdict) {
        let Next::Window(planned) = self.scheduler.next(self.now_ns, &self.clock) else { panic!("silent") };
        self.now_ns = planned.call_ns.saturating_add_signed(after_ns);
        let verdict = self.scheduler.validate(&planned, self.now_ns, &self.clock);
        (planned, verdict)
    }

    /// Asks in its slot, and is answered. Each direction takes 10 µs.
    fn asks(&mut self) {
        let (_, verdict) = self.validated(0);
        let WindowVerdict::Send(tx_window) = verdict else { panic!("{verdict:?}") };
        let mut datagram = [0; TIME_BYTES];
        let mut kinds = Vec::new();
        let allowed = tx_window.allowed();
        while let Step::Send { to, stamp } = self.clock.poll_in(self.now_ns, allowed, &mut datagram) {
            assert_eq!(to, 0);
            kinds.push(FrameHead::parse(&datagram).unwrap().0.kind);
            self.now_ns += 5 * US;
            if let Some(id) = stamp {
                self.clock.sent(id, Stamp { ns: self.now_ns, doubt_ns: 0, by_kernel: true });
            }
        }
        assert_eq!(kinds, [Frame::WarmUp, Frame::Request]);
        let request_ns = self.now_ns + OFFSET + 10 * US;
        let reply =
            Reply { id: self.id, sync_ns: self.cycle * CYCLE, request_ns, sent_ns: request_ns, ..Reply::default() };
        let reply = Reply { epoch: 1, term: TERM, began: TERM, ..reply };
        self.now_ns += 50 * US;
        self.hears(0, self.now_ns, &TimeMessage::Reply(reply));
    }

    /// Has joined, and knows the time.
    fn joined() -> Self {
        let mut one = Self::new();
        (0..8).for_each(|_| one.hears_sync());
        for _ in 0..4 {
            one.asks();
            one.hears_sync();
        }
        // It asks no more.
        one.clock.poll_in(one.now_ns, Allowed::Slot, &mut [0; TIME_BYTES]);
        one.clock.poll_in(one.now_ns, Allowed::Slot, &mut [0; TIME_BYTES]);
        one
    }
}

#[test]
fn a_node_listens_then_asks_then_sends() {
    let mut one = Lonely::new();
    let silent = |one: &mut Lonely| match one.scheduler.next(one.now_ns, &one.clock) {
        Next::Silent { why, .. } => Some(why),
        Next::Window(_) => None,
    };
    assert_eq!(silent(&mut one), Some(Silent::NoTime));
    for heard in 1..8 {
        one.hears_sync();
        assert_eq!(silent(&mut one), Some(Silent::Joining { heard }));
    }
    one.hears_sync();
    let (planned, verdict) = one.validated(0);
    let WindowVerdict::Send(tx_window) = verdict else { panic!("{verdict:?}") };
    assert_eq!((tx_window.carries, one.scheduler.silent()), (Carries::Time, Some(Silent::Joining { heard: 8 })));
    // For coarse time a Sync takes half of its longest delay.
    let delay_max_ns = one.scheduler.table().for_clock().delay_max_ns;
    assert_eq!(planned.begin_ns, planned.window.begin_ns - OFFSET + 10 * US - delay_max_ns / 2);
    let mut one = Lonely::joined();
    let (planned, verdict) = one.validated(0);
    let WindowVerdict::Send(tx_window) = verdict else { panic!("{verdict:?}") };
    assert_eq!((tx_window.carries, one.scheduler.silent()), (Carries::All, None));
    assert!(planned.begin_ns.abs_diff(planned.window.begin_ns - OFFSET) < 2 * US, "{planned:?}");
    assert_eq!(planned.call_ns - planned.wake_ns, 100 * US, "to be spun");
}

#[test]
fn what_is_late_is_not_sent() {
    for (after_ns, sends) in
        [(-1, None), (0, Some(true)), (GATE_NS as i64, Some(true)), (GATE_NS as i64 + 1, Some(false))]
    {
        let mut one = Lonely::joined();
        let (_, verdict) = one.validated(after_ns);
        match sends {
            None => assert!(matches!(verdict, WindowVerdict::Early), "{after_ns}: {verdict:?}"),
            Some(true) => assert!(matches!(verdict, WindowVerdict::Send(_)), "{after_ns}: {verdict:?}"),
            Some(false) => assert!(matches!(verdict, WindowVerdict::Late), "{after_ns}: {verdict:?}"),
        }
        assert_eq!(one.scheduler.counts(&one.clock).late, u64::from(sends == Some(false)));
    }
}

#[test]
fn silence_begins_right_above_the_allowance() {
    let mut one = Lonely::joined();
    one.clock.poll_in(one.now_ns + SECOND, Allowed::Nothing, &mut [0; TIME_BYTES]);
    let allowance_ns = one.scheduler.table().allowance_ns();
    let (mut sent, mut was_sure) = (0, true);
    for _ in 0..100_000 {
        one.clock.poll_in(one.now_ns, Allowed::Nothing, &mut [0; TIME_BYTES]);
        match one.scheduler.next(one.now_ns, &one.clock) {
            Next::Window(planned) => {
                one.now_ns = planned.call_ns;
                let bound_ns = one.clock.estimate().unwrap().bound_ns(planned.end_ns);
                let verdict = one.scheduler.validate(&planned, one.now_ns, &one.clock);
                assert_eq!(
                    matches!(verdict, WindowVerdict::Send(_)),
                    bound_ns <= allowance_ns,
                    "{bound_ns}: {verdict:?}"
                );
                sent += u32::from(was_sure);
                was_sure = bound_ns <= allowance_ns;
            }
            Next::Silent { why, .. } => {
                assert!(matches!(why, Silent::BoundTooLarge { .. }), "{why:?}");
                assert!(sent > 20, "it held over for {sent} slots");
                return;
            }
        }
    }
    panic!("it never falls silent");
}

#[test]
fn no_frame_starts_before_its_slot() {
    let mut one = Lonely::joined();
    // From the call to the wire it takes 12, 13, … µs.
    for sample in 0..300 {
        let left = Stamp { ns: one.now_ns + 12 * US + sample % 10 * US, doubt_ns: 0, by_kernel: true };
        one.scheduler.left(one.now_ns, left);
    }
    let (planned, verdict) = one.validated(0);
    assert!(matches!(verdict, WindowVerdict::Send(_)), "{verdict:?}");
    assert_eq!(planned.begin_ns - planned.call_ns, 12 * US, "as much as can be compensated");
    assert_eq!(one.scheduler.lead_ns().0, 17 * US, "the median");
    let doubtful = Stamp { ns: one.now_ns + 12 * US, doubt_ns: 10_000, by_kernel: true };
    [doubtful, Stamp::by_us(one.now_ns)].into_iter().for_each(|stamp| one.scheduler.left(one.now_ns, stamp));
    assert_eq!(one.scheduler.lead_ns().1, 12 * US, "what may be far off says nothing");
    let last = Stamp { ns: one.now_ns + 3 * US, doubt_ns: 500, by_kernel: true };
    one.scheduler.left(one.now_ns, last);
    assert_eq!(one.scheduler.lead_ns().1, 2_500, "the quickest of all, by the least that its stamp says");
}

#[test]
fn what_was_handed_over_counts() {
    let mut one = Lonely::joined();
    let (planned, verdict) = one.validated(0);
    let WindowVerdict::Send(mut tx_window) = verdict else { panic!("{verdict:?}") };
    // 350 µs: 4375 bytes. All are handed over at once, and the wire takes its time.
    assert!((349 * US..=350 * US).contains(&(planned.end_ns - planned.begin_ns)), "{planned:?}");
    let (mut datagrams, wire_ns) = (0, 85_280);
    let arrives_after_ns = tx_window.arrives_after_ns(tx_window.begin_ns, 1_000, 5 * US);
    assert_eq!(arrives_after_ns, 5 * US + 2 * wire_ns, "to the wire, on it, and once more behind a switch");
    while tx_window.fits(one.now_ns, 1_000) {
        tx_window.takes(one.now_ns, 1_000);
        datagrams += 1;
        assert!(datagrams < 100, "it does not end");
    }
    assert_eq!(datagrams, 4, "of 1066 bytes each");
    let left_ns = (tx_window.end_ns - tx_window.begin_ns) - 4 * wire_ns;
    assert_eq!(tx_window.spare_ns(), left_ns.cast_signed(), "behind the last");
    let arrives_after_ns = tx_window.arrives_after_ns(tx_window.begin_ns, 1_000, 5 * US);
    assert!(arrives_after_ns >= 6 * wire_ns, "behind those: {arrives_after_ns}");
    assert!(
        tx_window.fits(one.now_ns, 40) && !tx_window.fits(planned.end_ns - 5 * US, 0),
        "nothing that ends in the guard"
    );
    one.scheduler.close(&tx_window);
    let counts = one.scheduler.counts(&one.clock);
    assert_eq!((counts.used, counts.datagrams, counts.wire_bytes), (1, 4, 4 * 1_066));
}

#[test]
fn what_leaves_later_than_bounds_reckon_with_is_late() {
    let mut one = Lonely::joined();
    let (_, WindowVerdict::Send(mut tx_window)) = one.validated(0) else { panic!() };
    let (hand_over_ns, wire_ns, small_wire_ns) = (20 * US, 85_280, 6_720);
    let called_ns = tx_window.begin_ns - one.scheduler.lead_ns().1;
    let turns_at = |after_ns: u64, is_so: &dyn Fn(u64) -> bool| {
        assert_eq!([0, 1].map(|more_ns| is_so(called_ns + after_ns + more_ns)), [false, true], "at {after_ns} ns");
    };
    turns_at(LATE_NS, &|now_ns| tx_window.is_behind(now_ns));
    turns_at(LATE_NS, &|now_ns| tx_window.is_late(now_ns, 1_000));
    // A small one takes the wire less than the thread, which has the rest to hand it over.
    turns_at(LATE_NS + hand_over_ns - small_wire_ns, &|now_ns| tx_window.is_late(now_ns, 0));
    tx_window.takes(called_ns, 1_000);
    turns_at(LATE_NS + wire_ns, &|now_ns| tx_window.is_behind(now_ns));
    tx_window.takes(called_ns + wire_ns, 0);
    turns_at(LATE_NS + wire_ns + hand_over_ns, &|now_ns| tx_window.is_behind(now_ns));
    turns_at(LATE_NS + wire_ns + hand_over_ns, &|now_ns| tx_window.is_late(now_ns, 1_000));
}

#[test]
fn slots_that_went_by_are_counted() {
    let mut one = Lonely::joined();
    one.validated(0);
    let before = one.scheduler.counts(&one.clock);
    one.now_ns += 3 * CYCLE + 2 * GATE_NS;
    one.scheduler.next(one.now_ns, &one.clock);
    let counts = one.scheduler.counts(&one.clock);
    // Three cycles have three slots, and one that is there in each third.
    assert_eq!((counts.skipped - before.skipped, counts.silent), (4, before.silent));
}

#[test]
fn a_replacement_is_a_sign_of_life_and_nothing_else() {
    let mut one = Lonely::joined();
    one.cycle += 1;
    one.now_ns += CYCLE;
    let (heard_ns, counts) = (one.clock.heard_ns(one.now_ns), one.clock.sync_counts());
    let coarse = one.clock.coarse(one.now_ns);
    // Its time is ahead by its sender's error.
    let replacement = Sync { id: 77, replacement: true, followed: false, ..one.sync(one.cycle * CYCLE + 50 * US) };
    one.hears(1, one.now_ns, &TimeMessage::Sync(replacement));
    assert_eq!(one.clock.heard_ns(one.now_ns), heard_ns, "the master is as silent as before");
    assert_eq!(one.clock.coarse(one.now_ns), coarse, "nobody goes by it");
    assert_eq!(one.clock.sync_counts().replacements_heard, counts.replacements_heard + 1);
    let asks = one.clock.poll_in(one.now_ns, Allowed::Slot, &mut [0; TIME_BYTES]);
    assert!(matches!(asks, Step::Wait { .. }), "nobody asks after it: {asks:?}");
    one.cycle += 2;
    one.now_ns += 2 * CYCLE;
    one.hears_sync();
    assert_eq!(one.clock.sync_counts().missed, counts.missed + 3, "three cycles without the master's");
}

#[test]
fn a_node_that_turns_while_the_first_master_lives_is_not_sure() {
    for (silence, is_sure) in [(0, false), (4 * CYCLE, true)] {
        let mut one = Lonely::joined();
        (one.cycle, one.now_ns) = (one.cycle + silence / CYCLE, one.now_ns + silence);
        let term = Term::new(2, 1);
        let sync = Sync { id: 1, term, began: term, ..one.sync(one.now_ns + OFFSET) };
        one.hears(1, one.now_ns, &TimeMessage::Sync(sync));
        assert_eq!(one.clock.master(), Some(1));
        assert_eq!(one.clock.estimate().is_some(), is_sure, "after {silence} ns of silence");
    }
}
