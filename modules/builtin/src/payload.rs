//! `payload`: the program of a robot in a team. What it decides is in [`rohrpost_payload`]; here are the clock, the
//! mailboxes and the words.
//!
//! ```text
//!  laser, odometry ──▶ sense ─┐                       ┌──▶ promise, destination ──▶ wormhole
//!  each beat ────────▶ beat ──┼─▶ rohrpost_payload ───┼──▶ H, R, E, T ──▶ teammates, by whatever way there is
//!  teammates ────────▶ hear ──┘                       └──▶ state of class `payload`, and of class `team`
//! ```
//!
//! No call here waits: neither wormhole nor network can delay a beat.

mod check;
mod settings;
mod state;

use super::settings::Settings as _;
use super::team::store::Store;
use super::team::{Air, OwnClock, state as team_state};
use super::wormhole::program::launch_of;
pub(super) use check::{NAME, problems};
use rohrpost_launch::launcher::LauncherProxy;
use rohrpost_modules::interfaces::{
    Destination, LaserInterface, Payload as PayloadServer, PayloadInterface, SupervisorProxy, Team, TeamInterface,
    TeamObjectId, TeamRefusal, WheelsInterface,
};
use rohrpost_modules::runtime::{Context, Received, Stream, StreamSubscription};
use rohrpost_modules::types::{LaserScan, Odometry};
use rohrpost_modules::{Module, ModuleError};
use rohrpost_payload::{News, Payload, Report, Sensed};
use settings::Settings;
use state::Beats;
pub(super) use state::cell;
use std::sync::Arc;
use std::time::Duration;

/// Beats at the start in which a robot that is lost is no news.
const FIRST_BEATS: u64 = 4;
/// The halt of a robot that has ended: its own first one.
const QUIT_HALT: u32 = 1;
/// Poses further from a scan are not of its moment.
const POSE_GAP: Duration = Duration::from_millis(500);

pub(super) struct PayloadModule {
    payload: Payload,
    air: Air,
    clock: OwnClock,
    scans: StreamSubscription<LaserScan>,
    poses: Stream<Odometry>,
    wormhole: SupervisorProxy,
    store: Store,
    /// Ends this module for good, under its name here.
    launch: Option<LauncherProxy>,
    name: String,
    has_quit: bool,
    beat_ms: u32,
    promise_ms: u32,
    told: team_state::TeamTold,
    beats: Beats,
    /// Where its way ended when the wormhole was told last.
    destination_m: Option<(f64, f64)>,
    /// Why the last message or promise did not leave; empty: it did.
    trouble: [String; 2],
}

impl Module for PayloadModule {
    type Settings = Settings;
    type Interfaces = (TeamInterface, PayloadInterface);

    fn new(settings: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        settings.check()?;
        let air = Air::open(context)?;
        let installation = context.installation();
        let (own, name) = (installation.module(context.me()), installation.classes.format(context.me()));
        let launch = own.and_then(|own| launch_of(&own.node, installation, context));
        let ground = settings.ground(&context.path(&settings.map))?;
        let scans = context.subscribe_stream(LaserInterface::SCAN, &settings.laser)?;
        let poses = context.stream(WheelsInterface::ODOMETRY, &settings.odometry)?.with_gap(POSE_GAP);
        let core = settings.payload();
        let promise_ms = (core.promise_ns / 1_000_000) as u32;
        let wormhole = context.proxy::<SupervisorProxy>(&settings.wormhole)?;
        let wormhole = wormhole.with_timeout(Duration::from_millis(promise_ms.into()));
        let (store, incarnation) = Store::open(settings.store.as_deref(), context);
        context.use_computer_clock();
        context.set_period(Duration::from_millis(settings.beat_ms.into()));
        let clock = OwnClock::begin(context);
        let team = settings.team(&core);
        let payload = Payload::new(
            clock.now_ns(),
            air.me(),
            incarnation,
            Arc::new(ground),
            core,
            team,
            settings.seed(air.me().get()),
        )?;
        Ok(Self {
            payload,
            air,
            clock,
            scans,
            poses,
            wormhole,
            store,
            launch,
            name,
            has_quit: false,
            beat_ms: settings.beat_ms,
            promise_ms,
            told: team_state::TeamTold::default(),
            beats: Beats::new(settings.beat_ms),
            destination_m: None,
            trouble: Default::default(),
        })
    }

    /// The robot stands, and has no way to go on.
    fn off(&mut self, _: &mut Context) {
        // What does not reach the wormhole is a promise that it misses.
        drop(self.wormhole.begin_set_destination(None));
        drop(self.wormhole.begin_promise(self.promise_ms, 0.0, 0.0));
    }

    fn received(&mut self, context: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        if self.air.is_message(data) {
            let (payload, now_ns) = (&mut self.payload, self.clock.now_ns());
            self.air.hear(data, |message| payload.hear(now_ns, message).is_ok());
        } else if let Ok(Some(scan)) = data.read(&self.scans) {
            let located = self.poses.at(data.moment()).ok().and_then(Result::ok);
            let speed_m_s = located.map_or(0.0, |located| located.twist.speed_m_s);
            let pose = located.map(|located| located.pose);
            self.payload.sense(self.clock.now_ns(), Sensed { pose, speed_m_s, scan });
        }
        self.serve(context);
        Ok(())
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        let now_ns = self.clock.now_ns();
        self.beats.note(now_ns);
        self.payload.beat(now_ns);
        self.store.keep(context, self.payload.team().group().version().incarnation);
        self.serve(context);
        let lost = self.payload.lost().filter(|_| self.beats.told().beats > FIRST_BEATS);
        let complaint = lost.map(|cause| format!("lost, and stands: {cause}"));
        let [messages, promises] = &self.trouble;
        context.complain(complaint.unwrap_or_else(|| if promises.is_empty() { messages } else { promises }.clone()));
        let state = state::of(&self.payload, self.beats.told());
        context.publish_now(PayloadInterface::STATE, &state)?;
        let (team, pose) = (self.payload.team(), state.pose.and_then(state::told));
        let state = team_state::of(team, now_ns, pose, self.beat_ms, self.air.counts, &mut self.told);
        context.publish_now(TeamInterface::STATE, &state)?;
        Ok(())
    }
}

impl PayloadModule {
    /// Carries on what the payload has to say: messages, a promise, news.
    fn serve(&mut self, context: &Context) {
        let messages = self.payload.take_messages();
        if !messages.is_empty() {
            self.trouble[0] = self.air.send(context, messages).unwrap_or_default();
        }
        if let Some(promise) = self.payload.take_promise() {
            self.promise(promise.command);
        }
        self.payload.take_news().iter().for_each(tell);
        if self.payload.has_quit() && !self.has_quit {
            self.quit();
        }
    }

    /// Ends for good: the wormhole holds the robot, and launch starts this module no more.
    fn quit(&mut self) {
        let held = self.wormhole.begin_halt(QUIT_HALT, String::new());
        let ended = self.launch.as_ref().map(|launch| launch.begin_stop(self.name.clone()));
        // What does not reach them is tried with the next message.
        self.has_quit = held.is_ok() && ended.is_none_or(|ended| ended.is_ok());
    }

    /// The destination first: a wormhole that misses the next promise drives there.
    fn promise(&mut self, command: rohrpost_supervision::Command) {
        let destination_m = self.payload.destination_m();
        if destination_m != self.destination_m {
            let destination = destination_m.map(|(x_m, y_m)| Destination { x_m, y_m });
            if self.wormhole.begin_set_destination(destination).is_ok() {
                self.destination_m = destination_m;
            }
        }
        let sent = self.wormhole.begin_promise(self.promise_ms, command.speed_m_s, command.turn_rate_rad_s);
        self.trouble[1] = sent.err().map(|error| format!("the wormhole gets no promises: {error}")).unwrap_or_default();
    }
}

fn tell(news: &News) {
    match news {
        News::Lost(cause) => tracing::warn!("lost, and stands: {cause}"),
        News::Found(cell) => tracing::info!("knows its cell again: {cell}"),
        News::Mode(mode) => tracing::info!("{mode} from now on"),
        News::NoWay(why) => tracing::warn!("no way to where it should be: {why}"),
        News::Quit(from) => tracing::warn!("station {from} has told this robot to end"),
        News::Refused(from) => tracing::warn!("robot {from} is no station that this robot obeys"),
        News::Report { from, report: Report { text, .. } } => tracing::info!("robot {from}: {text}"),
    }
}

impl PayloadServer for PayloadModule {
    fn say(&mut self, text: String) {
        self.payload.say(self.clock.now_ns(), text);
    }
}

impl Team for PayloadModule {
    fn add_fake(&mut self, _: f64, _: f64) -> Result<TeamObjectId, TeamRefusal> {
        Err(TeamRefusal("a robot makes up no intruders; ask a station, or a module `team`".into()))
    }

    fn end_fake(&mut self, _: TeamObjectId) -> Result<(), TeamRefusal> {
        Err(TeamRefusal("this module has made up no such intruder".into()))
    }
}
