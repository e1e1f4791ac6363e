//! The built-in module `replay`: plays a recording in the place of the modules that were recorded, and tells the node
//! the time.
//!
//! ```text
//! files ─▶ Course ── begin, values, waits ─▶ RecordingPlayer ─┬─▶ publish as laser.0, motor.0, …
//!            ▲                                  ▲   │         └─▶ the node's time: epochs, pace
//!            │ pause, seek, step, rate          │   ▼
//!            └──────────── commands       timer: the next value is due
//! ```
//!
//! The timer goes by the computer's clock, since a module has no ticks while the node's time stands still.

mod answers;
mod channels;
mod course;
mod settings;
mod spacing;

pub use answers::JournalAnswers;
pub use settings::{PlayerSettings, ROUND_MIN, RecordingPath};

use answers::PlayedAnswers;
use channels::PlayedChannels;
use course::{Course, Move, Part};
use nix::sys::time::TimeSpec;
use nix::sys::timer::{Expiration, TimerSetTimeFlags};
use nix::sys::timerfd::{ClockId, TimerFd, TimerFlags};
use rohrpost::interface::{StandIn, StandInCommand};
use rohrpost::interfaces::{Replay, ReplayInterface, ReplayPosition, ReplayRefusal};
use rohrpost::schema::Description;
use rohrpost::wire::from_bytes;
use rohrpost::{
    Context, Fault, Installation, Interest, Module, ModuleClock, ModuleError, Ready, Start, StartError, TimeTeller,
};
use rohrpost_mailbox::monotonic_ns;
use rohrpost_recording::{Player, RecordedChannel};
use spacing::{PlayedAt, ProcessorWaits, Spacing};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Values played at once at most, and the time after which no further one is begun: commands are heard in between.
const AT_ONCE_MAX: usize = 64;
const AT_ONCE_TIME: Duration = Duration::from_millis(2);
/// So many places that cannot be read are told one by one; all are counted.
const DAMAGES_TOLD_MAX: u64 = 10;
/// Where it is, is published so often.
const TOLD: Duration = Duration::from_millis(200);
/// The timer's shortest time; none would switch it off.
const SOON: Duration = Duration::from_nanos(1);
/// The largest rate: that of a node's time.
pub const RATE_MAX: f64 = 1000.0;

/// Runs the player of a replay, until it is told to end.
///
/// # Errors
/// See [`StartError`].
pub fn run(start: Start) -> Result<(), StartError> {
    rohrpost_modules::runtime::run_started::<RecordingPlayer>(start)
}

struct RecordingPlayer {
    course: Course,
    time: TimeTeller,
    clock: ModuleClock,
    timer: TimerFd,
    channels: PlayedChannels,
    answers: PlayedAnswers,
    begin_ns: u64,
    end_ns: u64,
    rate: f64,
    spacing: Spacing,
    waits: ProcessorWaits,
    damages: u64,
    round_began: Instant,
    /// What was published of its position, and when.
    told: Option<(ReplayPosition, Instant)>,
}

impl Module for RecordingPlayer {
    type Settings = PlayerSettings;
    type Interfaces = ReplayInterface;

    fn stand_ins(settings: &PlayerSettings, installation: &Installation) -> Result<Vec<StandIn>, ModuleError> {
        let stand_in = |(name, file): &(String, String)| {
            let description = Description::from_bytes(&std::fs::read(installation.resolve(file))?)?;
            Ok(StandIn { name: installation.classes.parse_module(name)?, description })
        };
        settings.described.iter().map(stand_in).collect()
    }

    fn new(settings: PlayerSettings, context: &mut Context) -> Result<Self, ModuleError> {
        let stand_ins = Self::stand_ins(&settings, context.installation())?;
        let channels = PlayedChannels::new(&stand_ins, &settings.topics, &settings.into, context.installation());
        let answers = settings.answers.as_ref().map(|file| std::fs::read(context.installation().resolve(file)));
        let answers = answers.transpose()?.map(|bytes| from_bytes(&bytes)).transpose()?;
        let answers = answers.map(PlayedAnswers::new).unwrap_or_default();
        let PlayerSettings { files, begin_ns, end_ns, rate, from_ns, until_ns, repeats, .. } = settings;
        let files = files.into_iter().map(PathBuf::from).collect();
        let topics = channels.topics();
        let plays = move |channel: &RecordedChannel| !channel.is_drawn() && topics.contains(channel.topic.as_str());
        let course = Course::new(Player::new(files, plays), Part { from_ns, until_ns, repeats })?;
        let timer = TimerFd::new(ClockId::CLOCK_MONOTONIC, TimerFlags::TFD_NONBLOCK | TimerFlags::TFD_CLOEXEC)?;
        context.watch(&timer, Interest::Read)?;
        Ok(Self {
            course,
            time: context.tell_time()?,
            clock: context.clock().clone(),
            timer,
            channels,
            answers,
            begin_ns,
            end_ns,
            rate,
            spacing: Spacing::default(),
            waits: ProcessorWaits::of_this_thread(),
            damages: 0,
            round_began: Instant::now(),
            told: None,
        })
    }

    fn on(&mut self, _: &mut Context) -> Result<(), ModuleError> {
        self.let_time_pass();
        Ok(())
    }

    /// Time stands still, whatever else it was told.
    fn off(&mut self, _: &mut Context) {
        self.time.set_pace(0.0);
    }

    fn ready(&mut self, context: &mut Context, _: Ready) -> Result<(), ModuleError> {
        // Told by a command there is nothing to read.
        let _ = self.timer.wait();
        let (wait, has_more_to_tell) = (self.play(context)?, self.tell(context)?);
        if let Some(wait) = wait.or(has_more_to_tell.then_some(TOLD)) {
            self.ring_in(wait.min(TOLD));
        }
        Ok(())
    }

    fn stand_in_command(
        &mut self,
        context: &mut Context,
        command: &StandInCommand<'_>,
        reply: &mut Vec<u8>,
    ) -> Result<(), Fault> {
        let name = context.installation().classes.format(command.to);
        reply.extend_from_slice(self.answers.find(&name, command, self.clock.now().ns)?);
        Ok(())
    }
}

impl RecordingPlayer {
    /// Plays what is due; how long until there is more, none if there is nothing until it is told something.
    fn play(&mut self, context: &mut Context) -> Result<Option<Duration>, ModuleError> {
        let began = Instant::now();
        for _ in 0..AT_ONCE_MAX {
            let now_ns = self.clock.now().ns;
            let is_paused = self.course.is_paused();
            let moved = match self.course.next(now_ns) {
                Ok(moved) => moved,
                Err(error) => {
                    self.damages += 1;
                    if self.damages <= DAMAGES_TOLD_MAX {
                        tracing::warn!("{error}; goes on behind that");
                    }
                    continue;
                }
            };
            match moved {
                Move::Begin { system_ns, epoch } => {
                    self.channels.begin(epoch, self.time.begin(system_ns, 0.0, epoch));
                    self.let_time_pass();
                }
                Move::Play { time_ns, channel, message } => {
                    if let Some(time_ns) = time_ns {
                        self.time.advance_to(time_ns);
                    } else if !channel.is_repeated() {
                        let late_ns = (now_ns.saturating_sub(message.arrival_ns) as f64 / self.rate) as u64;
                        let at = PlayedAt { arrival_ns: message.arrival_ns, now_ns: monotonic_ns(), late_ns };
                        self.spacing.note(at, self.rate, self.waits.waited_ns());
                    }
                    self.channels.play(context, &channel, &message)?;
                }
                Move::Advance { time_ns } => drop(self.time.advance_to(time_ns)),
                Move::Wait { until_ns } => return Ok(Some(self.left(until_ns))),
                Move::Round => {
                    let left = ROUND_MIN.saturating_sub(self.round_began.elapsed());
                    self.round_began = Instant::now() + left;
                    if !left.is_zero() {
                        return Ok(Some(left));
                    }
                }
                Move::End if is_paused => {
                    tracing::info!("at the end: `seek`, or `resume` to end the replay")
                }
                // Time goes on behind the end: modules that run have work left.
                Move::Again | Move::End => {}
                Move::Rest => return Ok(None),
            }
            if began.elapsed() >= AT_ONCE_TIME {
                break;
            }
        }
        Ok(Some(Duration::ZERO))
    }

    /// How long until then.
    fn left(&self, until_ns: u64) -> Duration {
        Duration::from_nanos((until_ns.saturating_sub(self.clock.now().ns) as f64 / self.rate) as u64)
    }

    /// Time passes at the rate, or stands still; there is something to look after.
    fn let_time_pass(&mut self) {
        let pace = if self.course.is_paused() { 0.0 } else { self.rate };
        if self.time.has_begun() && !self.time.set_pace(pace) {
            tracing::error!("time goes on at its old pace: this computer was too busy to change it; say it again");
        }
        self.spacing.begin();
        self.ring_in(Duration::ZERO);
    }

    fn ring_in(&self, wait: Duration) {
        let once = Expiration::OneShot(TimeSpec::from_duration(wait.max(SOON)));
        if let Err(error) = self.timer.set(once, TimerSetTimeFlags::empty()) {
            tracing::error!("the timer cannot be set: {error}; say `resume`");
        }
    }

    fn length_s(&self) -> f64 {
        self.end_ns.saturating_sub(self.begin_ns) as f64 / 1e9
    }

    /// Publishes where it is, if that is news; whether there is something left to tell.
    fn tell(&mut self, context: &mut Context) -> Result<bool, ModuleError> {
        if !self.time.has_begun() {
            return Ok(false);
        }
        let position = self.position();
        let state = |its: &ReplayPosition| (its.epoch, its.paused, its.ended, its.rate.to_bits());
        let (is_news, is_due) = self.told.as_ref().map_or((true, true), |(told, at)| {
            (*told != position, at.elapsed() >= TOLD || state(told) != state(&position))
        });
        if is_news && is_due {
            context.publish_now(ReplayInterface::STATE, &position)?;
            self.told = Some((position, Instant::now()));
        }
        Ok(is_news && !is_due)
    }
}

impl Replay for RecordingPlayer {
    fn position(&mut self) -> ReplayPosition {
        let now = self.clock.now();
        let time_ns = if self.time.has_begun() { now.ns } else { 0 };
        let seconds = |ns: u64| ns as f64 / 1e9;
        let (all, own) = (self.spacing.all(), self.spacing.own());
        ReplayPosition {
            at_s: seconds(time_ns.min(self.end_ns).saturating_sub(self.begin_ns)),
            length_s: self.length_s(),
            time_ns,
            epoch: now.epoch,
            rate: self.rate,
            paused: self.course.is_paused(),
            ended: self.course.has_ended(),
            rounds: self.course.rounds(),
            played: self.channels.played,
            older: self.channels.older,
            channels: self.channels.count(),
            refused: self.channels.refused,
            damages: self.damages,
            spacing_p50_ns: all.quantile_ns(0.5),
            spacing_p99_ns: all.quantile_ns(0.99),
            spacing_max_ns: all.max_ns(),
            spacing_own_p50_ns: own.quantile_ns(0.5),
            spacing_own_p99_ns: own.quantile_ns(0.99),
            spacing_own_max_ns: own.max_ns(),
        }
    }

    fn pause(&mut self) {
        self.course.pause();
        self.let_time_pass();
    }

    fn resume(&mut self) {
        self.course.resume();
        self.let_time_pass();
    }

    fn rate(&mut self, rate: f64) -> Result<(), ReplayRefusal> {
        if !(rate > 0.0 && rate <= RATE_MAX) {
            return Err(ReplayRefusal::Rate(rate));
        }
        self.rate = rate;
        self.let_time_pass();
        Ok(())
    }

    fn step(&mut self) {
        self.course.step();
        self.let_time_pass();
    }

    fn step_by(&mut self, seconds: f64) -> Result<(), ReplayRefusal> {
        let step = Duration::try_from_secs_f64(seconds).ok().filter(|step| !step.is_zero());
        let step = step.ok_or(ReplayRefusal::Step(seconds))?;
        self.course.pause();
        self.let_time_pass();
        self.course.step_until(self.clock.now().ns.saturating_add(u64::try_from(step.as_nanos()).unwrap_or(u64::MAX)));
        Ok(())
    }

    fn seek(&mut self, seconds: f64) -> Result<(), ReplayRefusal> {
        let length_s = self.length_s();
        if !(0.0..=length_s).contains(&seconds) {
            return Err(ReplayRefusal::Time { at_s: seconds, length_s });
        }
        let sought = self.course.seek(self.begin_ns.saturating_add((seconds * 1e9) as u64));
        // Old time stands until the new one begins.
        self.time.set_pace(0.0);
        self.ring_in(Duration::ZERO);
        sought.map_err(|error| ReplayRefusal::File(error.to_string()))
    }
}
