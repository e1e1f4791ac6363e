//! Whether a module is silent for longer than its watchdog allows. Knows no process and no clock; what there is to know
//! comes as an argument.
//!
//! ```text
//!  a turn of the module      ├────────────────────────────────▶
//!  looks of launch     ·       ·       ·       ·       ·   ×      four in a limit; × when it is over: silent
//! ```
//!
//! Launch may be late itself: it was stopped, or the computer slept or was busy. Then the module had no chance either.
//! Three rules keep it from being blamed. Time by which a look is late is not counted. A look that is late by more than
//! an eighth of the limit says nothing about the time since the look before, so none of that is counted; and it ends
//! nobody: launch must run, and see the same, for another quarter of the limit. So of any stop of the computer at most
//! a quarter of the limit counts as silence, and of a long one nothing. A launch that is so late at every look finds no
//! hang: that limit is too short for its computer.

use rohrpost_mailbox::InHand;
use std::time::Duration;

/// What launch sees of a module at one moment.
#[derive(Clone, Copy, Default)]
pub(super) struct Look {
    /// The part of its own code that runs.
    pub(super) in_hand: Option<InHand>,
    /// Whether the process is stopped, by SIGSTOP say.
    pub(super) is_stopped: bool,
    /// If packages wait for it: how many it has taken so far.
    pub(super) taken: Option<u64>,
}

/// What a module does not come out of. It is the same silence as long as it is equal.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Silence {
    /// A part of its code.
    Turn(InHand),
    /// A process that is stopped between two turns.
    Stopped,
    /// So many packages taken, and more that wait.
    Waiting(u64),
}

/// A silence that is longer than allowed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Hang {
    pub(super) silence: Silence,
    /// For how long, as far as launch knows.
    pub(super) lasts: Duration,
}

/// What follows from a look.
#[derive(PartialEq, Eq, Debug)]
pub(super) enum Verdict {
    /// Nothing.
    Fine,
    /// To be woken: perhaps it sleeps beside waiting packages, since their sender was stopped before it rang.
    Wake,
    /// The module is to be ended.
    Hangs(Hang),
}

/// A silence that may become too long.
#[derive(Clone, Copy)]
struct Suspicion {
    silence: Silence,
    began_ns: u64,
    /// The silence counts from here on: its beginning, moved by the time that is not counted.
    counts_from_ns: u64,
    /// The first look that saw it and was not late.
    seen_ns: u64,
}

/// Watches one process of a module. All times are ns of the monotonic clock.
pub(super) struct SilenceWatch {
    limit_ns: u64,
    looked_ns: u64,
    look_at_ns: u64,
    suspicion: Option<Suspicion>,
}

impl SilenceWatch {
    /// For a module that is ready now.
    pub(super) fn new(limit: Duration, now_ns: u64) -> Self {
        let limit_ns = u64::try_from(limit.as_nanos()).unwrap_or(u64::MAX);
        Self { limit_ns, looked_ns: now_ns, look_at_ns: now_ns, suspicion: None }
    }

    /// When it wants to look next. A later look is one of a launch that was late.
    pub(super) fn look_at_ns(&self) -> u64 {
        self.look_at_ns
    }

    /// Takes what launch sees now.
    pub(super) fn look(&mut self, look: Look, now_ns: u64) -> Verdict {
        let quarter_ns = self.limit_ns / 4;
        let late_ns = now_ns.saturating_sub(self.look_at_ns);
        let is_late = late_ns > quarter_ns / 2;
        let uncounted_ns = if is_late { now_ns.saturating_sub(self.looked_ns) } else { late_ns };
        (self.looked_ns, self.look_at_ns) = (now_ns, now_ns + quarter_ns);
        let Some(silence) = look.silence() else {
            self.suspicion = None;
            return Verdict::Fine;
        };
        let before = self.suspicion.filter(|before| before.silence == silence);
        let mut suspicion = before.unwrap_or_else(|| Suspicion::new(silence, now_ns));
        suspicion.counts_from_ns = (suspicion.counts_from_ns + uncounted_ns).min(now_ns);
        if is_late {
            suspicion.seen_ns = now_ns;
        }
        let due_ns = (suspicion.counts_from_ns + self.limit_ns).max(suspicion.seen_ns + quarter_ns);
        if now_ns >= due_ns {
            self.suspicion = None;
            let lasts = Duration::from_nanos(now_ns.saturating_sub(suspicion.began_ns));
            return Verdict::Hangs(Hang { silence, lasts });
        }
        self.look_at_ns = self.look_at_ns.min(due_ns);
        self.suspicion = Some(suspicion);
        match silence {
            Silence::Waiting(_) if before.is_some() => Verdict::Wake,
            _ => Verdict::Fine,
        }
    }
}

impl Look {
    /// A part that runs says best since when; packages that wait say least.
    fn silence(self) -> Option<Silence> {
        match self {
            Self { in_hand: Some(in_hand), .. } => Some(Silence::Turn(in_hand)),
            Self { is_stopped: true, .. } => Some(Silence::Stopped),
            Self { taken: Some(taken), .. } => Some(Silence::Waiting(taken)),
            Self { .. } => None,
        }
    }
}

impl Suspicion {
    /// Only a mark tells when it began. All else counts from the first look.
    fn new(silence: Silence, now_ns: u64) -> Self {
        let began_ns = match silence {
            Silence::Turn(in_hand) => in_hand.since_ns.min(now_ns),
            Silence::Stopped | Silence::Waiting(_) => now_ns,
        };
        Self { silence, began_ns, counts_from_ns: began_ns, seen_ns: now_ns }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost_mailbox::Work;

    const MS: u64 = 1_000_000;
    const LIMIT: Duration = Duration::from_millis(100);

    fn turn(since_ms: u64) -> Look {
        Look { in_hand: Some(InHand { work: Work::Tick, since_ns: since_ms * MS }), ..Look::default() }
    }

    fn stopped() -> Look {
        Look { is_stopped: true, ..Look::default() }
    }

    fn waiting(taken: u64) -> Look {
        Look { taken: Some(taken), ..Look::default() }
    }

    /// A watch that looks when it wants to, from time 1000 ms on, at a module that `shows` this at each moment (ms).
    /// `delay`: by how much launch is late at a moment. When a hang is found until `end_ms`, and for how long the
    /// module was silent then.
    fn hangs_at(end_ms: u64, shows: impl Fn(u64) -> Look, delay: impl Fn(u64) -> u64) -> Option<(u64, u64)> {
        let mut watch = SilenceWatch::new(LIMIT, 1000 * MS);
        loop {
            let planned_ms = watch.look_at_ns().div_ceil(MS);
            let now_ms = planned_ms + delay(planned_ms);
            if now_ms > end_ms {
                return None;
            }
            if let Verdict::Hangs(Hang { lasts, .. }) = watch.look(shows(now_ms), now_ms * MS) {
                return Some((now_ms, lasts.as_millis() as u64));
            }
        }
    }

    const ON_TIME: fn(u64) -> u64 = |_| 0;

    #[test]
    fn a_turn_is_over_its_limit_when_that_has_passed_since_it_began() {
        for began in 1000..1200 {
            let shows = |now| if now < began { Look::default() } else { turn(began) };
            assert_eq!(hangs_at(5000, shows, ON_TIME), Some((began + 100, 100)), "began at {began} ms");
        }
    }

    #[test]
    fn what_goes_on_is_never_silent() {
        let idle = |_| Look::default();
        // Back to back, each just within the limit; the mark is never 0.
        let long_turns = |now: u64| turn(now / 99 * 99);
        let flooded = |now: u64| waiting(now / 90);
        assert_eq!(hangs_at(100_000, idle, ON_TIME), None);
        assert_eq!(hangs_at(100_000, long_turns, ON_TIME), None);
        assert_eq!(hangs_at(100_000, flooded, ON_TIME), None, "packages always wait, and some are taken");
    }

    #[test]
    fn without_a_turn_it_counts_from_the_first_look() {
        for began in 1000..1200 {
            for shows in [stopped(), waiting(7)] {
                let shows = |now| if now < began { Look::default() } else { shows };
                let (found, lasts) = hangs_at(5000, shows, ON_TIME).unwrap();
                assert!((began + 100..=began + 125).contains(&found) && lasts == 100, "{began}: {found}, {lasts}");
            }
        }
        let continued = |now| if now < 1090 { stopped() } else { turn(1080) };
        assert_eq!(hangs_at(5000, continued, ON_TIME), Some((1180, 100)), "another silence");
    }

    #[test]
    fn packages_that_wait_have_the_module_woken_before_it_is_ended() {
        let mut watch = SilenceWatch::new(LIMIT, 0);
        let (mut wakes, mut now_ns) = (0, 0);
        let hang = loop {
            match watch.look(waiting(7), now_ns) {
                Verdict::Hangs(hang) => break hang,
                Verdict::Wake => wakes += 1,
                Verdict::Fine => {}
            }
            now_ns = watch.look_at_ns();
        };
        assert_eq!((wakes, hang), (3, Hang { silence: Silence::Waiting(7), lasts: LIMIT }));
    }

    /// Launch and module stand still at each moment of a turn; the module needs this much time of its own.
    #[test]
    fn a_launch_that_was_stopped_blames_nobody_for_it() {
        let stops = [(90, 200), (90, 1000), (90, 60_000), (74, 1), (74, 20), (74, 37), (74, 38), (74, 60), (74, 100)];
        for (needs, stop) in stops {
            for (began, asleep) in (1000..1100).flat_map(|began| (began..began + needs).map(move |at| (began, at))) {
                let (awake, ends) = (asleep + stop, began + needs + stop);
                let shows = |now| if (began..ends).contains(&now) { turn(began) } else { Look::default() };
                let delay = |planned: u64| if planned > asleep { awake.saturating_sub(planned) } else { 0 };
                let found = hangs_at(ends + 1000, shows, delay);
                assert_eq!(found, None, "needs {needs} from {began} on, stands for {stop} from {asleep} on");
            }
        }
    }

    #[test]
    fn a_hang_is_found_although_launch_is_late() {
        for late in [1, 24, 26, 60, 1000] {
            let shows = |now| if now < 1010 { Look::default() } else { turn(1010) };
            let (found, _) = hangs_at(5000, shows, |planned| if planned < 1100 { late } else { 0 }).unwrap();
            assert!((1110..=1225 + late).contains(&found), "late by {late} at first: {found}");
            let always = |planned| if planned % 2 == 0 { late } else { 0 };
            let (found, lasts) = hangs_at(60_000, shows, always).unwrap();
            assert!(found >= 1110 && lasts == found - 1010, "late by {late} at times: {found}, {lasts}");
        }
    }

    #[test]
    fn looks_between_those_that_are_planned_change_nothing() {
        let mut watch = SilenceWatch::new(LIMIT, 1000 * MS);
        for now in 1000..1110 {
            assert_eq!(watch.look(turn(1010.min(now)), now * MS), Verdict::Fine, "{now}");
        }
        let hang = Hang { silence: turn(1010).silence().unwrap(), lasts: LIMIT };
        assert_eq!(watch.look(turn(1010), 1110 * MS), Verdict::Hangs(hang));
    }
}
