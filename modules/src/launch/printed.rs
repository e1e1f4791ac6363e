//! What a module's process prints: remembered by launch, and passed on to the collector of output.
//!
//! ```text
//!  stdout ─▶ thread ─┬─▶ the last lines, for launch to tell when it ends
//!  stderr ─▶ thread ─┴─▶ held for a moment ─▶ collector: info, warn; error for stderr if the process fails in that moment
//! ```
//!
//! The threads never wait for launch or the collector, so a module that prints is never kept from it. What is too much is
//! suppressed and counted like what a module says. Lines that the module has sent itself are marked, and only remembered; so are those
//! that say where a panic came from, which launch tells once and not again as long as they stay the same.

use crate::common::OutputLevel;
use crate::output::{SENT, TRACE_LINES_MAX, TRACED, Voice, Whisper};
use std::collections::VecDeque;
use std::io::{self, BufRead, BufReader, PipeReader, PipeWriter};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Lines that are kept to be told when it ends.
const LINES_MAX: usize = 64;
/// Longest line, bytes; the rest of a longer one is the next line.
const LINE_BYTES_MAX: u64 = 4096;
/// A line is held for so long before it is passed on: only then is it known that the process did not die of it.
const HOLD: Duration = Duration::from_millis(200);

/// What one process printed: the one that runs, or the one that ended last.
pub(super) struct Printed {
    lines: Arc<Mutex<Lines>>,
    readers: Vec<JoinHandle<()>>,
    voice: Option<Voice>,
    /// How long a line is held.
    hold: Duration,
    /// Where the panic came from that was told last.
    told: Vec<String>,
}

#[derive(Default)]
struct Lines {
    last: VecDeque<String>,
    /// Where its panic came from.
    trace: Vec<String>,
    held: VecDeque<Held>,
}

/// A line that is to be passed on.
struct Held {
    level: OutputLevel,
    time_ns: u64,
    since: Instant,
    text: String,
}

impl Printed {
    /// Of a module; `voice` speaks for it, if anybody listens.
    pub(super) fn new(voice: Option<Voice>) -> Self {
        Self { lines: Arc::default(), readers: Vec::new(), voice, hold: HOLD, told: Vec::new() }
    }

    /// Where the next process prints to: its standard output and standard error. What the one before said is forgotten.
    /// `quiet`: for so long nothing of it is passed on.
    pub(super) fn begin(&mut self, quiet: Option<Duration>) -> io::Result<[PipeWriter; 2]> {
        self.pass_on(None);
        self.hold = quiet.unwrap_or(HOLD);
        // Of its own: who left processes behind that still print must not mix with what follows.
        self.lines = Arc::default();
        self.readers.clear();
        let out = self.read("stdout", OutputLevel::Info)?;
        Ok([out, self.read("stderr", OutputLevel::Warn)?])
    }

    fn read(&mut self, name: &str, level: OutputLevel) -> io::Result<PipeWriter> {
        let (pipe, writer) = io::pipe()?;
        let lines = self.lines.clone();
        let whisper = self.voice.as_ref().map(Voice::whisper);
        let read = move || keep(pipe, level, &lines, whisper.as_ref());
        self.readers.push(std::thread::Builder::new().name(name.into()).spawn(read)?);
        Ok(writer)
    }

    /// Whether all that it printed has come. A process may leave others behind that hold its pipe: then never.
    pub(super) fn is_complete(&self) -> bool {
        self.readers.iter().all(JoinHandle::is_finished)
    }

    /// All that is kept, each line on one of its own below what was said before.
    pub(super) fn below(&self) -> String {
        below(&lock(&self.lines).last)
    }

    /// Where its panic came from, likewise; nothing, if that was told of an earlier one.
    pub(super) fn trace_below(&mut self) -> String {
        let trace = std::mem::take(&mut lock(&self.lines).trace);
        if trace.is_empty() || trace == self.told {
            return String::new();
        }
        let text = below(&trace);
        self.told = trace;
        text
    }

    /// The last line that says something, empty if there is none.
    pub(super) fn last(&self) -> String {
        lock(&self.lines).last.iter().rev().find(|line| !line.is_empty()).cloned().unwrap_or_default()
    }

    /// Says of the module what launch has seen.
    pub(super) fn warn(&self, text: &str) {
        if let Some(voice) = &self.voice {
            voice.say(OutputLevel::Warn, voice.now_ns(), text.to_owned());
        }
    }

    /// Passes lines on that were held long enough.
    pub(super) fn attend(&self, now: Instant) {
        let Some(voice) = &self.voice else { return };
        loop {
            // One at a time: the thread that reads must not wait for the collector's mailbox.
            let mut lines = lock(&self.lines);
            let Some(line) = lines.held.pop_front_if(|line| now >= line.since + self.hold) else { break };
            drop(lines);
            voice.say(line.level, line.time_ns, line.text);
        }
        voice.attend();
    }

    /// When to attend to it again.
    pub(super) fn attend_at(&self) -> Option<Instant> {
        let held = lock(&self.lines).held.front().map(|line| line.since + self.hold);
        held.into_iter().chain(self.voice.as_ref()?.retry_at()).min()
    }

    /// Its process has ended, and what is held is not to be said: launch has told the like before.
    pub(super) fn drop_held(&mut self) {
        lock(&self.lines).held.clear();
    }

    /// Its process has ended: passes on what is held. If that was a failure, what came by standard error were its last words,
    /// and `why` is said below them.
    pub(super) fn pass_on(&mut self, why: Option<&str>) {
        let Some(voice) = &self.voice else { return };
        let held = std::mem::take(&mut lock(&self.lines).held);
        for line in held {
            let last_words = why.is_some() && line.level == OutputLevel::Warn;
            let level = if last_words { OutputLevel::Error } else { line.level };
            voice.say(level, line.time_ns, line.text);
        }
        if let Some(why) = why {
            voice.say(OutputLevel::Error, voice.now_ns(), why.to_owned());
        }
    }
}

fn below<'a>(lines: impl IntoIterator<Item = &'a String>) -> String {
    lines.into_iter().map(|line| format!("\n    {line}")).collect()
}

fn lock(lines: &Mutex<Lines>) -> MutexGuard<'_, Lines> {
    lines.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Keeps the last lines that come through a pipe, until it closes.
fn keep(pipe: PipeReader, level: OutputLevel, lines: &Mutex<Lines>, whisper: Option<&Whisper>) {
    let mut pipe = BufReader::new(pipe);
    let mut line = Vec::new();
    while let Ok(1..) = io::Read::take(&mut pipe, LINE_BYTES_MAX).read_until(b'\n', &mut line) {
        let text = String::from_utf8_lossy(&line).trim_end().to_owned();
        line.clear();
        if let Some(text) = text.strip_prefix(TRACED) {
            let trace = &mut lock(lines).trace;
            if trace.len() < TRACE_LINES_MAX {
                trace.push(text.to_owned());
            }
            continue;
        }
        let (text, sent) = match text.strip_prefix(SENT) {
            Some(text) => (text.to_owned(), true),
            None => (text, false),
        };
        let voice = whisper.and_then(Whisper::voice).filter(|_| !sent && !text.is_empty());
        let pressed = voice.as_ref().and_then(|voice| {
            let mut lines = lock(lines);
            lines.held.push_back(Held { level, time_ns: voice.now_ns(), since: Instant::now(), text: text.clone() });
            // Who prints so much has to do without the mercy of being held.
            if lines.held.len() > LINES_MAX { lines.held.pop_front() } else { None }
        });
        let mut lines = lock(lines);
        if lines.last.len() == LINES_MAX {
            lines.last.pop_front();
        }
        lines.last.push_back(text);
        drop(lines);
        if let (Some(voice), Some(line)) = (voice, pressed) {
            voice.say(line.level, line.time_ns, line.text);
        }
    }
}
