//! The way of a line out of this process: allowances, queues, and the thread that finds the way free sends.

use super::allowance::{Bucket, Excess, Suppressed};
use super::out::{Out, Outlet};
use super::print::Print;
use super::said::Said;
use super::{CLASS, LINES, OutputLine, layer};
use crate::common::{DataHead, OutputLevel};
use crossbeam_queue::ArrayQueue;
use rohrpost_config::{Installation, Level};
use rohrpost_mailbox::{Label, Name, Options, Participant, Priority, SendError, SystemClock, Type, monotonic_ns};
use std::cell::Cell;
use std::sync::atomic::{AtomicU8, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// Lines that wait in this process while the collector is not there or has no room: panics, errors, others.
const WAITING_MAX: [usize; 3] = [16, 64, 256];
/// All of these.
pub const WAITING_LINES: u64 = (WAITING_MAX[0] + WAITING_MAX[1] + WAITING_MAX[2]) as u64;
/// Each has the allowance of configuration.
pub const LANES: u64 = Lane::ALL.len() as u64;
/// How soon one that had no room is tried again.
const RETRY_FULL: Duration = Duration::from_millis(20);
/// How long a process that ends gives its last lines to find the collector.
const LAST_LINES: Duration = Duration::from_millis(500);
/// How often it looks.
const LAST_LOOK: Duration = Duration::from_millis(5);

static OUTPUT: OnceLock<Output> = OnceLock::new();

thread_local! {
    /// Panics of this thread since it was last seen not to unwind.
    static PANICS: Cell<u32> = const { Cell::new(0) };
}

/// Each has an allowance and a queue of its own, so that no flood of one hides another. In the order of their
/// importance.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Lane {
    Panic,
    Error,
    Rest,
}

impl Lane {
    const ALL: [Self; 3] = [Self::Panic, Self::Error, Self::Rest];

    pub(super) fn of(level: OutputLevel) -> Self {
        if level == OutputLevel::Error { Self::Error } else { Self::Rest }
    }

    /// What it carries, and how important it is to know that some of it is missing.
    fn words(self) -> (&'static str, OutputLevel) {
        match self {
            Self::Panic => ("panics", OutputLevel::Error),
            Self::Error => ("errors", OutputLevel::Error),
            Self::Rest => ("lines", OutputLevel::Warn),
        }
    }
}

struct Waiting {
    bucket: Bucket,
    excess: Excess,
    queue: ArrayQueue<OutputLine>,
}

/// What is said in the name of one module: by its own process, or by launch for what it printed.
pub(super) struct Output {
    me: Name,
    /// The name under which its packages go: the module's, or launch's.
    from: Name,
    to: Name,
    priority: Priority,
    /// An [`OutputLevel`] as a number.
    level: AtomicU8,
    clock: SystemClock,
    participant: Arc<Participant>,
    lanes: [Waiting; 3],
    rate: u32,
    /// Lost since the last line that got through.
    lost_now: AtomicU32,
    lost: AtomicU64,
    suppressed: AtomicU64,
    out: Arc<Out>,
    print: Print,
    /// Whether the configuration has a collector, on whichever node: routers lead there. Where there is none, nothing
    /// waits for it: what is said is counted as lost, and errors are printed.
    collected: bool,
}

/// Makes this process's `tracing` events and panics lines of this module. The first caller in a process decides.
pub fn install(participant: &Arc<Participant>, installation: &Installation, me: Name, launched: bool) {
    install_quiet(participant, installation, me, launched, Duration::ZERO);
}

/// The same, and for so long lines wait in this process; they are dropped if it ends before.
pub(crate) fn install_quiet(
    participant: &Arc<Participant>,
    installation: &Installation,
    me: Name,
    launched: bool,
    quiet: Duration,
) {
    // By hand, the person at the terminal is told; launched, only what launch may have to repeat goes to standard
    // error.
    let print = if launched { Print::Errors } else { Print::All };
    if let Some(output) = Output::new(participant, installation, me, me, Arc::new(Out::quiet(quiet)), print)
        && OUTPUT.set(output).is_ok()
    {
        layer::listen();
    }
    layer::listen_for_panics(print);
}

impl Output {
    /// None: the configuration knows no collector.
    pub(super) fn new(
        participant: &Arc<Participant>,
        installation: &Installation,
        me: Name,
        from: Name,
        out: Arc<Out>,
        print: Print,
    ) -> Option<Self> {
        let class = installation.classes.id(CLASS)?;
        let (rate, burst) = (installation.output.rate, installation.output.burst);
        let to = Name::new(me.system(), class.0, 0, LINES);
        Some(Self {
            me,
            from,
            to,
            priority: class.priority(),
            level: AtomicU8::new(level_of(installation.output_level(me)) as u8),
            clock: SystemClock::open(participant.node()),
            participant: participant.clone(),
            lanes: WAITING_MAX.map(|lines| Waiting {
                bucket: Bucket::new(rate, burst),
                excess: Excess::default(),
                queue: ArrayQueue::new(lines),
            }),
            rate,
            lost_now: AtomicU32::new(0),
            lost: AtomicU64::new(0),
            suppressed: AtomicU64::new(0),
            out,
            print,
            collected: installation.module(to).is_some(),
        })
    }
}

/// A panic that this thread survived does not make the next one its last. (In the hook itself a thread always panics,
/// so that it cannot be told there whether one was unwinding already.)
fn forget_panics() {
    if !std::thread::panicking() {
        // Fails only while the thread ends.
        let _ = PANICS.try_with(|panics| panics.set(0));
    }
}

fn level_of(level: Level) -> OutputLevel {
    match level {
        Level::Error => OutputLevel::Error,
        Level::Warn => OutputLevel::Warn,
        Level::Info => OutputLevel::Info,
        Level::Debug => OutputLevel::Debug,
        Level::Trace => OutputLevel::Trace,
    }
}

pub(super) fn installed() -> Option<&'static Output> {
    OUTPUT.get()
}

/// Whether events become lines, and are printed where that is wanted.
pub(crate) fn is_installed() -> bool {
    installed().is_some()
}

/// Sets which lines this process sends from now on; returns which it sent before, if it sends any.
pub fn set_level(level: OutputLevel) -> Option<OutputLevel> {
    let before = OutputLevel::of_number(installed()?.level.swap(level as u8, Ordering::Relaxed));
    layer::level_changed();
    Some(before)
}

/// Which lines this process sends, if it sends any.
pub fn level() -> Option<OutputLevel> {
    installed().map(Output::level)
}

/// Lines lost so far.
pub fn lost() -> u64 {
    installed().map_or(0, |output| output.lost.load(Ordering::Relaxed))
}

/// Lines suppressed so far, since there were too many.
pub fn suppressed() -> u64 {
    installed().map_or(0, |output| output.suppressed.load(Ordering::Relaxed))
}

/// Sends the lines that wait, as far as there is room, and tells of suppressed ones when it is time.
pub fn drain() {
    forget_panics();
    if let Some(output) = installed() {
        output.attend();
    }
}

/// Sends the lines that wait. For a process that ends: it tells of all that was suppressed, and gives a collector that
/// is not there or has no room a moment, at most half a second. What is left then is lost; errors are printed for
/// launch to pass on.
pub fn flush() {
    if let Some(output) = installed() {
        output.tell(|excess, _| excess.tell_all());
        output.flush();
    }
}

/// When to call [`drain`] again, if lines wait or there is something to tell.
pub fn retry_at() -> Option<Instant> {
    installed()?.retry_at()
}

impl Output {
    /// See [`drain`].
    pub(super) fn attend(&self) {
        self.tell(|excess, now_ns| excess.tell(now_ns));
        self.drain();
    }

    /// See [`retry_at`].
    pub(super) fn retry_at(&self) -> Option<Instant> {
        let now = Instant::now();
        let retry = (!self.is_idle()).then(|| now + RETRY_FULL.max(self.patience()));
        let now_ns = monotonic_ns();
        // Where there is no room for it, it is told when there is; until then its time would have passed again and
        // again.
        let room = self.lanes.iter().filter(|lane| !lane.queue.is_full());
        let due_ns = room.filter_map(|lane| lane.excess.due_ns()).min();
        let due = due_ns.map(|due_ns| now + Duration::from_nanos(due_ns.saturating_sub(now_ns)));
        [retry, due].into_iter().flatten().min()
    }

    /// System time, as lines carry it.
    pub(super) fn now_ns(&self) -> u64 {
        self.clock.now().ns
    }

    pub(super) fn level(&self) -> OutputLevel {
        OutputLevel::of_number(self.level.load(Ordering::Relaxed))
    }

    /// Whether one more may be said now; else it is counted.
    pub(super) fn allows(&self, lane: Lane) -> bool {
        let (now_ns, own) = (monotonic_ns(), &self.lanes[lane as usize]);
        if own.bucket.take(now_ns) {
            return true;
        }
        self.suppressed.fetch_add(1, Ordering::Relaxed);
        if own.excess.add(now_ns) {
            // The module's loop may sleep, and has to wake up when it is time to tell.
            self.participant.ring();
        }
        false
    }

    /// Says a line that is allowed, and was true at this system time.
    pub(super) fn say(&self, level: OutputLevel, time_ns: u64, said: Said) {
        forget_panics();
        self.tell(|excess, now_ns| excess.tell(now_ns));
        self.push(Lane::of(level), level, time_ns, 0, said);
        self.drain();
        if !self.is_idle() {
            // Said by another thread, it would wait for whatever wakes the module's loop next.
            self.participant.ring();
        }
    }

    /// Says a panic. What finds no room now is sent later by the module's loop, or at the process's end.
    pub(super) fn panicked(&self, text: String) {
        if self.allows(Lane::Panic) {
            self.push(Lane::Panic, OutputLevel::Error, self.now_ns(), 0, text.into());
        }
        self.drain();
        let before = PANICS.try_with(|panics| panics.replace(panics.get() + 1)).unwrap_or(0);
        if before > 0 || cfg!(panic = "abort") {
            // Nothing comes after it: a second panic while the first one unwinds aborts the process.
            self.flush();
        } else if !self.is_idle() {
            self.participant.ring();
        }
    }

    /// Puts a line into its queue.
    fn push(&self, lane: Lane, level: OutputLevel, time_ns: u64, suppressed: u32, said: Said) {
        let Said { text, errno } = said;
        let line = OutputLine { time_ns, module: self.me.raw(), level, lost: 0, suppressed, errno, text };
        self.print.said(level, &line.full_text());
        if !self.collected {
            self.lose(&line);
        } else if let Err(line) = self.lanes[lane as usize].queue.push(line) {
            self.lose(&line);
        }
    }

    /// Tells of what was suppressed, unless there is no room: then its time comes later.
    fn tell(&self, told: impl Fn(&Excess, u64) -> Option<Suppressed>) {
        for lane in Lane::ALL {
            let own = &self.lanes[lane as usize];
            if own.excess.due_ns().is_none() || own.queue.is_full() {
                continue;
            }
            if let Some(Suppressed { lines, within }) = told(&own.excess, monotonic_ns()) {
                let ((what, level), rate) = (lane.words(), self.rate);
                let text = format!("… {lines} {what} were suppressed in {within:.1?}: more than {rate} a second");
                self.push(lane, level, self.now_ns(), lines, text.into());
            }
        }
    }

    /// Counts it; one that launch is to repeat, launch may yet bring to the collector.
    fn lose(&self, line: &OutputLine) {
        self.print.lost(line.level, &line.full_text());
        self.lost_now.fetch_add(1, Ordering::Relaxed);
        self.lost.fetch_add(1, Ordering::Relaxed);
    }

    fn is_idle(&self) -> bool {
        !self.out.held.load(Ordering::Relaxed) && self.lanes.iter().all(|lane| lane.queue.is_empty())
    }

    fn patience(&self) -> Duration {
        let retry_at = self.out.way().and_then(|way| way.retry_at);
        retry_at.map_or(Duration::ZERO, |at| at.saturating_duration_since(Instant::now()))
    }

    fn flush(&self) {
        let until = Instant::now() + LAST_LINES;
        self.drain();
        while !self.out.is_quiet() && !self.is_done() && Instant::now() < until {
            std::thread::sleep(LAST_LOOK);
            self.hurry();
            self.drain();
        }
        self.give_up();
    }

    /// Whether nothing waits, and no other thread has a line in hand: it has taken it from its queue already.
    fn is_done(&self) -> bool {
        self.out.way().is_some_and(|way| way.held.is_none() && self.lanes.iter().all(|lane| lane.queue.is_empty()))
    }

    /// There is no time left for patience.
    fn hurry(&self) {
        if let Some(mut way) = self.out.way() {
            way.retry_at = way.retry_at.map(|at| at.min(Instant::now() + LAST_LOOK));
        }
    }

    /// What is left by now is lost, and said to be.
    fn give_up(&self) {
        let held = self.out.way().and_then(|mut way| way.held.take_if(|line| line.module() == self.me));
        if let Some(line) = held {
            self.out.held.store(false, Ordering::Relaxed);
            self.lose(&line);
        }
        for lane in &self.lanes {
            std::iter::from_fn(|| lane.queue.pop()).take(lane.queue.capacity()).for_each(|line| self.lose(&line));
        }
    }

    /// A thread that finds the way taken leaves its line to the one that has it: nobody waits.
    fn drain(&self) {
        // Bounded: a thread that says more and more must not keep this one at it.
        for _ in 0..WAITING_MAX.iter().sum() {
            if self.is_idle() {
                return;
            }
            let Some(mut way) = self.out.way() else { return };
            if !way.open(&self.participant, self.to) {
                return;
            }
            let held = way.held.take();
            if let Some(line) = held.or_else(|| self.lanes.iter().find_map(|lane| lane.queue.pop()))
                && !self.send(&mut way, line)
            {
                return;
            }
            // Released, then looked at again: a line that came while it was held has nobody else.
        }
    }

    /// False when nothing more goes through now.
    fn send(&self, way: &mut Outlet, mut line: OutputLine) -> bool {
        // The line that was held back may be that of another module for which this process speaks.
        let own = line.module() == self.me;
        line.lost = if own { self.lost_now.swap(0, Ordering::Relaxed) } else { 0 };
        let label =
            Label { from: self.from, kind: Type::data(1), id: 0, priority: self.priority, options: Options::STAMPED };
        way.bytes.clear();
        // A line can be written: text and numbers.
        let _ = crate::call::append(&mut way.bytes, &line);
        let (stamp_ns, sequence, missed) = (line.time_ns, way.sequence, line.lost);
        let head = DataHead { stamp_ns, sequence, missed, incarnation: 0 };
        let Some(sender) = &mut way.sender else { return false };
        let sent = sender.send(&label, &[&head.to_bytes(), &way.bytes]);
        self.out.held.store(false, Ordering::Relaxed);
        let Err(error) = sent else {
            way.sequence = way.sequence.wrapping_add(1);
            way.failures = 0;
            if own {
                self.print.sent(line.level, &line.full_text());
            }
            return true;
        };
        self.lost_now.fetch_add(line.lost, Ordering::Relaxed);
        if let SendError::TooLarge { .. } = error {
            // It never will fit, and those behind it may.
            self.lose(&line);
            return true;
        }
        let gone = matches!(error, SendError::NoMailbox(_) | SendError::NoRouter { .. });
        if gone {
            way.sender = None;
        }
        way.retry_at = Some(Instant::now() + if gone { way.away() } else { RETRY_FULL });
        way.held = Some(OutputLine { lost: 0, ..line });
        self.out.held.store(true, Ordering::Relaxed);
        false
    }
}
