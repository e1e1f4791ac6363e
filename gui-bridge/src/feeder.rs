//! The one thread that calls Rerun, and so the one that may get stuck there.
//!
//! It takes what is due from the store and hands it to a stream of its own, until it is given up or the store is
//! closed. Others see from outside whether it is in a call, and for how long; and whether the stream's own threads
//! move.
//!
//! Rerun's thread that writes a file ends at the first error, as when the disk is full, and takes rows ever after
//! without a word. Only a flush reports it. So a file is flushed as often as it is written anyway.

use crate::blueprint;
use crate::sink::{self, CloseError, OpenError, StreamConfig, StreamTarget};
use crate::store::{Order, Store};
use rerun::RecordingStream;
use rerun::log::PendingRow;
use rerun::sink::SinkFlushError;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// The stream's threads are asked so often whether they move.
const PULSE: Duration = Duration::from_millis(250);
/// Writing the end of a file takes no longer than this, or it is not waited for.
const FLUSH: Duration = Duration::from_secs(5);
/// A file is flushed so often; as [`sink::open`] has it written.
const FLUSH_PERIOD: Duration = Duration::from_secs(2);

/// State that a feeder shares with its supervisor. Times are ns since `began`, plus one, so that 0 is none.
struct FeederState {
    began: Instant,
    /// Since when it is in a call of Rerun.
    in_call: AtomicU64,
    /// When the stream's threads were asked for a pulse that they have not given yet.
    pulse_asked: AtomicU64,
    /// It takes nothing more.
    stop: AtomicBool,
    /// Nor does it write what is under way.
    hurry: AtomicBool,
    /// All that was known at its beginning is in the file.
    repeated: AtomicBool,
    failure: Mutex<Option<FeedError>>,
}

/// Why a feeder ended before its time.
#[derive(Debug, thiserror::Error)]
pub(crate) enum FeedError {
    #[error(transparent)]
    Open(#[from] OpenError),
    #[error("Rerun refused the layout: {0}")]
    Layout(#[from] rerun::RecordingStreamError),
    #[error(transparent)]
    Write(#[from] SinkFlushError),
}

impl FeedError {
    /// Whether trying again is in vain. `first`: there was no stream before.
    pub(crate) fn needs_a_person(&self, first: bool) -> bool {
        match self {
            Self::Layout(_) => true,
            Self::Open(error) => first && !error.is_for_want_of_room(),
            Self::Write(_) => false,
        }
    }

    /// The same for the caller that closes the drawing.
    pub(crate) fn into_close(self) -> CloseError {
        match self {
            Self::Layout(error) => error.into(),
            Self::Write(error) => error.into(),
            Self::Open(error) => CloseError::Failed(error.to_string()),
        }
    }
}

/// See the module's text.
pub(crate) struct Feeder {
    shared: Arc<FeederState>,
    thread: JoinHandle<()>,
}

impl Feeder {
    /// Begins to draw on `config`. `may_begin` is asked until it says yes: before, nothing is taken from the store.
    pub(crate) fn begin(
        config: StreamConfig,
        store: Arc<Store>,
        may_begin: impl Fn() -> bool + Send + 'static,
    ) -> std::io::Result<Self> {
        let shared = Arc::new(FeederState {
            began: Instant::now(),
            in_call: AtomicU64::new(0),
            pulse_asked: AtomicU64::new(0),
            stop: AtomicBool::new(false),
            hurry: AtomicBool::new(false),
            repeated: AtomicBool::new(false),
            failure: Mutex::new(None),
        });
        let own = shared.clone();
        let run = move || {
            if let Err(error) = own.run(&config, &store, may_begin) {
                *own.failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
            }
        };
        let thread = std::thread::Builder::new().name("feeder".into()).spawn(run)?;
        Ok(Self { shared, thread })
    }

    /// The call of Rerun's that it is in, and the pulse that it waits for: as long as they are the same, nothing moves.
    pub(crate) fn waits_for(&self) -> [Option<u64>; 2] {
        [&self.shared.in_call, &self.shared.pulse_asked].map(|at| Some(at.load(Ordering::Relaxed)).filter(|at| *at > 0))
    }

    /// It takes nothing more from the store, writes what it has, and ends.
    pub(crate) fn finish(&self) {
        self.shared.stop.store(true, Ordering::Relaxed);
    }

    /// It ends as soon as Rerun comes back to it.
    pub(crate) fn give_up(&self) {
        self.shared.hurry.store(true, Ordering::Relaxed);
        self.finish();
    }

    /// Whether all that was known at its beginning is in the file.
    pub(crate) fn has_repeated(&self) -> bool {
        self.shared.repeated.load(Ordering::Relaxed)
    }

    pub(crate) fn has_ended(&self) -> bool {
        self.thread.is_finished()
    }

    /// Why it ended, if it was not told to.
    pub(crate) fn failure(&self) -> Option<FeedError> {
        self.shared.failure.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

impl FeederState {
    fn run(
        self: &Arc<Self>,
        config: &StreamConfig,
        store: &Store,
        may_begin: impl Fn() -> bool,
    ) -> Result<(), FeedError> {
        let stream = self.call(|| sink::open(config))?;
        let stop = || self.stop.load(Ordering::Relaxed);
        while !may_begin() && !stop() {
            std::thread::sleep(Duration::from_millis(10));
        }
        let drawn = self.draw_all(&stream, config, store, stop);
        let hurry = self.hurry.load(Ordering::Relaxed);
        let closed = self.call(|| if hurry { Ok(()) } else { drawn.and_then(|()| close(&stream, store)) });
        // Dropping it waits until all is written, too.
        self.call(|| drop(stream));
        closed
    }

    fn draw_all(
        self: &Arc<Self>,
        stream: &RecordingStream,
        config: &StreamConfig,
        store: &Store,
        stop: impl Fn() -> bool,
    ) -> Result<(), FeedError> {
        let is_file = matches!(config.target, StreamTarget::File { .. });
        let (mut pulse_at, mut flush_at) = (Instant::now(), Instant::now());
        while let Some(order) = store.next(&stop) {
            self.call(|| draw(stream, order))?;
            if pulse_at.elapsed() >= PULSE && self.pulse_asked.load(Ordering::Relaxed) == 0 {
                pulse_at = Instant::now();
                self.ask_for_pulse(stream);
            }
            if is_file && flush_at.elapsed() >= FLUSH_PERIOD {
                // Asked first: what comes while it is flushed need not be in it.
                let repeated = store.has_repeated();
                let whole = self.call(|| flush(stream))?;
                self.repeated.fetch_or(repeated && whole, Ordering::Relaxed);
                flush_at = Instant::now();
            }
        }
        Ok(())
    }

    /// A call of Rerun's, during which the watch is on.
    fn call<T>(&self, call: impl FnOnce() -> T) -> T {
        self.in_call.store(self.now(), Ordering::Relaxed);
        let done = call();
        self.in_call.store(0, Ordering::Relaxed);
        done
    }

    fn ask_for_pulse(self: &Arc<Self>, stream: &RecordingStream) {
        self.pulse_asked.store(self.now(), Ordering::Relaxed);
        let own = self.clone();
        self.call(|| stream.inspect_sink(move |_| own.pulse_asked.store(0, Ordering::Relaxed)));
    }

    fn now(&self) -> u64 {
        self.began.elapsed().as_nanos() as u64 + 1
    }
}

fn draw(stream: &RecordingStream, order: Order) -> Result<(), FeedError> {
    match order {
        Order::Layout(layout) => blueprint::send(stream, &layout)?,
        Order::Row(entity, row) => {
            let components = row.components.into_iter().map(|batch| (batch.descriptor.component, batch)).collect();
            stream.record_row(entity, PendingRow::new(row.time.unwrap_or_default(), components), false);
        }
    }
    Ok(())
}

/// Writes all. The layout comes once more, at the end: a view takes its bounds from what is loaded when it first
/// appears, and the views of the layout at the beginning may have seen but a part of it.
fn close(stream: &RecordingStream, store: &Store) -> Result<(), FeedError> {
    if let Some(layout) = store.layout() {
        blueprint::send(stream, &layout)?;
    }
    flush(stream)?;
    Ok(())
}

/// Writes what Rerun has; false if that takes long: a stalled sink has not failed.
fn flush(stream: &RecordingStream) -> Result<bool, SinkFlushError> {
    match stream.flush_with_timeout(FLUSH) {
        Ok(()) => Ok(true),
        Err(SinkFlushError::Timeout) => Ok(false),
        Err(error) => Err(error),
    }
}
