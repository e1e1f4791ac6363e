//! What a module's process prints: remembered by launch, and passed on to the collector of output.
//!
//! ```text
//!  stdout ─▶ thread ─┬─▶ the last lines, for launch to tell when it ends
//!  stderr ─▶ thread ─┴─▶ held for a moment ─▶ collector: info, warn; error for stderr if the process fails then
//! ```
//!
//! The threads never wait for launch or the collector, so a module that prints is never kept from it. What is too much
//! is suppressed and counted like what a module says. Lines that the module has sent itself are marked, and only
//! remembered; so are those that say where a panic came from, which launch tells once and not again as long as they
//! stay the same.

use rohrpost_modules::common::OutputLevel;
use rohrpost_modules::launch_support::{OutputProxy, SENT, TRACE_LINES_MAX, TRACED, WeakOutputProxy};
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
    lines: Arc<Mutex<PrintedLines>>,
    readers: Vec<JoinHandle<()>>,
    voice: Option<OutputProxy>,
    /// Where the panic came from that was told last.
    told: Vec<String>,
}

#[derive(Default)]
struct PrintedLines {
    last: VecDeque<String>,
    /// Where its panic came from.
    trace: Vec<String>,
    held: VecDeque<Held>,
    /// Nothing is passed on before.
    quiet_until: Option<Instant>,
}

impl PrintedLines {
    /// Takes the next line that was held long enough.
    fn take_due(&mut self, now: Instant) -> Option<Held> {
        if self.due_at()? <= now { self.held.pop_front() } else { None }
    }

    /// When the next line has been held long enough.
    fn due_at(&self) -> Option<Instant> {
        let at = self.held.front()?.since + HOLD;
        Some(self.quiet_until.map_or(at, |until| until.max(at)))
    }

    /// Drops what is held, if its process has ended while nothing was to be passed on.
    fn drop_quiet(&mut self, ended: Instant) {
        if self.quiet_until.is_some_and(|until| ended < until) {
            self.held.clear();
        }
    }
}

/// A line that is to be passed on.
struct Held {
    level: OutputLevel,
    time_ns: u64,
    since: Instant,
    text: String,
}

impl Printed {
    /// Lines of a module; `voice` publishes them, if anybody subscribes.
    pub(super) fn new(voice: Option<OutputProxy>) -> Self {
        Self { lines: Arc::default(), readers: Vec::new(), voice, told: Vec::new() }
    }

    /// Where the next process prints to: its standard output and standard error. What the one before said is forgotten.
    /// `quiet_until`: before then nothing of it is passed on.
    pub(super) fn begin(&mut self, quiet_until: Option<Instant>) -> io::Result<[PipeWriter; 2]> {
        self.pass_on(false);
        // Of its own: processes that were left behind and still print must not mix with what follows.
        self.lines = Arc::new(Mutex::new(PrintedLines { quiet_until, ..PrintedLines::default() }));
        self.readers.clear();
        let out = self.read("stdout", OutputLevel::Info)?;
        Ok([out, self.read("stderr", OutputLevel::Warn)?])
    }

    fn read(&mut self, name: &str, level: OutputLevel) -> io::Result<PipeWriter> {
        let (pipe, writer) = io::pipe()?;
        let lines = self.lines.clone();
        let whisper = self.voice.as_ref().map(OutputProxy::whisper);
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
    pub(super) fn say(&self, level: OutputLevel, text: &str, errno: Option<u16>) {
        if let Some(voice) = &self.voice {
            voice.say(level, voice.now_ns(), text.to_owned(), errno);
        }
    }

    /// Passes lines on that were held long enough.
    pub(super) fn attend(&self, now: Instant) {
        let Some(voice) = &self.voice else { return };
        loop {
            // One at a time: the thread that reads must not wait for the collector's mailbox.
            let due = lock(&self.lines).take_due(now);
            let Some(line) = due else { break };
            voice.say(line.level, line.time_ns, line.text, None);
        }
        voice.attend();
    }

    /// When to attend to it again.
    pub(super) fn attend_at(&self) -> Option<Instant> {
        let due_at = lock(&self.lines).due_at();
        due_at.into_iter().chain(self.voice.as_ref()?.retry_at()).min()
    }

    /// The process has ended, and launch has told the like before: what it printed while nothing was to be passed on is
    /// not said.
    pub(super) fn drop_quiet(&mut self, now: Instant) {
        lock(&self.lines).drop_quiet(now);
    }

    /// The process has ended: passes on what is held. If it failed, what came by standard error were its last words.
    pub(super) fn pass_on(&mut self, failed: bool) {
        let Some(voice) = &self.voice else { return };
        let held = std::mem::take(&mut lock(&self.lines).held);
        for line in held {
            let last_words = failed && line.level == OutputLevel::Warn;
            let level = if last_words { OutputLevel::Error } else { line.level };
            voice.say(level, line.time_ns, line.text, None);
        }
    }
}

fn below<'a>(lines: impl IntoIterator<Item = &'a String>) -> String {
    lines.into_iter().map(|line| format!("\n    {line}")).collect()
}

fn lock(lines: &Mutex<PrintedLines>) -> MutexGuard<'_, PrintedLines> {
    lines.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The next line, or so much of a longer one. `rest` is what was read of the one behind it.
fn next_line(pipe: &mut impl BufRead, rest: &mut Vec<u8>) -> Option<String> {
    let room = LINE_BYTES_MAX.saturating_sub(rest.len() as u64);
    let read = io::Read::take(&mut *pipe, room).read_until(b'\n', rest).unwrap_or(0);
    if read == 0 && rest.is_empty() {
        return None;
    }
    // A character is in one of the two lines.
    let is_cut = rest.len() as u64 >= LINE_BYTES_MAX && !rest.ends_with(b"\n");
    let behind = if is_cut { rest.split_off(begun_character(rest)) } else { Vec::new() };
    let text = String::from_utf8_lossy(rest).trim_end().to_owned();
    *rest = behind;
    Some(text)
}

/// Where the character begins that is not complete at the end of these bytes; their end if all are.
fn begun_character(bytes: &[u8]) -> usize {
    let last = bytes.utf8_chunks().last().map_or(&[][..], |chunk| chunk.invalid());
    let is_begun = std::str::from_utf8(last).is_err_and(|error| error.error_len().is_none());
    bytes.len() - if is_begun { last.len() } else { 0 }
}

/// Keeps the last lines that come through a pipe, until it closes.
fn keep(pipe: PipeReader, level: OutputLevel, lines: &Mutex<PrintedLines>, whisper: Option<&WeakOutputProxy>) {
    let mut pipe = BufReader::new(pipe);
    let mut line = Vec::new();
    while let Some(text) = next_line(&mut pipe, &mut line) {
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
        let voice = whisper.and_then(WeakOutputProxy::voice).filter(|_| !sent && !text.is_empty());
        let pressed = voice.as_ref().and_then(|voice| {
            let mut lines = lock(lines);
            lines.held.push_back(Held { level, time_ns: voice.now_ns(), since: Instant::now(), text: text.clone() });
            // Of a process that prints so much, the oldest held line is passed on at once.
            if lines.held.len() > LINES_MAX { lines.held.pop_front() } else { None }
        });
        let mut lines = lock(lines);
        if lines.last.len() == LINES_MAX {
            lines.last.pop_front();
        }
        lines.last.push_back(text);
        drop(lines);
        if let (Some(voice), Some(line)) = (voice, pressed) {
            voice.say(line.level, line.time_ns, line.text, None);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_line_is_cut_between_characters_wherever_it_is_cut() {
        for (letter, in_front) in [("é", 0), ("é", 1), ("→", 0), ("→", 1), ("→", 2), ("🤖", 1), ("🤖", 2), ("🤖", 3)]
        {
            let text = format!("{}{}", "x".repeat(in_front), letter.repeat(5000));
            let (mut pipe, mut rest) = (text.as_bytes(), Vec::new());
            let lines: Vec<String> = std::iter::from_fn(|| next_line(&mut pipe, &mut rest)).collect();
            assert_eq!(lines.concat(), text, "nothing is lost, and nothing is replaced");
            assert!(lines.iter().all(|line| line.len() as u64 <= LINE_BYTES_MAX));
        }
        // What is no text stays as long as it is.
        let bytes = [0xff; 5000];
        let (mut pipe, mut rest) = (&bytes[..], Vec::new());
        let lines: Vec<String> = std::iter::from_fn(|| next_line(&mut pipe, &mut rest)).collect();
        let letters: usize = lines.iter().map(|line| line.chars().count()).sum();
        assert_eq!((lines.len(), letters), (2, 5000));
    }

    const QUIET: Duration = Duration::from_secs(10);

    /// Of a process that was started at `start` and printed at these times after it.
    fn printed(start: Instant, quiet: Option<Duration>, after: &[Duration]) -> PrintedLines {
        let line = |&after| Held { level: OutputLevel::Info, time_ns: 0, since: start + after, text: String::new() };
        PrintedLines {
            held: after.iter().map(line).collect(),
            quiet_until: quiet.map(|quiet| start + quiet),
            ..PrintedLines::default()
        }
    }

    #[test]
    fn a_line_is_held_for_a_moment_and_the_first_ones_until_it_is_no_longer_quiet() {
        let (start, day) = (Instant::now(), Duration::from_secs(86_400));
        for (quiet, after, due) in [
            (None, Duration::ZERO, HOLD),
            (None, day, day + HOLD),
            (Some(QUIET), Duration::ZERO, QUIET),
            (Some(QUIET), QUIET - HOLD / 2, QUIET + HOLD / 2),
            (Some(QUIET), day, day + HOLD),
        ] {
            let mut lines = printed(start, quiet, &[after]);
            assert_eq!(lines.due_at(), Some(start + due), "quiet for {quiet:?}, printed after {after:?}");
            assert!(lines.take_due(start + due - Duration::from_nanos(1)).is_none());
            assert!(lines.take_due(start + due).is_some());
            assert_eq!(lines.due_at(), None);
        }
    }

    #[test]
    fn what_it_printed_last_is_dropped_only_if_it_ended_while_quiet() {
        let start = Instant::now();
        for (quiet, ended, left) in [(Some(QUIET), QUIET / 2, 0), (Some(QUIET), QUIET * 3, 2), (None, HOLD / 2, 2)] {
            let mut lines = printed(start, quiet, &[ended - HOLD / 2, ended - HOLD / 4]);
            lines.drop_quiet(start + ended);
            assert_eq!(lines.held.len(), left, "quiet for {quiet:?}, ended after {ended:?}");
        }
    }
}
