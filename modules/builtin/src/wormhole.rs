//! `wormhole`: lets commands through to the motor, in time and within what the robot sees free. What it decides is in
//! [`rohrpost_supervision`]; here are the clock, the mailboxes and the words.
//!
//! The command in effect is looked at with each promise, each scan and each tick, and what passes is sent to the motor
//! at each look: so the motor's own dead-man time stops the robot if this module dies. No call here waits: neither the
//! motor, nor launch, nor the program can delay a deadline.

mod check;
mod held;
mod navigation;
pub(super) mod program;
mod settings;
mod state;

use super::settings::Settings as _;
pub(super) use check::{notes, problems};
pub use held::holder_text;
use held::{Held, holder};
use navigation::Navigation;
use program::Program;
use rohrpost_mailbox::Name;
use rohrpost_modules::interfaces::{
    ControlRefusal, ControlState, Destination, DriveError, HeldHalt, LaserInterface, Motor, MotorInterface, MotorProxy,
    Supervisor, SupervisorInterface,
};
use rohrpost_modules::runtime::{
    CommandFacts, Context, ModuleClock, Moment, Received, RunningCommand, StreamSubscription, WakeUp,
};
use rohrpost_modules::types::LaserScan;
use rohrpost_modules::{Module, ModuleError};
use rohrpost_supervision::{
    Change, Command, Control, Driver, Envelope, HaltId, Motion, NoSight, Order, Promise, Scan, Sight, Wormhole,
};
use settings::Settings;
use state::Told;
use std::time::Duration;

/// Promises are looked at once in this time at most.
const LOOK_MIN_NS: u64 = 5_000_000;

pub(super) struct WormholeModule {
    settings: Settings,
    wormhole: Wormhole,
    envelope: Envelope,
    motion: Motion,
    sight: Sight,
    seen: Option<Seen>,
    scans: StreamSubscription<LaserScan>,
    motor: MotorProxy,
    navigation: Navigation,
    program: Program,
    /// The module that has taken over.
    person: Option<Name>,
    clock: ModuleClock,
    command: RunningCommand,
    wake_up: WakeUp,
    last_look_ns: Option<u64>,
    /// A promise that came too soon after a look is looked at then.
    next_look_ns: Option<u64>,
    /// Before that the robot stands, whatever was before the start: nothing moves it past the wormhole.
    has_driven: bool,
    time: Epochs,
    held: Held,
    told: Told,
}

/// Whether system time has been one and the same for long enough to say how old a scan is.
struct Epochs {
    settles_ns: u64,
    epoch: u64,
    since_ns: u64,
}

impl Epochs {
    /// A scan from before a step would seem younger or older than it is. As long as one may still come, none counts.
    fn is_steady(&mut self, now_ns: u64, epoch: u64) -> bool {
        if self.epoch != epoch {
            (self.epoch, self.since_ns) = (epoch, now_ns);
        }
        now_ns.saturating_sub(self.since_ns) > self.settles_ns
    }
}

/// A scan that can be believed.
struct Seen {
    taken_ns: u64,
    taken: Moment,
    scan: LaserScan,
    /// From where on something may come, by beam; empty: not known yet, or never.
    moving_m: Vec<f32>,
}

impl Seen {
    fn scan(&self) -> Scan<'_> {
        Scan { moving_m: &self.moving_m, ..seen(self.taken_ns, &self.scan) }
    }
}

impl Module for WormholeModule {
    type Settings = Settings;
    type Interfaces = (SupervisorInterface, MotorInterface);

    fn new(settings: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        settings.check()?;
        let program = Program::open(&settings.program, context)?;
        let scans = context.subscribe_stream(LaserInterface::SCAN, &settings.laser)?;
        // What waits longer than that is not run: the envelope counts on it.
        let motor = context.proxy::<MotorProxy>(&settings.motor)?.with_timeout(settings.lag());
        let navigation = Navigation::open(&settings, context)?;
        let limits = settings.limits();
        context.use_computer_clock();
        context.set_period(Duration::from_millis(settings.look_ms.into()));
        let mut wormhole = Wormhole::new(settings.times());
        let (held, person) = Held::restore(context, settings.starts_held, &mut wormhole);
        Ok(Self {
            wormhole,
            envelope: Envelope::new(limits, settings.mounting()),
            motion: limits.motion(),
            sight: Sight::new(settings.scan_age_max_ns()),
            seen: None,
            scans,
            motor,
            navigation,
            program,
            person,
            clock: context.clock().clone(),
            command: context.running_command(),
            wake_up: context.wake_up(),
            last_look_ns: None,
            next_look_ns: None,
            has_driven: false,
            time: Epochs {
                settles_ns: settings.scan_age_max_ns(),
                epoch: context.now().epoch,
                since_ns: context.clock().monotonic_ns(),
            },
            held,
            told: Told::new(context.installation().classes.clone()),
            settings,
        })
    }

    /// The wheels stand: also when launch has died.
    fn off(&mut self, _: &mut Context) {
        let change = self.wormhole.set_sight(self.clock.monotonic_ns(), false);
        self.seen = None;
        self.follow(change);
        self.look();
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        let now_ns = self.clock.monotonic_ns();
        if self.program.is_another(now_ns, context) {
            let change = self.wormhole.forget_program(now_ns);
            self.follow(change);
            self.navigation.forget(&self.settings);
        }
        let sees = self.sees(now_ns);
        let change = self.wormhole.set_sight(now_ns, sees);
        self.follow(change);
        self.look();
        let state = self.state_now(sees);
        if self.told.is_news(&state) {
            context.complain(state::complaint(&state));
            context.publish_now(SupervisorInterface::CONTROL, &state)?;
        }
        Ok(())
    }

    fn received(&mut self, _: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        // A record that cannot be read is no scan; the last one grows old.
        let Ok(Some(scan)) = data.read(&self.scans) else { return Ok(()) };
        let (now_ns, system) = (self.clock.monotonic_ns(), self.clock.now());
        if !self.time.is_steady(now_ns, system.epoch) {
            return Ok(());
        }
        // Stream and wormhole are on one node, and read one clock: a stamp of the future is none.
        let Some(age_ns) = system.ns.checked_sub(data.head.stamp_ns) else { return Ok(()) };
        let taken_ns = now_ns.saturating_sub(age_ns);
        let since_ns = self.sight.last_taken_ns().unwrap_or(taken_ns);
        let moved = self.has_driven && self.motion.from(since_ns) != Default::default();
        match self.sight.look(now_ns, &seen(taken_ns, &scan), moved) {
            Ok(()) => self.seen = Some(Seen { taken_ns, taken: data.moment(), scan, moving_m: Vec::new() }),
            // The scan before is as true as it was, and grows old.
            Err(NoSight::Repeated | NoSight::Old) => {}
            Err(NoSight::Blind | NoSight::Frozen | NoSight::Malformed) => self.seen = None,
        }
        let sees = self.sees(now_ns);
        let change = self.wormhole.set_sight(now_ns, sees);
        self.follow(change);
        self.look();
        Ok(())
    }
}

fn order_of(command: CommandFacts) -> Order {
    Order { incarnation: command.incarnation, sequence: command.sequence }
}

fn seen(taken_ns: u64, scan: &LaserScan) -> Scan<'_> {
    Scan {
        taken_ns,
        start_rad: scan.start_rad.into(),
        step_rad: scan.step_rad.into(),
        range_max_m: scan.range_max_m.into(),
        ranges_m: &scan.ranges_m,
        moving_m: &[],
    }
}

impl WormholeModule {
    fn sees(&self, now_ns: u64) -> bool {
        self.seen.as_ref().is_some_and(|seen| !self.sight.is_old(now_ns, seen.taken_ns))
    }

    /// Checks the command in effect, and tells the motor.
    fn look(&mut self) {
        let now_ns = self.clock.monotonic_ns();
        let late_ns = self.last_look_ns.map_or(0, |last_ns| now_ns.saturating_sub(last_ns));
        self.told.late_looks += u64::from(late_ns > self.settings.look_max_ns());
        (self.last_look_ns, self.next_look_ns) = (Some(now_ns), None);
        let own = self.navigation.command(now_ns, &self.wormhole);
        self.told.drives_itself(own.is_some());
        let command = match (self.wormhole.in_effect(now_ns).or(own), &mut self.seen) {
            (Some(wanted), Some(seen)) if !self.sight.is_old(now_ns, seen.taken_ns) => {
                if seen.moving_m.is_empty() {
                    seen.moving_m = self.navigation.moving_m(seen.taken, &seen.scan(), self.settings.mounting());
                }
                let verdict = self.envelope.check(now_ns, wanted, &seen.scan(), &self.motion);
                self.told.checked(verdict);
                verdict.command()
            }
            _ => Command::STOP,
        };
        // Not waited for: the next look comes before an answer would help.
        let sent = self.motor.begin_drive(command.speed_m_s, command.turn_rate_rad_s);
        if sent.is_ok() {
            self.motion.tell(now_ns, command);
            self.has_driven |= command != Command::STOP;
        }
        self.told.motor(sent.err().map(|error| error.to_string()));
        self.held.note(&self.wormhole, self.person);
        self.wake_up.at(self.wormhole.due_ns());
    }

    /// Says what changed, and asks for a restart.
    fn follow(&mut self, change: Change) {
        match change.control {
            Some(Control::On) => self.told.gained(),
            Some(Control::Off) => self.told.lost(),
            None => {}
        }
        let Some(run) = change.restart else { return };
        let cause = format!("kept no promise for {} ms", self.settings.wait_ms);
        let asked = self.program.end_failing(&self.settings.program, cause, run);
        self.told.restarted(&self.settings.program, asked);
    }

    /// Takes the promise of the caller, and looks at once.
    fn take(&mut self, duration_ns: u64, speed_m_s: f64, turn_rate_rad_s: f64) -> Result<(), String> {
        let facts = self.command.get();
        let driver = if facts.from == self.program.name { Driver::Program } else { Driver::Person };
        if driver == Driver::Person && self.person != Some(facts.from) {
            let text = match self.person {
                Some(person) => format!("{} has taken over", self.told.name(person)),
                None => format!("{} drives; take over first (`take_over`)", self.settings.program),
            };
            return Err(text);
        }
        if driver == Driver::Program {
            self.program.heard_ns = self.clock.monotonic_ns();
        }
        let promise = Promise { order: order_of(facts), duration_ns, command: Command { speed_m_s, turn_rate_rad_s } };
        let now_ns = self.clock.monotonic_ns();
        let (change, taken) = self.wormhole.promise(now_ns, facts.age_ns, driver, promise);
        self.follow(change);
        // A flood of promises is no flood of commands: those that come in between are looked at a little later.
        let next_look_ns = self.last_look_ns.map_or(0, |last_ns| last_ns + LOOK_MIN_NS);
        let is_lost = change.control == Some(Control::Off);
        if is_lost || taken.is_ok() && now_ns >= next_look_ns {
            self.look();
        } else {
            self.next_look_ns = self.next_look_ns.or(taken.is_ok().then_some(next_look_ns));
            self.wake_up.at(self.next_look_ns.into_iter().chain(self.wormhole.due_ns()).min());
        }
        taken.map_err(|refusal| {
            self.told.refused(refusal);
            refusal.to_string()
        })
    }

    fn state_now(&self, sees: bool) -> ControlState {
        let driven_by = self.person.map_or_else(|| self.settings.program.clone(), |person| self.told.name(person));
        self.told.state(&self.wormhole, driven_by, self.held.halts(&self.wormhole), sees)
    }

    /// What only people may call.
    fn refuse_program(&self) -> Result<Name, ControlRefusal> {
        let from = self.command.get().from;
        if from == self.program.name {
            return Err(ControlRefusal(format!("{} is what is supervised here", self.settings.program)));
        }
        Ok(from)
    }

    /// The halt of this number and holder.
    fn halt_of(&mut self, number: u32, said: &str) -> HaltId {
        let holder = holder(said, &self.told.name(self.command.get().from));
        HaltId { by: self.held.number_of(&self.wormhole.halts, &holder), number }
    }

    fn drive_by(&mut self, person: Option<Name>) {
        if person.is_some() && person == self.person {
            return;
        }
        self.person = person;
        let driver = if person.is_some() { Driver::Person } else { Driver::Program };
        let change = self.wormhole.set_driver(self.clock.monotonic_ns(), driver);
        self.follow(change);
        self.look();
    }
}

impl Motor for WormholeModule {
    fn drive(&mut self, speed_m_s: f64, turn_rate_rad_s: f64) -> Result<(), DriveError> {
        self.take(self.settings.promise_ns(), speed_m_s, turn_rate_rad_s).map_err(DriveError::Hardware)
    }

    /// A promise to stand, and to go nowhere after that: what programs do when they are switched off.
    fn halt(&mut self) -> Result<(), DriveError> {
        let facts = self.command.get();
        if facts.from == self.program.name {
            // One that is older than the last destination is refused below, too.
            let _ = self.navigation.set_destination(order_of(facts), None);
        }
        self.drive(0.0, 0.0)
    }
}

impl Supervisor for WormholeModule {
    fn promise(&mut self, duration_ms: u32, speed_m_s: f64, turn_rate_rad_s: f64) -> Result<(), ControlRefusal> {
        self.take(u64::from(duration_ms) * 1_000_000, speed_m_s, turn_rate_rad_s).map_err(ControlRefusal)
    }

    fn halt(&mut self, number: u32, holder: String) -> Result<(), ControlRefusal> {
        let halted = self.halt_of(number, &holder);
        let halted = self.wormhole.halts.halt(halted);
        self.look();
        halted.map_err(|error| ControlRefusal(error.to_string()))
    }

    fn resume(&mut self, number: u32, holder: String) -> Result<Vec<HeldHalt>, ControlRefusal> {
        if !holder.is_empty() {
            self.refuse_program()?;
        }
        let halted = self.halt_of(number, &holder);
        self.wormhole.halts.resume(halted);
        self.look();
        Ok(self.held.halts(&self.wormhole))
    }

    fn resume_all(&mut self) -> Result<(), ControlRefusal> {
        self.refuse_program()?;
        self.wormhole.halts.resume_all();
        self.look();
        Ok(())
    }

    fn take_over(&mut self) -> Result<(), ControlRefusal> {
        let person = self.refuse_program()?;
        self.drive_by(Some(person));
        Ok(())
    }

    fn give_back(&mut self) -> Result<(), ControlRefusal> {
        self.refuse_program()?;
        self.drive_by(None);
        Ok(())
    }

    fn reset(&mut self) -> Result<(), ControlRefusal> {
        self.refuse_program()?;
        self.wormhole.reset(self.clock.monotonic_ns());
        self.sight.reset();
        self.navigation.reset();
        Ok(())
    }

    fn set_destination(&mut self, destination: Option<Destination>) -> Result<(), ControlRefusal> {
        let facts = self.command.get();
        if facts.from != self.program.name {
            return Err(ControlRefusal(format!("only {} has a destination here", self.settings.program)));
        }
        self.navigation.set_destination(order_of(facts), destination).map_err(ControlRefusal)
    }

    fn state(&mut self) -> ControlState {
        self.state_now(self.sees(self.clock.monotonic_ns()))
    }
}
