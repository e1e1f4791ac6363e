//! `station`: a person's place in a team. What it keeps and repeats is in [`rohrpost_payload::Station`]; here are the
//! clock, the mailboxes and the words.

mod check;
mod settings;
mod state;

use super::settings::Settings as _;
use super::team::store::Store;
use super::team::{Air, OwnClock, state as team_state};
pub(super) use check::{NAME, problems};
use rohrpost_modules::interfaces::{
    Station as StationServer, StationInterface, StationRequestKind, Team, TeamInterface, TeamObjectId, TeamRefusal,
};
use rohrpost_modules::runtime::{Context, Received};
use rohrpost_modules::{Module, ModuleError};
use rohrpost_payload::{RequestKind, Station, StationRefusal};
use rohrpost_team::view::ObjectId;
use rohrpost_team::{Position, RobotId};
use settings::Settings;
use std::sync::Arc;
use std::time::Duration;

pub(super) struct StationModule {
    station: Station,
    air: Air,
    clock: OwnClock,
    store: Store,
    beat_ms: u32,
    told: team_state::TeamTold,
}

impl Module for StationModule {
    type Settings = Settings;
    type Interfaces = (TeamInterface, StationInterface);

    fn new(settings: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        settings.check()?;
        let air = Air::open(context)?;
        let ground = settings.ground(&context.path(&settings.map))?;
        let (store, incarnation) = Store::open(settings.store.as_deref(), context);
        context.use_computer_clock();
        context.set_period(Duration::from_millis(settings.beat_ms.into()));
        let clock = OwnClock::begin(context);
        let station = Station::new(clock.now_ns(), air.me(), incarnation, Arc::new(ground), settings.team())?;
        Ok(Self { station, air, clock, store, beat_ms: settings.beat_ms, told: Default::default() })
    }

    fn received(&mut self, _: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        let now_ns = self.clock.now_ns();
        if self.air.is_message(data) {
            let station = &mut self.station;
            self.air.hear(data, |message| station.hear(now_ns, message).is_ok());
        } else {
            self.air.counts.malformed += 1;
        }
        Ok(())
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        let now_ns = self.clock.now_ns();
        self.station.beat(now_ns);
        self.store.keep(context, self.station.team().group().version().incarnation);
        let trouble = self.air.send(context, self.station.take_messages());
        context.complain(trouble.unwrap_or_default());
        let (team, counts) = (self.station.team(), self.air.counts);
        let state = team_state::of(team, now_ns, None, self.beat_ms, counts, &mut self.told);
        context.publish_now(TeamInterface::STATE, &state)?;
        context.publish_now(StationInterface::STATE, &state::of(&self.station, now_ns))?;
        Ok(())
    }
}

fn refused(refusal: StationRefusal) -> TeamRefusal {
    TeamRefusal(refusal.to_string())
}

fn place(x_m: f64, y_m: f64) -> Result<Position, TeamRefusal> {
    let no_place = || TeamRefusal(format!("({x_m}, {y_m}) is no place; use metres, at most 1000000 from the origin"));
    team_state::position(x_m, y_m).ok_or_else(no_place)
}

fn fake(id: TeamObjectId) -> Result<ObjectId, TeamRefusal> {
    team_state::core_id(id).ok_or_else(|| refused(StationRefusal::NoFake))
}

impl StationServer for StationModule {
    fn set_fake(&mut self, x_m: f64, y_m: f64) -> Result<TeamObjectId, TeamRefusal> {
        let set = self.station.set_fake(self.clock.now_ns(), place(x_m, y_m)?);
        set.map(team_state::object_id).map_err(refused)
    }

    fn move_fake(&mut self, id: TeamObjectId, x_m: f64, y_m: f64) -> Result<(), TeamRefusal> {
        self.station.move_fake(self.clock.now_ns(), fake(id)?, place(x_m, y_m)?).map_err(refused)
    }

    fn remove_fake(&mut self, id: TeamObjectId) -> Result<(), TeamRefusal> {
        self.station.remove_fake(self.clock.now_ns(), fake(id)?).map_err(refused)
    }

    fn ask(&mut self, kind: StationRequestKind, robot: Option<u8>) -> Result<u32, TeamRefusal> {
        let no_robot = |robot| TeamRefusal(format!("{robot} is no robot; a robot's number is 1 to 254"));
        let robot = robot.map(|robot| RobotId::new(robot).ok_or_else(|| no_robot(robot))).transpose()?;
        let kind = match kind {
            StationRequestKind::Info => RequestKind::Info,
            StationRequestKind::Quit => RequestKind::Quit,
        };
        self.station.ask(self.clock.now_ns(), kind, robot).map_err(refused)
    }
}

impl Team for StationModule {
    fn add_fake(&mut self, x_m: f64, y_m: f64) -> Result<TeamObjectId, TeamRefusal> {
        self.set_fake(x_m, y_m)
    }

    fn end_fake(&mut self, id: TeamObjectId) -> Result<(), TeamRefusal> {
        self.remove_fake(id)
    }
}
