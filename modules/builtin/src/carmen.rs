//! `carmen`: plays a CARMEN log as wheels and scanner, at a chosen speed. Each record has its own time, also one that
//! stands behind later ones in the log.
//!
//! Under `source = "log"` the first player of a node tells the node's time ([`telling`]): it begins with the log's
//! first record, passes at the chosen speed, and stands still while the player is off. Elsewhere, and for a second
//! player, records are moved into the present.

mod telling;

use super::settings::{self, RefusedSetting, Settings as _};
use rohrpost_mailbox::SystemTime;
use rohrpost_modules::interfaces::{Laser, LaserInterface, Player, PlayerInterface, Progress, Wheels, WheelsInterface};
use rohrpost_modules::runtime::{Context, ContextError, RecordError};
use rohrpost_modules::{Module, ModuleError};
use rohrpost_robot::carmen::{self, LogRecord};
use rohrpost_robot::playback::{Due, Playback};
use serde::Deserialize;
use std::io::BufRead;
use std::time::Duration;
use telling::Telling;

/// Records played in one tick at most: a log that is behind catches up in pieces, and commands are heard in between.
const AT_ONCE_MAX: usize = 64;
/// Speeds beyond are of no use, and would be the whole log in one tick.
const SPEED_MAX: f64 = 1000.0;
/// Records are played so exactly; their stamps are exact.
const TICK: Duration = Duration::from_millis(2);

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct Settings {
    /// The log; may be compressed by gzip.
    file: String,
    /// Times the speed at which it was recorded.
    #[serde(default = "one")]
    speed: f64,
    /// Readings of this length and more mean that nothing came back.
    range_max_m: Option<f32>,
}

impl settings::Settings for Settings {
    fn check(&self) -> Result<(), RefusedSetting> {
        if self.speed > 0.0 && self.speed <= SPEED_MAX {
            return Ok(());
        }
        Err(RefusedSetting { key: "speed", why: format!("is {}; use more than 0, at most {SPEED_MAX}", self.speed) })
    }
}

fn one() -> f64 {
    1.0
}

pub(super) struct Carmen {
    playback: Playback<Box<dyn BufRead + Send>>,
    /// Seconds of the log in a second of system time.
    speed: f64,
    /// If the log is the node's time: its writer.
    telling: Option<Telling>,
    /// Read from the log and not yet due.
    next: Option<Due>,
    /// System time at which the log began, ns; pauses move it on. None before the module was first on.
    start_ns: Option<u64>,
    /// When it was switched off.
    paused_ns: Option<u64>,
    /// System time when it was last looked at.
    looked: SystemTime,
    progress: Progress,
}

impl Module for Carmen {
    type Settings = Settings;
    type Interfaces = (PlayerInterface, WheelsInterface, LaserInterface);

    fn new(settings: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        settings.check()?;
        let mut reading = carmen::Settings::default();
        reading.range_max_m = settings.range_max_m.unwrap_or(reading.range_max_m);
        let reader = carmen::open(&context.path(&settings.file), reading)?;
        let telling = Telling::of(context, settings.speed);
        let speed = if telling.is_some() { 1.0 } else { settings.speed };
        let playback = Playback::new(reader, speed)?;
        context.set_period(TICK.mul_f64(settings.speed / speed));
        tracing::info!("plays {} at {} times its speed", settings.file, settings.speed);
        let (looked, progress) = (context.now(), Progress::default());
        Ok(Self { playback, speed, telling, next: None, start_ns: None, paused_ns: None, looked, progress })
    }

    fn on(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        if self.telling.is_some() {
            return self.let_time_pass(context);
        }
        if let (Some(start_ns), Some(paused_ns)) = (self.start_ns, self.paused_ns.take()) {
            self.start_ns = Some(start_ns + self.now_ns(context).saturating_sub(paused_ns));
        }
        Ok(())
    }

    fn off(&mut self, context: &mut Context) {
        if let Some(telling) = &mut self.telling {
            return telling.pause();
        }
        self.paused_ns = Some(self.now_ns(context));
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        let now_ns = self.now_ns(context);
        let start_ns = *self.start_ns.get_or_insert(now_ns);
        for _ in 0..AT_ONCE_MAX {
            if self.progress.finished {
                break;
            }
            let Some(due) = self.next.take().map(Ok).or_else(|| self.playback.next()).transpose()? else {
                self.finish();
                break;
            };
            if start_ns + due.due_ns > now_ns {
                self.next = Some(due);
                break;
            }
            self.play(start_ns, due, context)?;
        }
        let counters = self.playback.counters();
        self.progress.discarded = counters.discarded;
        self.progress.malformed = counters.malformed;
        self.progress.skipped = counters.skipped;
        Ok(())
    }
}

impl Carmen {
    /// Begins the node's time with the first record, or goes on.
    fn let_time_pass(&mut self, context: &Context) -> Result<(), ModuleError> {
        let Some(telling) = &mut self.telling else { return Ok(()) };
        if telling.goes_on() {
            return Ok(());
        }
        // What has no stamp is not played.
        for due in self.playback.by_ref() {
            let due = due?;
            if let Some(stamp_s) = due.record.stamp_s() {
                self.start_ns = Some(telling.begin(context, stamp_s)?);
                (self.next, self.looked) = (Some(due), context.now());
                return Ok(());
            }
        }
        self.finish();
        Ok(())
    }

    /// System time. After a step of it, the log goes on from where it was.
    fn now_ns(&mut self, context: &Context) -> u64 {
        let last = std::mem::replace(&mut self.looked, context.now());
        if self.looked.epoch != last.epoch {
            let moved = |ns: u64| (ns + self.looked.ns).saturating_sub(last.ns);
            (self.start_ns, self.paused_ns) = (self.start_ns.map(moved), self.paused_ns.map(moved));
        }
        self.looked.ns
    }

    fn play(&mut self, start_ns: u64, due: Due, context: &mut Context) -> Result<(), ModuleError> {
        self.progress.played_s = due.due_ns as f64 * self.speed / 1e9;
        let stamp_ns = start_ns.saturating_add_signed(due.stamp_ns).max(1);
        let (written, count) = match due.record {
            LogRecord::Odometry { odometry, .. } => {
                let written = context.write(WheelsInterface::ODOMETRY, stamp_ns, &odometry);
                (written, &mut self.progress.odometries)
            }
            LogRecord::Scan { scan, .. } => {
                (context.write(LaserInterface::SCAN, stamp_ns, &scan), &mut self.progress.scans)
            }
            LogRecord::Param { .. } => return Ok(()),
        };
        match written {
            Ok(_) => *count += 1,
            Err(ContextError::Record(late @ RecordError::Late { .. })) => {
                if self.progress.late == 0 {
                    tracing::warn!("{late}; records like this one are counted as `late` in `progress`");
                }
                self.progress.late += 1;
            }
            Err(error) => return Err(error.into()),
        }
        Ok(())
    }

    fn finish(&mut self) {
        self.progress.finished = true;
        let Progress { scans, odometries, late, .. } = self.progress;
        let counters = self.playback.counters();
        tracing::info!(
            "the log is over: {scans} scans and {odometries} odometries played, {} discarded for their stamps, {late} \
            too late, {} broken",
            counters.discarded,
            counters.malformed
        );
    }
}

impl Player for Carmen {
    fn progress(&mut self) -> Progress {
        self.progress
    }
}

impl Wheels for Carmen {}
impl Laser for Carmen {}
