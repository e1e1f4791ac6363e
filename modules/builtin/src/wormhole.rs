//! `wormhole`: lets commands through to the motor, in time and within what the robot sees free. What it decides is in
//! [`rohrpost_supervision`]; here are the clock, the mailboxes and the words.
//!
//! The command in effect is looked at with each promise, each scan and each tick, and what passes is sent to the motor
//! at each look: so the motor's own dead-man time stops the robot if this module dies. No call here waits: neither the
//! motor, nor launch, nor the program can delay a deadline.

mod check;
mod settings;
mod state;

use super::settings::Settings as _;
pub(super) use check::problems;
use rohrpost_launch::launcher::LauncherProxy;
use rohrpost_mailbox::Name;
use rohrpost_modules::interface::Proxy;
use rohrpost_modules::interfaces::{
    ControlRefusal, ControlState, DriveError, LaserInterface, Motor, MotorInterface, MotorProxy, Supervisor,
    SupervisorInterface,
};
use rohrpost_modules::runtime::{Context, ModuleClock, Received, RunningCommand, StreamSubscription, WakeUp};
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
    launch: Option<LauncherProxy>,
    program: Name,
    /// The module that has taken over.
    person: Option<Name>,
    clock: ModuleClock,
    command: RunningCommand,
    wake_up: WakeUp,
    last_look_ns: Option<u64>,
    /// Before that the robot stands, whatever was before the start: nothing moves it past the wormhole.
    has_driven: bool,
    time: Epochs,
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
    scan: LaserScan,
}

impl Module for WormholeModule {
    type Settings = Settings;
    type Interfaces = (SupervisorInterface, MotorInterface);

    fn new(settings: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        settings.check()?;
        let installation = context.installation();
        let program = installation.classes.parse_module(&settings.program)?;
        let launcher = installation.module(program).and_then(|module| installation.node(&module.node));
        let launcher = launcher.map(|node| installation.launch_of(node));
        let launch = launcher.map(|launcher| LauncherProxy::new(context.link(), launcher));
        let scans = context.subscribe_stream(LaserInterface::SCAN, &settings.laser)?;
        // What waits longer than that is not run: the envelope counts on it.
        let motor = context.proxy::<MotorProxy>(&settings.motor)?.with_timeout(settings.lag());
        let limits = settings.limits();
        context.use_computer_clock();
        context.set_period(Duration::from_millis(settings.look_ms.into()));
        Ok(Self {
            wormhole: Wormhole::new(settings.times()),
            envelope: Envelope::new(limits, settings.mounting()),
            motion: limits.motion(),
            sight: Sight::new(settings.scan_age_max_ns()),
            seen: None,
            scans,
            motor,
            launch,
            program,
            person: None,
            clock: context.clock().clone(),
            command: context.running_command(),
            wake_up: context.wake_up(),
            last_look_ns: None,
            has_driven: false,
            time: Epochs { settles_ns: settings.scan_age_max_ns(), epoch: context.now().epoch, since_ns: 0 },
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
        let sees = self.sees(now_ns);
        let change = self.wormhole.set_sight(now_ns, sees);
        self.follow(change);
        self.look();
        let state = self.told.state(&self.wormhole, sees);
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
        let since_ns = self.seen.as_ref().map_or(taken_ns, |seen| seen.taken_ns);
        let moved = self.has_driven && self.motion.from(since_ns) != Default::default();
        match self.sight.look(now_ns, &seen(taken_ns, &scan), moved) {
            Ok(()) => self.seen = Some(Seen { taken_ns, scan }),
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

fn seen(taken_ns: u64, scan: &LaserScan) -> Scan<'_> {
    Scan {
        taken_ns,
        start_rad: scan.start_rad.into(),
        step_rad: scan.step_rad.into(),
        range_max_m: scan.range_max_m.into(),
        ranges_m: &scan.ranges_m,
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
        self.last_look_ns = Some(now_ns);
        let command = match (self.wormhole.in_effect(), &self.seen) {
            (Some(wanted), Some(Seen { taken_ns, scan })) if !self.sight.is_old(now_ns, *taken_ns) => {
                let verdict = self.envelope.check(now_ns, wanted, &seen(*taken_ns, scan), &self.motion);
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
        self.wake_up.at(self.wormhole.due_ns());
    }

    /// Says what changed, and asks for a restart.
    fn follow(&mut self, change: Change) {
        match change.control {
            Some(Control::On) => self.told.gained(),
            Some(Control::Off) => self.told.lost(),
            None => {}
        }
        if change.restart.is_none() {
            return;
        }
        let cause = format!("kept no promise for {} ms", self.settings.wait_ms);
        let program = self.settings.program.clone();
        let asked = self.launch.as_ref().map(|launch| {
            // Of one that began later than that, the silence was another one's.
            launch.begin_end_failing(program, cause, self.settings.wait_ms).map(drop)
        });
        self.told.restarted(&self.settings.program, asked);
    }

    /// Takes the promise of the caller, and looks at once.
    fn take(&mut self, duration_ns: u64, speed_m_s: f64, turn_rate_rad_s: f64) -> Result<(), String> {
        let facts = self.command.get();
        let driver = if facts.from == self.program { Driver::Program } else { Driver::Person };
        if driver == Driver::Person && self.person != Some(facts.from) {
            let text = match self.person {
                Some(person) => format!("{} has taken over", self.told.name(person)),
                None => format!("{} drives; take over first (`take_over`)", self.settings.program),
            };
            return Err(text);
        }
        let promise = Promise {
            order: Order { incarnation: facts.incarnation, sequence: facts.sequence },
            duration_ns,
            command: Command { speed_m_s, turn_rate_rad_s },
        };
        let now_ns = self.clock.monotonic_ns();
        let (change, taken) = self.wormhole.promise(now_ns, facts.age_ns, driver, promise);
        self.follow(change);
        // A flood of promises is no flood of commands: those that come in between are looked at a little later.
        let next_look_ns = self.last_look_ns.map_or(0, |last_ns| last_ns + LOOK_MIN_NS);
        let is_lost = change.control == Some(Control::Off);
        if is_lost || taken.is_ok() && now_ns >= next_look_ns {
            self.look();
        } else {
            let later_ns = taken.is_ok().then_some(next_look_ns);
            self.wake_up.at(later_ns.into_iter().chain(self.wormhole.due_ns()).min());
        }
        taken.map_err(|refusal| {
            self.told.refused(refusal);
            refusal.to_string()
        })
    }

    /// What only people may call.
    fn refuse_program(&self) -> Result<Name, ControlRefusal> {
        let from = self.command.get().from;
        if from == self.program {
            return Err(ControlRefusal(format!("{} is what is supervised here", self.settings.program)));
        }
        Ok(from)
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

    /// A promise to stand.
    fn halt(&mut self) -> Result<(), DriveError> {
        self.drive(0.0, 0.0)
    }
}

impl Supervisor for WormholeModule {
    fn promise(&mut self, duration_ms: u32, speed_m_s: f64, turn_rate_rad_s: f64) -> Result<(), ControlRefusal> {
        self.take(u64::from(duration_ms) * 1_000_000, speed_m_s, turn_rate_rad_s).map_err(ControlRefusal)
    }

    fn halt(&mut self, number: u32) -> Result<(), ControlRefusal> {
        let by = self.command.get().from.raw();
        let halted = self.wormhole.halts.halt(HaltId { by, number });
        self.look();
        halted.map_err(|error| ControlRefusal(error.to_string()))
    }

    fn resume(&mut self) -> Vec<String> {
        self.wormhole.halts.resume(self.command.get().from.raw());
        self.look();
        self.told.halted_by(&self.wormhole)
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
        Ok(())
    }

    fn state(&mut self) -> ControlState {
        let sees = self.sees(self.clock.monotonic_ns());
        self.told.state(&self.wormhole, sees)
    }
}
