//! A module as a user writes one, with settings and functions that make it misbehave.
//!
//! It is this test program itself, started by launch with the one test [`module`] to run: so it is built whenever the
//! tests are, and no program for tests alone is ever installed.

use crate::harness::run_if_launched;
use nix::sys::signal::{SigHandler, Signal, raise, signal};
use rohrpost::serde::Deserialize;
use rohrpost::{Context, Module, ModuleError, Rate, Received, Subscription};
use rohrpost_mailbox::{OverflowPolicy, Shape};
use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Not a test: what launch starts. Run as a test it ends at once.
#[test]
fn module() {
    run_if_launched::<Probe>();
}

/// This file as panics name it.
pub(crate) const FILE: &str = file!();

/// Numbers of its functions, for commands without a proxy.
pub(crate) const COUNT: u16 = 16;
pub(crate) const COUNT_AGAIN: u16 = 17;
pub(crate) const ABORT: u16 = 19;
pub(crate) const WORK: u16 = 23;

/// A mailbox of its own, of policy `latest`.
pub(crate) const NEWEST: u8 = 3;

/// See [`Settings::mixes`].
pub(crate) const SWAPPED: &str = "swapped";

/// Why a probe refuses.
#[rohrpost::data]
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum ProbeError {
    /// It was asked to.
    Refused {
        /// In these words.
        why: String,
    },
}

/// Does what tests ask of it.
#[rohrpost::interface(class = "probe")]
pub(crate) trait Probing {
    /// Writes the number into the record and tells how many it has written in this incarnation.
    #[command(16)]
    fn count(&mut self, number: u32) -> u64;

    /// The same, and may be run twice.
    #[command(17, idempotent)]
    fn count_again(&mut self, number: u32) -> u64;

    /// Refuses, with an error of its own.
    #[command(18)]
    fn refuse(&mut self, why: String) -> Result<u32, ProbeError>;

    /// Aborts the process while the command is in hand.
    #[command(19, idempotent)]
    fn abort(&mut self);

    /// The same, but must not be run twice.
    #[command(20)]
    fn abort_once(&mut self);

    /// Says a line.
    #[command(21)]
    fn say(&mut self, level: String, text: String);

    /// Ends the process with this code, a moment after the answer.
    #[command(22)]
    fn leave(&mut self, code: i32);

    /// Works for so long, ms; the record has its beginning and its end.
    #[command(23)]
    fn work(&mut self, ms: u64);

    /// Takes what a tool can type.
    #[command(24, idempotent)]
    fn tell(&mut self, number: i64, ratio: f64, word: String, flag: bool, list: Vec<u16>) -> String;

    /// Says so many lines at once.
    #[command(40)]
    fn flood(&mut self, level: String, lines: u32);

    /// Prints so many lines, `text 0` and so on, to `stdout` or `stderr`.
    #[command(42)]
    fn print(&mut self, stream: String, text: String, lines: u32);

    /// Prints this to its standard error, and aborts.
    #[command(43)]
    fn last_words(&mut self, text: String);

    /// Panics: `here`, in a `thread`, or `twice`, the second time while the first unwinds.
    #[command(41)]
    fn panic(&mut self, place: String);

    /// Counts its periods.
    #[data(1)]
    fn beat() -> u64;

    /// Never published.
    #[data(2)]
    fn silence() -> u64;

    /// Bytes, of a size that changes; what it publishes is written down in the file `published`.
    #[data(3)]
    fn blob() -> Vec<u8>;
}

#[derive(Deserialize, Default)]
#[serde(crate = "rohrpost::serde", deny_unknown_fields, rename_all = "kebab-case", default)]
pub(crate) struct Settings {
    /// File that it writes a line to for each thing that happens.
    record: Option<String>,
    /// Takes so long to start, ms.
    slow_ms: u64,
    /// Publishes `beat` so often.
    rate_hz: f64,
    /// Publishes `blob` so often.
    blob_hz: f64,
    /// Of so many bytes, which begin with its number and the monotonic time; 0: of sizes that change.
    blob_bytes: usize,
    /// Follows the blobs of this probe in [`NEWEST`]; the record has their numbers and ages, µs.
    watches: Option<String>,
    panic_at_start: bool,
    /// Ends before it is ready.
    exit_at_start: Option<i32>,
    /// Only if there is such a file.
    wait_for: Option<PathBuf>,
    refuse_at_start: bool,
    refuse_on: bool,
    /// Publishes data of an interface that it does not serve.
    foreign_data: bool,
    /// Stops itself as Ctrl-Z would, before it is ready.
    hang_at_start: bool,
    /// Hears each beat of this probe twice: in its data mailbox, and in [`NEWEST`].
    hears: Option<String>,
    /// Hears each beat and each blob of this probe in its data mailbox; in the other order with a file [`SWAPPED`].
    mixes: Option<String>,
    /// Does nothing on any signal that asks it to end.
    ignore_stop: bool,
}

struct PanicsWhenDropped;

impl Drop for PanicsWhenDropped {
    fn drop(&mut self) {
        panic!("the second of two");
    }
}

pub(crate) struct Probe {
    settings: Settings,
    record: Option<PathBuf>,
    me: String,
    counted: u64,
    beats: u64,
    leave: Option<i32>,
    /// Each, and the newest.
    hears: Option<[Subscription<u64>; 2]>,
    watches: Option<Subscription<Vec<u8>>>,
    mixes: Option<(Subscription<u64>, Subscription<Vec<u8>>)>,
}

impl Probe {
    fn note(&self, what: &str) {
        if let Some(record) = &self.record {
            write_line(record, &format!("{} {what}", self.me));
        }
    }
}

/// One line in one write, so that lines of several processes never mix.
fn write_line(record: &Path, line: &str) {
    let mut file = OpenOptions::new().create(true).append(true).open(record).unwrap();
    file.write_all(format!("{line}\n").as_bytes()).unwrap();
}

impl Probe {
    /// Publishes, and writes down when (between two moments of the monotonic clock) and how many bytes.
    fn publish_blob(&self, context: &mut Context) -> Result<(), ModuleError> {
        let before = rohrpost_mailbox::monotonic_ns();
        let blob = match self.settings.blob_bytes {
            0 => vec![0; 10 + self.beats as usize % 7 * 15],
            bytes => {
                let mut blob = [self.beats.to_le_bytes(), before.to_le_bytes()].concat();
                blob.resize(bytes, 0);
                blob
            }
        };
        context.publish_now(ProbingInterface::BLOB, &blob)?;
        let after = rohrpost_mailbox::monotonic_ns();
        // As postcard: the length in one byte, and the bytes.
        write_line(&context.path("published"), &format!("{before} {after} {}", blob.len() + 1));
        Ok(())
    }
}

/// Follows another probe's beats in two mailboxes; one that nobody opened is refused.
fn hear(from: &str, context: &mut Context) -> Result<[Subscription<u64>; 2], ModuleError> {
    let beat = ProbingInterface::BEAT;
    let refused = context.subscribe_in(NEWEST, beat, from, Rate::Each).err().unwrap().to_string();
    assert!(refused.contains("no mailbox 3 for data; make it with `open_mailbox`"), "{refused}");
    context.open_mailbox(NEWEST, Shape { slots: 8, full: OverflowPolicy::Latest, ..Shape::default() })?;
    let newest = context.subscribe_in(NEWEST, beat, from, Rate::Each)?;
    Ok([context.subscribe(beat, from, Rate::Each)?, newest])
}

/// Follows another probe's blobs, of which only the newest counts.
fn watch(from: &str, context: &mut Context) -> Result<Subscription<Vec<u8>>, ModuleError> {
    let shape = Shape { slots: 8, body_bytes_max: 16 * 1024, full: OverflowPolicy::Latest, ..Shape::default() };
    context.open_mailbox(NEWEST, shape)?;
    Ok(context.subscribe_in(NEWEST, ProbingInterface::BLOB, from, Rate::Each)?)
}

/// Follows another probe's beats and blobs, in one order or the other.
fn mix(from: &str, context: &mut Context) -> Result<(Subscription<u64>, Subscription<Vec<u8>>), ModuleError> {
    let beats = |context: &mut Context| context.subscribe(ProbingInterface::BEAT, from, Rate::Each);
    let blobs = |context: &mut Context| context.subscribe(ProbingInterface::BLOB, from, Rate::Each);
    if context.path(SWAPPED).exists() {
        let blobs = blobs(context)?;
        return Ok((beats(context)?, blobs));
    }
    Ok((beats(context)?, blobs(context)?))
}

impl Module for Probe {
    type Settings = Settings;
    type Interfaces = ProbingInterface;

    fn new(settings: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        let me = context.installation().classes.format(context.me());
        let record = settings.record.as_ref().map(|file| context.path(file));
        let rate_hz = [settings.blob_hz, settings.rate_hz].into_iter().find(|rate| *rate > 0.0).unwrap_or(100.0);
        context.set_period(Duration::from_secs_f64(1.0 / rate_hz));
        let hears = settings.hears.as_deref().map(|from| hear(from, context)).transpose()?;
        let watches = settings.watches.as_deref().map(|from| watch(from, context)).transpose()?;
        let mixes = settings.mixes.as_deref().map(|from| mix(from, context)).transpose()?;
        let probe = Self { settings, record, me, counted: 0, beats: 0, leave: None, hears, watches, mixes };
        probe.note("start");
        if probe.settings.panic_at_start {
            panic!("a probe was asked to panic");
        }
        let wait_for = probe.settings.wait_for.as_ref();
        if let Some(code) = probe.settings.exit_at_start.filter(|_| wait_for.is_none_or(|file| file.exists())) {
            println!("a probe was asked to end with {code}");
            std::process::exit(code);
        }
        if probe.settings.refuse_at_start {
            return Err(ModuleError::new("a probe was asked not to start"));
        }
        if probe.settings.hang_at_start {
            raise(Signal::SIGSTOP)?;
        }
        std::thread::sleep(Duration::from_millis(probe.settings.slow_ms));
        Ok(probe)
    }

    fn on(&mut self, _: &mut Context) -> Result<(), ModuleError> {
        if self.settings.refuse_on {
            return Err(ModuleError::new("a probe was asked not to work"));
        }
        if self.settings.ignore_stop {
            for number in [Signal::SIGTERM, Signal::SIGINT, Signal::SIGHUP] {
                // SAFETY: ignoring runs no code of ours in a handler.
                unsafe { signal(number, SigHandler::SigIgn) }?;
            }
        }
        self.note("on");
        Ok(())
    }

    fn off(&mut self, _: &mut Context) {
        self.note("off");
    }

    fn received(&mut self, _: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        for (which, subscription) in ["each", "newest"].iter().zip(self.hears.iter().flatten()) {
            if let Some(beat) = data.read(subscription)? {
                self.note(&format!("{which} {beat}"));
            }
        }
        if let Some((beats, blobs)) = self.mixes {
            data.read(&beats)?.iter().for_each(|beat| self.note(&format!("mixed beat {beat}")));
            data.read(&blobs)?.iter().for_each(|blob| self.note(&format!("mixed blob {}", blob.len())));
        }
        if let Some(watched) = &self.watches
            && let Some(blob) = data.read(watched)?
        {
            let word = |at: usize| u64::from_le_bytes(blob[at..at + 8].try_into().unwrap());
            let age_us = rohrpost_mailbox::monotonic_ns().saturating_sub(word(8)) / 1000;
            self.note(&format!("blob {} {age_us}", word(0)));
        }
        Ok(())
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        if let Some(code) = self.leave {
            std::process::exit(code);
        }
        self.beats += 1;
        if self.settings.foreign_data {
            let noise = rohrpost::interface::DataPort::<u64>::new("probe", 9, "noise", || 0);
            context.publish_now(noise, &self.beats)?;
        }
        if self.settings.rate_hz > 0.0 {
            context.publish_now(ProbingInterface::BEAT, &self.beats)?;
        }
        if self.settings.blob_hz > 0.0 {
            self.publish_blob(context)?;
        }
        Ok(())
    }
}

impl Probing for Probe {
    fn count(&mut self, number: u32) -> u64 {
        self.note(&format!("count {number}"));
        self.counted += 1;
        self.counted
    }

    fn count_again(&mut self, number: u32) -> u64 {
        self.count(number)
    }

    fn refuse(&mut self, why: String) -> Result<u32, ProbeError> {
        Err(ProbeError::Refused { why })
    }

    fn abort(&mut self) {
        self.note("abort");
        std::process::abort();
    }

    fn abort_once(&mut self) {
        self.abort();
    }

    fn say(&mut self, level: String, text: String) {
        match level.as_str() {
            "error" => rohrpost::tracing::error!("{text}"),
            "warn" => rohrpost::tracing::warn!("{text}"),
            "debug" => rohrpost::tracing::debug!("{text}"),
            _ => rohrpost::tracing::info!("{text}"),
        }
    }

    fn flood(&mut self, level: String, lines: u32) {
        for line in 0..lines {
            self.say(level.clone(), format!("flood {line}"));
        }
        self.note("flooded");
    }

    fn print(&mut self, stream: String, text: String, lines: u32) {
        for line in 0..lines {
            match stream.as_str() {
                "stdout" => println!("{text} {line}"),
                _ => eprintln!("{text} {line}"),
            }
        }
    }

    fn last_words(&mut self, text: String) {
        eprintln!("{text}");
        std::process::abort();
    }

    fn panic(&mut self, place: String) {
        self.note("panic");
        match place.as_str() {
            "thread" => {
                let wheels = std::thread::Builder::new().name("wheels".into());
                let panicked = wheels.spawn(|| panic!("the wheels came off")).unwrap().join();
                assert!(panicked.is_err());
            }
            "twice" => {
                let _second = PanicsWhenDropped;
                panic!("the first of two");
            }
            _ => panic!("two lines\nof a panic"),
        }
    }

    fn leave(&mut self, code: i32) {
        self.leave = Some(code);
    }

    fn work(&mut self, ms: u64) {
        self.note("work begins");
        std::thread::sleep(Duration::from_millis(ms));
        self.note("work ends");
    }

    fn tell(&mut self, number: i64, ratio: f64, word: String, flag: bool, list: Vec<u16>) -> String {
        format!("{number} {ratio} {word} {flag} {list:?}")
    }
}
