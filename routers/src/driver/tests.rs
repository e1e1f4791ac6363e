//! The driver of time slots, on a platform that stands still where it is told to.

mod parts;

use super::{ANSWER_BYTES, Answer, NotSent, Platform, SlotDriver, SlotEvent, SlotStep, WINDOWS, WindowLog, spin_ns};
use crate::frame::NodeIndex;
use crate::harness::{End, MS, S, START, address, head, module, slot, tdma};
use crate::intake::Transit;
use crate::outbound::{Accepted, Outbound};
use crate::report::Report;
use crate::stats::Stats;
use crate::tdma::{SlotScheduler, SlotTable, WindowVerdict};
use crate::time::{Clock, SentId, Stamp, TIME_BYTES, TimeSettings};
use parts::Replicated;
use rohrpost_mailbox::{Head, Priority};
use std::net::IpAddr;
use std::sync::Arc;
use std::time::Duration;

const CYCLE: Duration = Duration::from_millis(10);
/// Longer than any window, shorter than the pause to the next.
const STILL_NS: u64 = 3 * MS;
const WALL_NS: u64 = 1_790_000_000 * S;

/// Where the thread may stand still.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Moment {
    /// Between the making of a datagram and its handover.
    Made,
    /// In the call that sends it.
    Sends,
    /// In the call that sends a datagram of time.
    SendsTime,
    /// In the call that sends a refusal.
    Answers,
    /// In a window, behind its last call.
    AllSent,
}

/// The only master, and all others hear it.
struct Computer {
    end: End,
    clock: Clock,
    now_ns: u64,
    /// It stands still there, when it has come there so many times.
    still: Option<(Moment, u32)>,
    is_in_window: bool,
    answer: Option<Answer>,
    log: WindowLog,
    replicated: Option<Replicated>,
    /// In each window the datagrams of packages, and those of parts: true.
    sent: Vec<Vec<bool>>,
}

impl Computer {
    fn comes_to(&mut self, moment: Moment) {
        match &mut self.still {
            Some((at, times)) if *at == moment => {
                *times -= 1;
                if *times == 0 {
                    self.still = None;
                    self.now_ns += STILL_NS;
                }
            }
            _ => {}
        }
    }
}

/// A mailbox in which nothing is.
struct Empty<'a>(&'a Outbound, u64);

impl Transit for Empty<'_> {
    fn waits(&mut self) -> (usize, Option<Priority>) {
        (0, None)
    }

    fn slots(&self) -> usize {
        1
    }

    fn queued(&self) -> Option<u8> {
        self.0.first_level()
    }

    fn level(&self, priority: Priority) -> u8 {
        self.0.level(priority)
    }

    fn local_ns(&self) -> u64 {
        self.1
    }

    fn take(&mut self) -> Option<(Head, Accepted)> {
        None
    }
}

impl Platform for Computer {
    fn local_ns(&self) -> u64 {
        self.now_ns
    }

    fn monotonic_ns(&self) -> u64 {
        self.now_ns
    }

    fn clock(&self) -> &Clock {
        &self.clock
    }

    fn time(&mut self) -> (&mut Clock, &Stats) {
        (&mut self.clock, &self.end.stats)
    }

    fn transit(&mut self) -> impl Transit {
        Empty(&self.end.outbound, self.now_ns)
    }

    fn queue(&mut self) -> (&mut Outbound, impl Report) {
        (&mut self.end.outbound, &mut self.end.log)
    }

    fn send(&mut self, _: u64, _: NodeIndex, _: &mut [u8], _: usize) -> Result<(), NotSent> {
        self.comes_to(Moment::Sends);
        self.sent.last_mut().unwrap().push(false);
        Ok(())
    }

    fn send_time(&mut self, _: NodeIndex, _: &[u8; TIME_BYTES]) {
        self.comes_to(Moment::SendsTime);
    }

    fn next_answer(&mut self) -> Option<Answer> {
        self.answer.take()
    }

    fn send_answer(&mut self, _: IpAddr, _: &[u8]) {
        self.comes_to(Moment::Answers);
    }

    fn take_time(&mut self, _: usize, _: impl FnMut(SentId, Stamp)) {}

    fn take_stranger(&mut self) -> Option<IpAddr> {
        None
    }

    fn tidy(&mut self, _: u64) {}

    fn next_part(&mut self, datagram: &mut [u8]) -> Option<(NodeIndex, usize)> {
        self.replicated.as_mut()?.next(self.now_ns, datagram)
    }

    fn send_part(&mut self, _: NodeIndex, buffer: &mut [u8], bytes: usize) {
        self.sent.last_mut().unwrap().push(true);
        if self.replicated.as_mut().unwrap().send(self.now_ns, &buffer[..bytes]) {
            self.end.queue(self.now_ns, head(module(100, 1), module(100, 0), 90), &[0; 900]);
        }
    }

    fn publish(&mut self, _: &SlotScheduler, log: &WindowLog) {
        self.log = *log;
    }

    fn queue_changed(&mut self) {
        if self.is_in_window {
            self.comes_to(Moment::AllSent);
        }
    }

    fn happened(&mut self, event: SlotEvent<'_>) {
        match event {
            SlotEvent::Decided(_, verdict) => {
                self.is_in_window = matches!(verdict, WindowVerdict::Send(_));
                self.sent.push(Vec::new());
            }
            SlotEvent::Closed(_) => self.is_in_window = false,
            SlotEvent::Made => self.comes_to(Moment::Made),
            _ => {}
        }
    }
}

struct Router {
    driver: SlotDriver,
    on: Computer,
}

impl Router {
    /// Of node 0, which sends already.
    fn new() -> Self {
        let tdma = tdma([10_000, 1000, 400], vec![slot(0, 5000, 1000)]);
        let table = SlotTable::new(&tdma, &[0], 0, 3, 28);
        let end = End::new(0, |settings| settings.tdma = Some(tdma));
        let clock = TimeSettings::of(&end.settings, &[0], CYCLE);
        let clock = Clock::new(clock, START, WALL_NS, None).in_slots(table.for_clock());
        let scheduler = SlotScheduler::new(table, spin_ns(CYCLE.as_nanos() as u64));
        let driver = SlotDriver::new(&Arc::new(end.settings.clone()), None, scheduler, START);
        let log = WindowLog::default();
        let on = Computer {
            end,
            clock,
            now_ns: START,
            still: None,
            is_in_window: false,
            answer: None,
            log,
            replicated: None,
            sent: Vec::new(),
        };
        let mut router = Self { driver, on };
        router.run_for(5 * S);
        assert_eq!(router.driver.scheduler().silent(), None, "it sends");
        assert_eq!((router.on.log.held, router.on.log.overran), (0, 0), "it never stood still");
        router
    }

    fn run_for(&mut self, for_ns: u64) {
        let until_ns = self.on.now_ns + for_ns;
        while self.on.now_ns < until_ns {
            [1, 2].into_iter().for_each(|peer| self.on.end.hears(peer, self.on.now_ns));
            match self.driver.poll(&mut self.on) {
                SlotStep::Sleep { for_ns } => self.on.now_ns += for_ns,
                SlotStep::Spin { until_ns } => self.on.now_ns = until_ns,
            }
        }
    }
}

#[test]
fn a_window_overran_if_a_send_call_came_back_behind_its_end() {
    for (moment, times, held, overran, why) in [
        (Moment::Made, 1, 1, 0, "nothing was sent"),
        (Moment::Made, 2, 1, 0, "the call for the first came back in time, and the second waits"),
        (Moment::Sends, 1, 0, 1, "in the call for the first; the second is not made"),
        (Moment::Sends, 2, 0, 1, "in the call for the last"),
        (Moment::AllSent, 1, 0, 0, "all calls were back"),
        (Moment::SendsTime, 1, 0, 1, "a synchronisation window counts, too"),
        (Moment::SendsTime, 2, 0, 1, "the same in the call for its last"),
        (Moment::Answers, 1, 0, 1, "a refusal counts, too"),
    ] {
        let mut router = Router::new();
        let Computer { end, now_ns, still, answer, .. } = &mut router.on;
        *still = Some((moment, times));
        if moment == Moment::Answers {
            *answer = Some(Answer::Refusal { to: address(1), bytes: ANSWER_BYTES, datagram: [0; ANSWER_BYTES] });
        } else {
            [1, 2].into_iter().for_each(|to| end.queue(*now_ns, head(module(100, to), module(100, 0), 90), &[0; 900]));
        }
        router.run_for(CYCLE.as_nanos() as u64);
        let Computer { still, log, .. } = &router.on;
        let case = format!("{moment:?} {times}: {why}");
        assert_eq!(*still, None, "{case}: it stood still");
        assert_eq!((log.held, log.overran), (held, overran), "{case}");
        let over = log.windows[WINDOWS - 3..].iter().flatten().filter(|used| used.over_ns > 0);
        assert!(over.clone().all(|used| (STILL_NS / 2..STILL_NS).contains(&used.over_ns)), "{case}: {log:?}");
        assert_eq!(over.count() as u64, overran, "{case}: {log:?}");
    }
}
