//! From `tracing` events to packages.

use super::{CLASS, LINES, OutputLine, TEXT_MAX};
use crate::common::{DataHead, OutputLevel};
use crossbeam_queue::ArrayQueue;
use rohrpost_config::{Installation, Level};
use rohrpost_mailbox::{Label, Name, Options, Participant, Priority, SendError, Sender, SystemClock, Type};
use std::fmt::{self, Write};
use std::sync::atomic::{AtomicU8, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, TryLockError};
use std::time::{Duration, Instant};
use tracing::field::{Field, Visit};
use tracing::subscriber::Interest;
use tracing::{Event, Metadata, Subscriber};
use tracing_subscriber::layer::{Context, Layer, SubscriberExt};

/// Lines that wait in this process while the collector is not there or has no room.
const WAITING_MAX: usize = 256;
/// How often a collector that was not there is looked for again.
const RETRY: Duration = Duration::from_millis(200);
/// How soon one that had no room is tried again.
const RETRY_FULL: Duration = Duration::from_millis(20);

static OUTPUT: OnceLock<Output> = OnceLock::new();

struct Output {
    me: Name,
    to: Name,
    priority: Priority,
    /// An [`OutputLevel`] as a number.
    level: AtomicU8,
    clock: SystemClock,
    waiting: ArrayQueue<OutputLine>,
    /// Lost since the last line that got through.
    lost_now: AtomicU32,
    lost: AtomicU64,
    way: Mutex<Way>,
    /// Also print lines from this level on.
    print: OutputLevel,
}

struct Way {
    participant: Arc<Participant>,
    sender: Option<Sender>,
    retry_at: Option<Instant>,
    bytes: Vec<u8>,
    sequence: u32,
}

/// Makes this process's `tracing` events lines of this module. The first caller in a process decides.
pub fn install(participant: &Arc<Participant>, installation: &Installation, me: Name, launched: bool) {
    let Some(class) = installation.classes.id(CLASS) else { return };
    // By hand, the person at the terminal is told; launched, only what launch may have to repeat goes to standard error.
    let print = if launched { OutputLevel::Error } else { OutputLevel::Trace };
    let way = Way {
        participant: participant.clone(),
        sender: None,
        retry_at: None,
        bytes: Vec::with_capacity(1024),
        sequence: 0,
    };
    let output = Output {
        me,
        to: Name::new(me.system(), class.0, 0, LINES),
        priority: class.priority(),
        level: AtomicU8::new(level_of(installation.output.level_of(me)) as u8),
        clock: SystemClock::open(participant.node()),
        waiting: ArrayQueue::new(WAITING_MAX),
        lost_now: AtomicU32::new(0),
        lost: AtomicU64::new(0),
        way: Mutex::new(way),
        print,
    };
    if OUTPUT.set(output).is_ok() {
        let subscriber = tracing_subscriber::registry().with(OutputLayer);
        // Fails only if the program set one of its own; then that one has the lines.
        let _ = tracing::subscriber::set_global_default(subscriber);
        std::panic::set_hook(Box::new(|panic| {
            // Its own words are: panicked at FILE:LINE:COLUMN, and below them the reason.
            tracing::error!("{panic}");
            drain();
        }));
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

fn level_of_event(level: &tracing::Level) -> OutputLevel {
    match *level {
        tracing::Level::ERROR => OutputLevel::Error,
        tracing::Level::WARN => OutputLevel::Warn,
        tracing::Level::INFO => OutputLevel::Info,
        tracing::Level::DEBUG => OutputLevel::Debug,
        tracing::Level::TRACE => OutputLevel::Trace,
    }
}

/// Sets which lines this process sends from now on.
pub fn set_level(level: OutputLevel) {
    if let Some(output) = OUTPUT.get() {
        output.level.store(level as u8, Ordering::Relaxed);
    }
}

/// Whether events become lines, and are printed where that is wanted.
pub(crate) fn is_installed() -> bool {
    OUTPUT.get().is_some()
}

/// Lines lost so far.
pub fn lost() -> u64 {
    OUTPUT.get().map_or(0, |output| output.lost.load(Ordering::Relaxed))
}

/// Sends the lines that wait, as far as there is room.
pub fn drain() {
    if let Some(output) = OUTPUT.get() {
        output.drain();
    }
}

/// When to call [`drain`] again, if lines wait.
pub fn retry_at() -> Option<Instant> {
    let output = OUTPUT.get().filter(|output| !output.waiting.is_empty())?;
    Some(Instant::now() + RETRY_FULL.max(output.patience()))
}

impl Output {
    fn say(&self, level: OutputLevel, text: String) {
        if level <= self.print {
            super::print(&format_args!("{:5} {text}", level.name()));
        }
        let line = OutputLine { time_ns: self.clock.now().ns, module: self.me.raw(), level, lost: 0, text };
        if self.waiting.push(line).is_err() {
            self.lose_one();
        }
        self.drain();
    }

    fn lose_one(&self) {
        self.lost_now.fetch_add(1, Ordering::Relaxed);
        self.lost.fetch_add(1, Ordering::Relaxed);
    }

    fn patience(&self) -> Duration {
        match self.way.try_lock() {
            Ok(way) => way.retry_at.map_or(Duration::ZERO, |at| at.saturating_duration_since(Instant::now())),
            Err(_) => Duration::ZERO,
        }
    }

    /// Whoever finds the way taken leaves its line to the one who has it: nobody waits.
    fn drain(&self) {
        // Bounded: a thread that says more and more must not keep this one at it.
        for _ in 0..WAITING_MAX {
            if self.waiting.is_empty() {
                return;
            }
            let mut way = match self.way.try_lock() {
                Ok(way) => way,
                Err(TryLockError::Poisoned(way)) => way.into_inner(),
                Err(TryLockError::WouldBlock) => return,
            };
            if !way.open(self.to) {
                return;
            }
            if let Some(line) = self.waiting.pop()
                && !self.send(&mut way, line)
            {
                return;
            }
            // Released, then looked at again: a line that came while it was held has nobody else.
        }
    }

    /// False when nothing more goes through now.
    fn send(&self, way: &mut Way, mut line: OutputLine) -> bool {
        line.lost = self.lost_now.swap(0, Ordering::Relaxed);
        let label =
            Label { from: self.me, kind: Type::data(1), id: 0, priority: self.priority, options: Options::STAMPED };
        way.bytes.clear();
        // A line can be written: text and numbers.
        let _ = crate::interface::append(&mut way.bytes, &line);
        let head = DataHead { stamp_ns: line.time_ns, sequence: way.sequence, missed: line.lost };
        let Some(sender) = &mut way.sender else { return false };
        match sender.send(&label, &[&head.to_bytes(), &way.bytes]) {
            Ok(()) => {
                way.sequence = way.sequence.wrapping_add(1);
                true
            }
            Err(error) => {
                self.lost_now.fetch_add(line.lost, Ordering::Relaxed);
                if let SendError::TooLarge { .. } = error {
                    // It never will fit, and those behind it may.
                    self.lose_one();
                    return true;
                }
                let gone = matches!(error, SendError::NoMailbox(_));
                if gone {
                    way.sender = None;
                }
                way.retry_at = Some(Instant::now() + if gone { RETRY } else { RETRY_FULL });
                // Back to the end of the queue: its time tells where it belongs.
                if self.waiting.push(OutputLine { lost: 0, ..line }).is_err() {
                    self.lose_one();
                }
                false
            }
        }
    }
}

impl Way {
    fn open(&mut self, to: Name) -> bool {
        if self.retry_at.is_some_and(|at| Instant::now() < at) {
            return false;
        }
        if self.sender.is_none() {
            self.sender = self.participant.sender(to).ok();
            self.retry_at = self.sender.is_none().then(|| Instant::now() + RETRY);
        }
        self.sender.is_some()
    }
}

struct OutputLayer;

impl<S: Subscriber> Layer<S> for OutputLayer {
    fn register_callsite(&self, _: &'static Metadata<'static>) -> Interest {
        // The level changes at run time, so each event asks.
        Interest::sometimes()
    }

    fn enabled(&self, metadata: &Metadata<'_>, _: Context<'_, S>) -> bool {
        let Some(output) = OUTPUT.get() else { return false };
        level_of_event(metadata.level()) as u8 <= output.level.load(Ordering::Relaxed)
    }

    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let Some(output) = OUTPUT.get() else { return };
        let mut text = Text(String::new());
        event.record(&mut text);
        let mut text = text.0;
        if text.len() > TEXT_MAX {
            let end = (0..=TEXT_MAX - 4).rev().find(|at| text.is_char_boundary(*at)).unwrap_or(0);
            text.truncate(end);
            text.push('…');
        }
        output.say(level_of_event(event.metadata().level()), text);
    }
}

/// An event's message, then its other fields.
struct Text(String);

impl Visit for Text {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        let space = if self.0.is_empty() { "" } else { " " };
        // Writing to a string does not fail.
        let _ = match field.name() {
            "message" => write!(self.0, "{space}{value:?}"),
            name => write!(self.0, "{space}{name}={value:?}"),
        };
    }
}
