//! Who sees to it that there is a stream, and that a stuck one stays alone with it.
//!
//! ```text
//!   away ──connected──▶ asked ──answered──▶ draws ──gone, or stands still: cut──▶ away, after a while
//! ```
//!
//! A thread of its own connects, starts the [`Feeder`], and looks at it every [`LOOK`]. There is never more than one feeder:
//! before the next begins, the last one's line is cut and it has ended. So at any time the bridge holds one stream, with
//! [`crate::sink`]'s bound on what waits in it, and one store, with its own.
//!
//! Nothing is counted by the clock but by looks: on a computer that has no time for the bridge, nobody looks either, and what
//! is merely late is not taken for stuck.

use crate::feeder::{FeedError, Feeder};
use crate::line::Line;
use crate::sink::{self, Address, Canvas, CloseError, Sink, Surface};
use crate::store::Store;
use rerun::ApplicationId;
use rerun::external::re_log_types::RecordingId;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How often the feeder is looked at.
const LOOK: Duration = Duration::from_millis(50);
/// Looks at a call that does not come back: 0.5 s.
const LOOKS_AT_CALL: u32 = 10;
/// After a stream that stood still soon, the next is given twice the looks, up to so many times: a computer that is merely
/// overloaded would else begin anew without end.
const LENIENCE_MAX: u32 = 16;
/// Looks at threads of the stream that do not move (a pulse may have to wait behind much work), and at a viewer that was
/// connected to and says nothing: 3 s.
const LOOKS_AT_PULSE: u32 = 60;
/// A viewer that is there takes a connection within this time.
const CONNECT: Duration = Duration::from_secs(1);
/// Waits between attempts to connect.
const BACKOFF: std::ops::RangeInclusive<Duration> = Duration::from_millis(200)..=Duration::from_secs(4);
/// A stream that drew for so long was a good one: the next attempt need not wait long.
const GOOD: Duration = Duration::from_secs(5);
/// A feeder whose line was cut has ended by then.
const END: Duration = Duration::from_secs(10);
/// What a viewer has not taken by then when drawing ends, it does not get.
const LAST_TO_VIEWER: Duration = Duration::from_secs(1);
/// The same for a file, the time in which it is flushed included.
const LAST_TO_FILE: Duration = Duration::from_secs(6);

struct Shared {
    store: Arc<Store>,
    closing: AtomicBool,
    /// Why nothing is drawn any more, and never will be.
    failure: Mutex<Option<String>>,
}

/// See the module's text.
pub(crate) struct Pen {
    shared: Arc<Shared>,
    thread: JoinHandle<Result<(), CloseError>>,
}

/// How a stream ended.
enum End {
    /// All was written, or its feeder failed.
    Ended,
    /// The file is as large as it may be.
    Full,
    /// The viewer has closed the connection.
    Gone,
    /// The viewer takes nothing any more.
    Still,
}

impl Pen {
    /// Begins to draw what comes to the store.
    pub(crate) fn begin(sink: Sink, application: ApplicationId, store: Arc<Store>) -> Result<Self, sink::OpenError> {
        let address = match &sink {
            Sink::Viewer(url) => Some(Address::parse(url)?),
            Sink::Window => Some(Address::of_window()),
            Sink::File { path, .. } => {
                // Before anything else, so that a wrong path is told to whoever wrote it.
                let made = put_aside(path).and_then(|()| std::fs::File::create(path));
                made.map_err(|cause| sink::OpenError::File { path: path.clone(), cause })?;
                None
            }
        };
        let recording = RecordingId::random();
        let shared = Arc::new(Shared { store, closing: AtomicBool::new(false), failure: Mutex::new(None) });
        let canvas = move |surface| Canvas { application: application.clone(), recording: recording.clone(), surface };
        let mut work = Work { shared: shared.clone(), canvas: Box::new(canvas), streams: 0, lenience: 1 };
        let run = move || match (sink, address) {
            (Sink::File { path, bytes_max }, _) => work.files(&path, bytes_max),
            (Sink::Window, Some(address)) => match sink::start_window() {
                Ok(()) => work.viewer(&address),
                Err(error) => {
                    work.fail(&error);
                    Ok(())
                }
            },
            (_, Some(address)) => work.viewer(&address),
            (_, None) => Ok(()),
        };
        let thread = std::thread::Builder::new().name("pen".into()).spawn(run)?;
        Ok(Self { shared, thread })
    }

    /// Why nothing is drawn any more, if so. A viewer that is away is no such reason.
    pub(crate) fn failure(&self) -> Option<String> {
        self.shared.failure.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Draws what waits, and ends; within [`LAST_TO_FILE`], whatever the sink does.
    pub(crate) fn close(self) -> Result<(), CloseError> {
        self.shared.store.close();
        self.shared.closing.store(true, Ordering::Relaxed);
        self.thread.thread().unpark();
        let deadline = Instant::now() + LAST_TO_FILE + LAST_TO_VIEWER;
        while !self.thread.is_finished() {
            if Instant::now() >= deadline {
                // It holds one stream, and ends when the disk comes back, or with the process.
                return Err(CloseError::Stuck);
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        self.thread.join().unwrap_or(Err(CloseError::Stuck))
    }
}

/// Where a drawing goes when another begins in its place.
fn old(path: &Path) -> PathBuf {
    path.with_extension("old.rrd")
}

/// Keeps the drawing of an earlier run: a bridge that is started again must not destroy what it drew before.
fn put_aside(path: &Path) -> std::io::Result<()> {
    // Devices and pipes stay where they are, and an empty file is no loss.
    if path.metadata().is_ok_and(|file| file.is_file() && file.len() > 0) {
        std::fs::rename(path, old(path))?;
        tracing::info!("the drawing before is {} now", old(path).display());
    }
    Ok(())
}

/// What the thread has.
struct Work {
    shared: Arc<Shared>,
    canvas: Box<dyn Fn(Surface) -> Canvas + Send>,
    streams: u64,
    lenience: u32,
}

impl Work {
    /// One file after the other, each the whole picture from its first moment on.
    fn files(&mut self, path: &Path, bytes_max: u64) -> Result<(), CloseError> {
        loop {
            let feeder = match self.feeder(Surface::File(path.into()), || true, true) {
                Ok(feeder) => feeder,
                Err(error) => {
                    self.fail(&error);
                    return Ok(());
                }
            };
            let is_full = || path.metadata().is_ok_and(|file| file.len() >= bytes_max);
            let end = self.watch(&feeder, None, &is_full);
            feeder.finish();
            if !ended_within(&feeder, LAST_TO_FILE) {
                self.fail(&format_args!("{} does not take the end of the drawing", path.display()));
                return Err(CloseError::Stuck);
            }
            match (end, feeder.failure()) {
                (_, Some(FeedError::Close(error))) => return Err(error),
                (_, Some(error)) => {
                    self.fail(&error);
                    return Ok(());
                }
                (End::Full, None) => {
                    let old = old(path);
                    if let Err(error) = std::fs::rename(path, &old) {
                        self.fail(&format_args!("cannot rename {} to {}: {error}", path.display(), old.display()));
                        return Ok(());
                    }
                    tracing::info!("the drawing is full; it is {} now, and a new one begins", old.display());
                }
                _ => return Ok(()),
            }
        }
    }

    /// One connection after the other.
    fn viewer(&mut self, address: &Address) -> Result<(), CloseError> {
        let mut backoff = *BACKOFF.start();
        let mut told = "";
        // A viewer that has just begun knows no lines; one that stood still for a while has seen those that were drawn.
        let mut lines = true;
        let url = &address.url;
        while !self.is_closing() {
            let began = Instant::now();
            let line = match Line::open(&address.host, address.port, CONNECT) {
                Ok(line) => Arc::new(line),
                Err(error) => {
                    lines = true;
                    if told.is_empty() {
                        tracing::warn!("no viewer at {url} yet ({error}); drawing begins when it comes");
                        told = "absent";
                    }
                    self.rest(&mut backoff);
                    continue;
                }
            };
            let (watched, store) = (line.clone(), self.shared.store.clone());
            let feeder = match self.feeder(Surface::Line(line.url()), move || watched.has_answered(), lines) {
                Ok(feeder) => feeder,
                Err(error) => {
                    self.fail(&error);
                    return Ok(());
                }
            };
            if self.answers(&feeder, &line) && told != "draws" {
                tracing::info!("draws to the viewer at {url}");
                told = "draws";
            }
            let end = self.watch(&feeder, Some(&line), &|| false);
            let (was_broken, had_answered) = (line.is_broken(), line.has_answered());
            feeder.give_up();
            line.cut();
            if !ended_within(&feeder, END) {
                self.fail(&"Rerun does not come back from a call; switch this module off and on");
                return Err(CloseError::Stuck);
            }
            match (end, feeder.failure()) {
                (_, Some(error @ (FeedError::Layout(_) | FeedError::Open(_)))) if !was_broken => {
                    self.fail(&error);
                    return Ok(());
                }
                (End::Still, _) => {
                    store.count(|counts| counts.stuck += 1);
                    lines = false;
                    if told != "still" {
                        tracing::warn!("the viewer at {url} stands still; drawing goes on when it moves again");
                        told = "still";
                    }
                }
                (End::Gone, _) => {
                    lines = true;
                    if told != "gone" {
                        tracing::warn!("the viewer at {url} has gone; drawing goes on when it is back");
                        told = "gone";
                    }
                }
                _ => {}
            }
            if began.elapsed() >= GOOD {
                (backoff, self.lenience) = (*BACKOFF.start(), 1);
            } else if had_answered && told == "still" {
                self.lenience = (self.lenience * 2).min(LENIENCE_MAX);
            }
            self.rest(&mut backoff);
        }
        Ok(())
    }

    /// A stream, which is given all that is known.
    fn feeder(
        &mut self,
        surface: Surface,
        may_begin: impl Fn() -> bool + Send + 'static,
        lines: bool,
    ) -> std::io::Result<Feeder> {
        let store = &self.shared.store;
        if self.streams > 0 {
            store.again(lines);
            store.count(|counts| counts.rebuilt += 1);
        }
        self.streams += 1;
        Feeder::begin((self.canvas)(surface), store.clone(), may_begin)
    }

    /// Waits for the viewer's first word.
    fn answers(&self, feeder: &Feeder, line: &Line) -> bool {
        for _ in 0..LOOKS_AT_PULSE {
            if line.has_answered() || line.is_broken() || feeder.has_ended() || self.is_closing() {
                break;
            }
            std::thread::park_timeout(LOOK);
        }
        line.has_answered()
    }

    /// Until the stream has to end.
    fn watch(&self, feeder: &Feeder, line: Option<&Line>, is_full: &dyn Fn() -> bool) -> End {
        let mut seen = [(None, 0u32); 2];
        let mut last = None;
        let mut told = false;
        loop {
            if line.is_some_and(Line::is_broken) {
                return End::Gone;
            }
            if feeder.has_ended() {
                return End::Ended;
            }
            if line.is_some_and(|line| !line.has_answered()) {
                return if self.is_closing() { End::Ended } else { End::Still };
            }
            if self.is_closing() {
                let until = last
                    .get_or_insert_with(|| Instant::now() + if line.is_some() { LAST_TO_VIEWER } else { LAST_TO_FILE });
                if Instant::now() >= *until {
                    return End::Ended;
                }
            } else if is_full() {
                return End::Full;
            }
            for ((before, looks), now) in seen.iter_mut().zip(feeder.waits_for()) {
                *looks = if now.is_some() && now == *before { *looks + 1 } else { 0 };
                *before = now;
            }
            let still = seen[0].1 >= LOOKS_AT_CALL * self.lenience || seen[1].1 >= LOOKS_AT_PULSE * self.lenience;
            if still && line.is_some() {
                return End::Still;
            }
            // A disk cannot be cut off; it is waited for, and what comes meanwhile replaces what waits.
            if still && !told {
                self.shared.store.count(|counts| counts.stuck += 1);
                tracing::warn!("the disk stands still; drawing goes on when it moves again");
            }
            told = still;
            std::thread::park_timeout(LOOK);
        }
    }

    fn rest(&self, backoff: &mut Duration) {
        let until = Instant::now() + *backoff;
        while !self.is_closing() && Instant::now() < until {
            std::thread::park_timeout(until.saturating_duration_since(Instant::now()));
        }
        *backoff = (*backoff * 2).min(*BACKOFF.end());
    }

    fn is_closing(&self) -> bool {
        self.shared.closing.load(Ordering::Relaxed)
    }

    fn fail(&self, why: &dyn std::fmt::Display) {
        *self.shared.failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(why.to_string());
    }
}

fn ended_within(feeder: &Feeder, time: Duration) -> bool {
    let deadline = Instant::now() + time;
    while !feeder.has_ended() {
        if Instant::now() >= deadline {
            return false;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    true
}

#[cfg(test)]
mod tests;
