//! Supervises the drawing stream: starts it, detects that it is stuck, and replaces it.
//!
//! ```text
//!   away ──connected──▶ asked ──answered──▶ draws ──gone, or stands still: cut──▶ away, after a while
//! ```
//!
//! A thread of its own connects, or opens the file, starts the [`Feeder`], and checks it every [`CHECK_INTERVAL`].
//! There is never more than one feeder: before the next begins, the last one's proxy is cut and it has ended, however
//! long that takes. So at any time the bridge holds one stream, with [`crate::sink`]'s bound on what waits in it. A
//! supervisor that is told to end does so by itself; the next one waits for its [`Turn`].
//!
//! A disk is no failure either: the supervisor waits for a stalled disk, and retries a full one with a new file. A
//! failure is only what a person has to fix: a file that cannot be created.
//!
//! Timeouts count checks, not clock time: an overloaded computer also checks less often, so a late stream is not taken
//! for a stuck one.

use crate::feeder::{FeedError, Feeder};
use crate::files::{self, Room};
use crate::sink::{self, Address, CloseError, Sink, StreamConfig, StreamTarget};
use crate::store::Store;
use crate::viewer_proxy::ViewerProxy;
use rerun::ApplicationId;
use rerun::external::re_log_types::RecordingId;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How often the feeder is looked at.
const CHECK_INTERVAL: Duration = Duration::from_millis(50);
/// Checks of a call that does not return: 0.5 s.
const CHECKS_OF_CALL: u32 = 10;
/// After a stream that stood still soon, the next is given twice the checks, up to so many times: a computer that is
/// merely overloaded would else begin anew without end.
const LENIENCE_MAX: u32 = 16;
/// Checks of threads of the stream that do not move (a pulse may have to wait behind much work), and at a viewer that
/// was connected to and says nothing: 3 s.
const CHECKS_OF_PULSE: u32 = 60;
/// A viewer that is there takes a connection within this time.
const CONNECT: Duration = Duration::from_secs(1);
/// Waits between attempts to connect.
const BACKOFF: std::ops::RangeInclusive<Duration> = Duration::from_millis(200)..=Duration::from_secs(4);
/// The longest wait until a disk that was full is tried again: that writes all that is known.
const BACKOFF_FILE: Duration = Duration::from_secs(10);
/// A stream that drew for so long was a good one: the next attempt need not wait long.
const GOOD: Duration = Duration::from_secs(5);
/// Checks of a stream that has to end before a warning is given: 3 s.
const CHECKS_OF_END: u32 = 60;
/// What a viewer has not taken by then when drawing ends, it does not get.
const LAST_TO_VIEWER: Duration = Duration::from_secs(1);
/// The same for a file, the time in which it is flushed included.
const LAST_TO_FILE: Duration = Duration::from_secs(6);
/// Longest wait for the end of a drawing.
pub(crate) const LAST: Duration = LAST_TO_FILE.saturating_add(LAST_TO_VIEWER);

/// Supervisors that share one draw one after the other: two that write to one file would spoil it.
pub(crate) type Turn = Arc<Mutex<()>>;

struct SupervisorState {
    store: Arc<Store>,
    closing: AtomicBool,
    /// Why nothing is drawn any more, and never will be.
    failure: Mutex<Option<String>>,
}

/// See the module's text.
pub(crate) struct StreamSupervisor {
    shared: Arc<SupervisorState>,
    thread: JoinHandle<Result<(), CloseError>>,
}

/// How a stream ended.
enum StreamEnd {
    /// All was written, or its feeder failed.
    Ended,
    /// The file is as large as it may be.
    Full,
    /// The viewer has closed the connection.
    Gone,
    /// The viewer takes nothing any more.
    Still,
}

impl StreamSupervisor {
    /// Begins to draw what comes to the store, when it is its turn.
    pub(crate) fn begin(
        sink: Sink,
        application: ApplicationId,
        store: Arc<Store>,
        turn: Turn,
    ) -> Result<Self, sink::OpenError> {
        let address = match &sink {
            Sink::Viewer(url) => Some(Address::parse(url)?),
            Sink::Window => Some(Address::of_window()),
            Sink::File { .. } => None,
        };
        let recording = RecordingId::random();
        let shared = Arc::new(SupervisorState { store, closing: AtomicBool::new(false), failure: Mutex::new(None) });
        let config =
            move |target| StreamConfig { application: application.clone(), recording: recording.clone(), target };
        let mut work = SupervisorThread { shared: shared.clone(), config: Box::new(config), streams: 0, lenience: 1 };
        let run = move || {
            let Some(_turn) = work.turn(&turn) else { return Err(CloseError::Stuck) };
            let ended = match (sink, address) {
                (Sink::File { path, bytes_max }, _) => work.files(&path, bytes_max),
                (Sink::Window, Some(address)) => match sink::start_window() {
                    Ok(()) => work.viewer(&address),
                    Err(error) => work.fail(&error),
                },
                (_, Some(address)) => work.viewer(&address),
                (_, None) => Ok(()),
            };
            if let Err(error @ (CloseError::Flush(_) | CloseError::Torn)) = &ended {
                tracing::warn!("{error}");
            }
            ended
        };
        let thread = std::thread::Builder::new().name("drawing".into()).spawn(run)?;
        Ok(Self { shared, thread })
    }

    /// Why nothing is drawn any more, if so. A viewer that is away is no such reason.
    pub(crate) fn failure(&self) -> Option<String> {
        self.shared.failure.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// It draws what waits, and ends by itself; nobody waits here.
    pub(crate) fn leave(&self) {
        self.shared.store.close();
        self.shared.closing.store(true, Ordering::Relaxed);
        self.thread.thread().unpark();
    }

    pub(crate) fn has_ended(&self) -> bool {
        self.thread.is_finished()
    }

    /// Draws what waits, and ends. Waits until `deadline` for that, whatever the sink does: what it has not taken by
    /// then it may still take as long as the process incarnations.
    pub(crate) fn close_by(self, deadline: Instant) -> Result<(), CloseError> {
        self.leave();
        while !self.has_ended() {
            if Instant::now() >= deadline {
                return Err(CloseError::Stuck);
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        self.thread.join().unwrap_or(Err(CloseError::Stuck))
    }
}

/// What the thread has.
struct SupervisorThread {
    shared: Arc<SupervisorState>,
    config: Box<dyn Fn(StreamTarget) -> StreamConfig + Send>,
    streams: u64,
    lenience: u32,
}

impl SupervisorThread {
    /// Waits until the supervisor before this one has ended; none if this one has to end first.
    fn turn<'a>(&self, turn: &'a Mutex<()>) -> Option<MutexGuard<'a, ()>> {
        for checks in 0u32.. {
            match turn.try_lock() {
                Ok(guard) => return Some(guard),
                Err(TryLockError::Poisoned(guard)) => return Some(guard.into_inner()),
                Err(TryLockError::WouldBlock) if self.is_closing() => return None,
                Err(TryLockError::WouldBlock) => {}
            }
            if checks == CHECKS_OF_END {
                tracing::warn!("the last drawing has not ended yet; this one begins when it has");
            }
            std::thread::park_timeout(CHECK_INTERVAL);
        }
        None
    }

    /// One file after the other, each the whole picture from its first moment on.
    fn files(&mut self, path: &Path, bytes_max: u64) -> Result<(), CloseError> {
        let mut backoff = *BACKOFF.start();
        let mut told = false;
        // What was there before the first, and what is full, is put aside in any case.
        let mut aside_from = 1;
        loop {
            let began = Instant::now();
            let target = StreamTarget::File { path: path.into(), aside_from };
            let feeder = match self.feeder(target, || true, true) {
                Ok(feeder) => feeder,
                Err(error) => return self.fail(&error),
            };
            let room = Room::new(path, bytes_max);
            let end = self.watch(&feeder, None, &|| room.is_full(feeder.has_repeated()));
            feeder.finish();
            self.until_ended(
                &feeder,
                "the disk has not taken the end of the drawing yet; what comes next waits for it",
            );
            match (end, feeder.failure()) {
                (_, Some(error)) if error.needs_a_person(self.streams == 1) => return self.fail(&error),
                (_, Some(error)) => {
                    self.shared.store.count(|counts| counts.stuck += 1);
                    if self.is_closing() {
                        return Err(error.into_close());
                    }
                    if began.elapsed() >= GOOD {
                        (backoff, told) = (*BACKOFF.start(), false);
                    }
                    self.tell_once(&mut told, path, &error);
                    aside_from = files::WORTH.min(bytes_max);
                    self.rest(&mut backoff, BACKOFF_FILE);
                }
                (StreamEnd::Full, None) => aside_from = 1,
                (_, None) => return if files::is_whole(path) { Ok(()) } else { Err(CloseError::Torn) },
            }
        }
    }

    fn tell_once(&self, told: &mut bool, path: &Path, error: &dyn std::fmt::Display) {
        if !std::mem::replace(told, true) {
            let path = path.display();
            tracing::warn!("{path} takes nothing more ({error}); a new drawing begins there when there is room");
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
            let proxy = match ViewerProxy::open(&address.host, address.port, CONNECT) {
                Ok(proxy) => Arc::new(proxy),
                Err(error) => {
                    lines = true;
                    if told.is_empty() {
                        tracing::warn!("no viewer at {url} yet ({error}); drawing begins when it comes");
                        told = "absent";
                    }
                    self.rest(&mut backoff, *BACKOFF.end());
                    continue;
                }
            };
            let (watched, store) = (proxy.clone(), self.shared.store.clone());
            let feeder = match self.feeder(StreamTarget::Viewer(proxy.url()), move || watched.has_answered(), lines) {
                Ok(feeder) => feeder,
                Err(error) => return self.fail(&error),
            };
            if self.answers(&feeder, &proxy) && told != "draws" {
                tracing::info!("draws to the viewer at {url}");
                told = "draws";
            }
            let end = self.watch(&feeder, Some(&proxy), &|| false);
            let (was_broken, had_answered) = (proxy.is_broken(), proxy.has_answered());
            feeder.give_up();
            proxy.cut();
            self.until_ended(&feeder, "Rerun has not come back from a call yet; drawing goes on when it has");
            match (end, feeder.failure()) {
                (_, Some(error @ (FeedError::Layout(_) | FeedError::Open(_)))) if !was_broken => {
                    return self.fail(&error);
                }
                (StreamEnd::Still, _) => {
                    store.count(|counts| counts.stuck += 1);
                    lines = false;
                    if told != "still" {
                        tracing::warn!("the viewer at {url} stands still; drawing goes on when it moves again");
                        told = "still";
                    }
                }
                (StreamEnd::Gone, _) => {
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
            self.rest(&mut backoff, *BACKOFF.end());
        }
        Ok(())
    }

    /// A stream, which is given all that is known.
    fn feeder(
        &mut self,
        target: StreamTarget,
        may_begin: impl Fn() -> bool + Send + 'static,
        lines: bool,
    ) -> std::io::Result<Feeder> {
        let store = &self.shared.store;
        if self.streams > 0 {
            store.again(lines);
            store.count(|counts| counts.rebuilt += 1);
        }
        self.streams += 1;
        Feeder::begin((self.config)(target), store.clone(), may_begin)
    }

    /// Waits for the viewer's first word.
    fn answers(&self, feeder: &Feeder, proxy: &ViewerProxy) -> bool {
        for _ in 0..CHECKS_OF_PULSE {
            if proxy.has_answered() || proxy.is_broken() || feeder.has_ended() || self.is_closing() {
                break;
            }
            std::thread::park_timeout(CHECK_INTERVAL);
        }
        proxy.has_answered()
    }

    /// Until the stream has to end.
    fn watch(&self, feeder: &Feeder, proxy: Option<&ViewerProxy>, is_full: &dyn Fn() -> bool) -> StreamEnd {
        let mut seen = [(None, 0u32); 2];
        let mut last = None;
        let mut told = false;
        loop {
            if proxy.is_some_and(ViewerProxy::is_broken) {
                return StreamEnd::Gone;
            }
            if feeder.has_ended() {
                return StreamEnd::Ended;
            }
            if proxy.is_some_and(|proxy| !proxy.has_answered()) {
                return if self.is_closing() { StreamEnd::Ended } else { StreamEnd::Still };
            }
            if self.is_closing() {
                let until = last.get_or_insert_with(|| {
                    Instant::now() + if proxy.is_some() { LAST_TO_VIEWER } else { LAST_TO_FILE }
                });
                if Instant::now() >= *until {
                    return StreamEnd::Ended;
                }
            } else if is_full() {
                return StreamEnd::Full;
            }
            for ((before, checks), now) in seen.iter_mut().zip(feeder.waits_for()) {
                *checks = if now.is_some() && now == *before { *checks + 1 } else { 0 };
                *before = now;
            }
            let still = seen[0].1 >= CHECKS_OF_CALL * self.lenience || seen[1].1 >= CHECKS_OF_PULSE * self.lenience;
            if still && proxy.is_some() {
                return StreamEnd::Still;
            }
            // A disk cannot be cut off; it is waited for, and what comes meanwhile replaces what waits.
            if still && !told {
                self.shared.store.count(|counts| counts.stuck += 1);
                tracing::warn!("the disk stands still; drawing goes on when it moves again");
            }
            told = still;
            std::thread::park_timeout(CHECK_INTERVAL);
        }
    }

    /// However long it takes: what comes meanwhile replaces what waits.
    fn until_ended(&self, feeder: &Feeder, why: &str) {
        let mut checks = 0;
        while !feeder.has_ended() {
            checks += 1;
            if checks == CHECKS_OF_END {
                self.shared.store.count(|counts| counts.stuck += 1);
                tracing::warn!("{why}");
            }
            std::thread::sleep(CHECK_INTERVAL);
        }
    }

    fn rest(&self, backoff: &mut Duration, most: Duration) {
        let until = Instant::now() + *backoff;
        while !self.is_closing() && Instant::now() < until {
            std::thread::park_timeout(until.saturating_duration_since(Instant::now()));
        }
        *backoff = (*backoff * 2).min(most);
    }

    fn is_closing(&self) -> bool {
        self.shared.closing.load(Ordering::Relaxed)
    }

    fn fail(&self, why: &dyn std::fmt::Display) -> Result<(), CloseError> {
        *self.shared.failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(why.to_string());
        Err(CloseError::Failed(why.to_string()))
    }
}

#[cfg(test)]
mod tests;
