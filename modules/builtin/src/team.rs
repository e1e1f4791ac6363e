//! `team`: finds other robots and agrees with them on group, leader and what is seen. What it makes of what it hears is
//! in [`rohrpost_team`]; here are the clock, the mailbox and the map.
//!
//! Each beat it looks around, sends what is new and a hello to system 255, and publishes its state. Whichever way there
//! is carries the messages: the TCP router, or that of `[team]`.

mod air;
mod check;
mod clock;
mod settings;
pub(crate) mod state;
pub(crate) mod store;
mod surroundings;

use super::settings::Settings as _;
pub(crate) use air::Air;
use air::{HELLO, MESSAGES, RECORDS, SLOTS};
pub(super) use check::problems;
pub(crate) use clock::OwnClock;
use rohrpost_mailbox::{ALL_SYSTEMS, Name, Shape};
use rohrpost_modules::interfaces::{Team, TeamCounts, TeamInterface, TeamObjectId, TeamRefusal};
use rohrpost_modules::runtime::{Context, Received};
use rohrpost_modules::{Module, ModuleError};
use rohrpost_team::group::Hello;
use rohrpost_team::view::{RECORDS_BYTES_MAX, Records};
use rohrpost_team::{Beat, RobotId, Team as TeamCore};
use settings::Settings;
use state::TeamTold;
use std::time::Duration;
use store::Store;
use surroundings::Surroundings;

pub(super) struct TeamModule {
    team: TeamCore,
    clock: OwnClock,
    surroundings: Surroundings,
    store: Store,
    to: Name,
    beat_ms: u32,
    counts: TeamCounts,
    told: TeamTold,
}

impl Module for TeamModule {
    type Settings = Settings;
    type Interfaces = TeamInterface;

    fn new(settings: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        settings.check()?;
        let name = context.me();
        let robot =
            RobotId::new(name.system()).ok_or_else(|| ModuleError::configuration("its system has no number"))?;
        let body_bytes_max = (rohrpost_modules::common::DataHead::BYTES + RECORDS_BYTES_MAX) as u16;
        context.open_mailbox_to_all(MESSAGES, Shape { slots: SLOTS, body_bytes_max, ..Shape::default() })?;
        let surroundings = Surroundings::open(&settings, context)?;
        let (store, incarnation) = Store::open(settings.store.as_deref(), context);
        context.use_computer_clock();
        context.set_period(Duration::from_millis(settings.beat_ms.into()));
        Ok(Self {
            team: TeamCore::new(robot, incarnation, surroundings.map(), settings.team()),
            clock: OwnClock::begin(context),
            surroundings,
            store,
            to: Name::new(ALL_SYSTEMS, name.class().0, name.instance(), MESSAGES),
            beat_ms: settings.beat_ms,
            counts: TeamCounts::default(),
            told: TeamTold::default(),
        })
    }

    fn received(&mut self, _: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        if self.surroundings.take(data)? {
            return Ok(());
        }
        let is_theirs = data.from.class() == self.to.class() && data.mailbox == MESSAGES;
        if !(is_theirs && self.hear(data)) {
            self.counts.malformed += 1;
        }
        Ok(())
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        let now_ns = self.clock.now_ns();
        let (team, surroundings) = (&mut self.team, &mut self.surroundings);
        let pose = surroundings.pose();
        surroundings.look(|obstacles, can_see| team.look(now_ns, obstacles, can_see));
        let beat = team.beat(now_ns, pose);
        self.store.keep(context, self.team.group().version().incarnation);
        let way = self.send(context, beat);
        context.complain(way.err().or_else(|| self.surroundings.complaint()).unwrap_or_default());
        let state = state::of(&self.team, now_ns, pose, self.beat_ms, self.counts, &mut self.told);
        context.publish_now(TeamInterface::STATE, &state)?;
        Ok(())
    }
}

impl TeamModule {
    /// Sends what a beat has, all of it whatever becomes of one message.
    ///
    /// # Errors
    /// Why the last one that was not sent was not.
    fn send(&mut self, context: &Context, beat: Beat) -> Result<(), String> {
        let Beat { objects, synchro, hello } = beat;
        let mut sent = Ok(());
        let counts = &mut self.counts;
        let objects = objects.map(|records| (&mut counts.records_sent, RECORDS, records.encode()));
        let synchro = synchro.map(|records| (&mut counts.synchros_sent, RECORDS, records.encode()));
        let hello = (&mut counts.hellos_sent, HELLO, hello.encode());
        for (count, number, bytes) in objects.into_iter().chain(synchro).chain([hello]) {
            match context.send_data(self.to, number, &bytes) {
                Ok(()) => *count += 1,
                Err(error) => {
                    counts.unsent += 1;
                    sent = Err(format!("teammates do not hear this robot: {error}"));
                }
            }
        }
        sent
    }

    /// Takes a message; false if it is none, or not in the name of the robot that sent it.
    fn hear(&mut self, data: &Received<'_>) -> bool {
        let now_ns = self.clock.now_ns();
        let is_own = data.from.system() == self.to_robot().get();
        let is_senders = |from: RobotId| from.get() == data.from.system();
        match data.number {
            HELLO => {
                let Some(hello) = Hello::decode(data.value).ok().filter(|hello| is_senders(hello.from)) else {
                    return false;
                };
                self.counts.hellos_heard += u64::from(!is_own);
                // Also one in this robot's own name: another robot may have it.
                self.team.hear_hello(now_ns, &hello);
            }
            RECORDS => {
                let records = Records::decode(data.value).ok().filter(|records| is_senders(records.from));
                let Some(records) = records else { return false };
                self.counts.records_heard += u64::from(!is_own);
                self.team.hear_records(now_ns, records);
            }
            _ => return false,
        }
        true
    }

    fn to_robot(&self) -> RobotId {
        self.team.group().me()
    }
}

impl Team for TeamModule {
    fn add_fake(&mut self, x_m: f64, y_m: f64) -> Result<TeamObjectId, TeamRefusal> {
        let refusal =
            || TeamRefusal(format!("({x_m}, {y_m}) is no place; use metres, at most 1000000 from the origin"));
        let position = state::position(x_m, y_m).ok_or_else(refusal)?;
        Ok(state::object_id(self.team.add_fake(self.clock.now_ns(), position)))
    }

    fn end_fake(&mut self, id: TeamObjectId) -> Result<(), TeamRefusal> {
        let ended = state::core_id(id).is_some_and(|id| self.team.end_fake(self.clock.now_ns(), id));
        if ended { Ok(()) } else { Err(TeamRefusal("this module has made up no such intruder".into())) }
    }
}
