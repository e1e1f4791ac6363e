//! A robot with a wormhole, which is `rohrpost run wormhole` with the settings that are usual. Its scanner, program and
//! motor are of the bench.
//!
//! ```text
//!  processor 0                                    processor 1
//!  program, FIFO 50: scans, promises ───────────▶ wormhole.0, as its class is scheduled
//!  motor, FIFO 60: takes the time of a command ◀─
//! ```

use crate::cases::errors::{Done, as_failure};
use crate::motor::{NODE, node_of};
use rohrpost_bench_local::harness::{
    Child, End, Failure, OrFail, Placement, Samples, Scheduling, Scratch, Shared, Zeroable, settle,
};
use rohrpost_bench_local::settings::Settings;
use rohrpost_config::Installation;
use rohrpost_mailbox::{
    Name, Node, Participant, Receiver, Shape, Stamp, StreamId, StreamShape, StreamWriter, SystemClock, local,
    monotonic_ns, sys,
};
use rohrpost_modules::call::{CallEnvelope, Caller, Link};
use rohrpost_modules::interface::Proxy;
use rohrpost_modules::interfaces::{ControlMode, LaserInterface, SupervisorProxy};
use rohrpost_modules::runtime::ToolLink;
use rohrpost_modules::types::LaserScan;
use rohrpost_modules::wire::{append, from_bytes};
use rohrpost_supervision::Command;
use std::f32::consts::TAU;
use std::fs;
use std::os::unix::process::CommandExt;
use std::process::Stdio;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

const MOTOR: Name = Name::new(1, 220, 1, 0);
const WORMHOLE: Name = Name::new(1, 210, 0, 0);
const LASER: Name = Name::new(1, 150, 0, 0);
const PROGRAM: Name = Name::new(1, 140, 0, 0);
const CONFIGURATION: &str = include_str!("robot.toml");
/// Above the program, which may keep their processor busy.
const MOTOR_FIFO: u8 = 60;
/// Beams of a scan.
pub(super) const BEAMS: usize = 360;
const SCAN_EACH: Duration = Duration::from_millis(50);
/// Each command drives so fast. Its turn rate is its number.
const SPEED_M_S: f64 = 0.1;
const TURN_RATE_STEP_RAD_S: f64 = 1e-6;
/// The wormhole starts in milliseconds.
const READY_WITHIN: Duration = Duration::from_secs(20);
/// No answer and no command takes longer.
const ANSWER_WITHIN: Duration = Duration::from_secs(5);
const LOOK_EACH: Duration = Duration::from_micros(200);
/// The longest turn, with all that may halt it.
const PATIENCE: Duration = Duration::from_secs(180);

/// What program and motor tell each other.
#[repr(C)]
pub(super) struct SupervisedTurn {
    /// The time from which the awaited command counts, monotonic ns; 0: none is awaited.
    from_ns: AtomicU64,
    /// Number of the awaited command; 0: the brake.
    awaited: AtomicU64,
    /// The last command that drives.
    driven: AtomicU64,
    /// When the motor had its last command, monotonic ns.
    command_ns: AtomicU64,
    /// Not 0: the program has ended.
    is_over: AtomicU64,
    /// µs.
    samples: Samples,
}

// SAFETY: atomics only.
unsafe impl Zeroable for SupervisedTurn {}

impl SupervisedTurn {
    /// Has the motor take the time of this command, counted from that moment.
    pub(super) fn await_command(&self, number: u64, from_ns: u64) {
        self.awaited.store(number, Ordering::Relaxed);
        // ORDERING: publishes the number; pairs with the load in `note`.
        self.from_ns.store(from_ns, Ordering::Release);
    }

    /// What comes from now on is not timed.
    pub(super) fn await_nothing(&self) {
        self.from_ns.store(0, Ordering::Release);
    }

    /// Whether the motor has the awaited command.
    pub(super) fn has_come(&self) -> bool {
        self.from_ns.load(Ordering::Acquire) == 0
    }

    /// Number of the last command that drives.
    pub(super) fn driven(&self) -> u64 {
        self.driven.load(Ordering::Acquire)
    }

    /// When the motor had its last command, monotonic ns.
    pub(super) fn command_ns(&self) -> u64 {
        self.command_ns.load(Ordering::Acquire)
    }

    /// How many commands were awaited and came.
    pub(super) fn len(&self) -> usize {
        self.samples.len()
    }

    /// The motor has a command.
    fn note(&self, command: Command, now_ns: u64) -> Result<(), Failure> {
        let number = (command.turn_rate_rad_s / TURN_RATE_STEP_RAD_S).round() as u64;
        if command != numbered(number) {
            return Err(Failure::Failed(format!("the motor has {command:?}, which nobody promised")));
        }
        if number != 0 {
            self.driven.store(number, Ordering::Release);
        }
        let from_ns = self.from_ns.load(Ordering::Acquire);
        if from_ns != 0 && number == self.awaited.load(Ordering::Relaxed) {
            let us = now_ns.checked_sub(from_ns).map(|ns| ns as f64 / 1000.0);
            self.samples.push(us.ok_or_else(|| Failure::Failed(format!("command {number} came before its time")))?);
            self.from_ns.store(0, Ordering::Release);
        }
        self.command_ns.store(now_ns, Ordering::Release);
        Ok(())
    }
}

/// The command of this number; 0: the brake.
fn numbered(number: u64) -> Command {
    let speed_m_s = if number == 0 { 0.0 } else { SPEED_M_S };
    Command { speed_m_s, turn_rate_rad_s: number as f64 * TURN_RATE_STEP_RAD_S }
}

/// A node with a wormhole.
pub(super) struct Robot {
    scratch: Scratch,
    installation: Installation,
    wormhole: Child,
}

impl Robot {
    fn start(settings: &Settings) -> Result<Self, Failure> {
        let (rohrpost, scratch) = (settings.command()?, Scratch::new()?);
        let config = scratch.directory().join("robot.toml");
        fs::write(&config, CONFIGURATION).or_fail("its configuration")?;
        let installation = Installation::load(&config).or_fail("its configuration")?;
        let wormhole = Child::start(|| {
            settle(End::Pong, Placement::TwoCores, Scheduling::Normal)?;
            let mut command = std::process::Command::new(&rohrpost);
            command.args(["run", "wormhole", "--name", "wormhole.0", "--config"]).arg(&config);
            command.env("ROHRPOST_DIR", scratch.directory()).stdin(Stdio::null()).stdout(Stdio::null());
            Err(Failure::of("rohrpost run wormhole", command.exec()))
        })?;
        Ok(Self { scratch, installation, wormhole })
    }

    fn join(&self, name: Name) -> Done<Arc<Participant>> {
        let node = Node::create(&node_of(&self.scratch.directory(), &self.installation), 0o700)?;
        Ok(Participant::join(&node, name)?)
    }

    fn motor(&self) -> Done<Receiver> {
        Ok(self.join(MOTOR)?.receiver(MOTOR, Shape::default())?)
    }

    /// Takes what the wormhole sends to the motor, until the program ends.
    fn receive(&self, turn: &SupervisedTurn) -> Done<()> {
        let mut motor = self.motor()?;
        settle(End::Ping, Placement::TwoCores, Scheduling::Fifo)?;
        let refused = |error| Failure::Skipped(format!("no real time here: {error}"));
        sys::schedule(sys::Scheduling::Fifo(MOTOR_FIFO)).map_err(refused)?;
        while turn.is_over.load(Ordering::Acquire) == 0 {
            let Some(package) = motor.receive_timeout(SCAN_EACH) else { continue };
            let now_ns = monotonic_ns();
            let (_, arguments) = CallEnvelope::split(package.body())?;
            let (speed_m_s, turn_rate_rad_s) = from_bytes(arguments)?;
            turn.note(Command { speed_m_s, turn_rate_rad_s }, now_ns)?;
        }
        Ok(())
    }
}

/// One turn: `drive` is the program. Gives µs of each awaited command.
///
/// # Errors
/// What the motor failed with, else the program, or that the wormhole has ended.
pub(super) fn turn(
    settings: &Settings,
    drive: impl FnOnce(&mut Program, &SupervisedTurn) -> Done<()>,
) -> Result<Vec<f64>, Failure> {
    let (mut robot, turn) = (Robot::start(settings)?, Shared::<SupervisedTurn>::new()?);
    let motor = Child::start(|| robot.receive(&turn).map_err(as_failure("the motor")))?;
    let program = Child::start(|| {
        let driven = Program::open(&robot).and_then(|mut program| {
            program.gain_control()?;
            drive(&mut program, &turn)
        });
        turn.is_over.store(1, Ordering::Release);
        driven.map_err(as_failure("the program"))
    })?;
    let deadline = Instant::now() + PATIENCE;
    let driven = program.finish(deadline);
    // That the motor failed says more than that the program waited for it.
    motor.finish(deadline)?;
    driven?;
    if robot.wormhole.has_ended()? {
        return Err(Failure::Failed("the wormhole has ended".into()));
    }
    Ok(turn.samples.all())
}

/// The program that is supervised, with the scanner of its robot, and a person that resets the wormhole.
pub(super) struct Program {
    wormhole: SupervisorProxy,
    person: SupervisorProxy,
    scanner: Scanner,
    number: u64,
}

impl Program {
    fn open(robot: &Robot) -> Done<Self> {
        settle(End::Ping, Placement::TwoCores, Scheduling::Fifo)?;
        let participant = robot.join(PROGRAM)?;
        let replies = participant.receiver(PROGRAM.with_local(local::REPLIES), Shape::default())?;
        let link = Link::new(&participant, PROGRAM, replies);
        let tool = ToolLink::join(&robot.installation, participant.node(), NODE, ANSWER_WITHIN)?;
        let [wormhole, person] = [link, tool.link].map(|link| {
            let proxy = SupervisorProxy::new(&Caller::from(link), WORMHOLE);
            proxy.with_timeout(ANSWER_WITHIN)
        });
        Ok(Self { wormhole, person, scanner: Scanner::open(robot)?, number: 0 })
    }

    /// Promises until the wormhole has started, and lets the program drive.
    fn gain_control(&mut self) -> Done<()> {
        let deadline = Instant::now() + READY_WITHIN;
        loop {
            let promised = self.promise(READY_WITHIN);
            if self.wormhole.state().is_ok_and(|state| state.mode == ControlMode::Active) {
                return Ok(());
            }
            if Instant::now() > deadline {
                promised?;
                return Err("the wormhole gives no control".into());
            }
            std::thread::sleep(SCAN_EACH);
        }
    }

    /// Promises the next command for so long, and waits for the answer. Gives its number.
    pub(super) fn promise(&mut self, duration: Duration) -> Done<u64> {
        self.scanner.scan_if_due()?;
        let number = self.next();
        self.keep(number, duration)?;
        Ok(number)
    }

    /// Number of the next command.
    pub(super) fn next(&mut self) -> u64 {
        self.number += 1;
        self.number
    }

    /// Promises this command for so long, and waits for the answer.
    pub(super) fn keep(&self, number: u64, duration: Duration) -> Done<()> {
        let Command { speed_m_s, turn_rate_rad_s } = numbered(number);
        Ok(self.wormhole.promise(duration.as_millis() as u32, speed_m_s, turn_rate_rad_s)?)
    }

    /// Sends a promise that is none: the wormhole refuses it, and the deadline of the one before stands.
    pub(super) fn send_nonsense(&self, duration: Duration) {
        // That a full mailbox takes no further one is what a flood meets.
        drop(self.wormhole.begin_promise(duration.as_millis() as u32, f64::NAN, 0.0));
    }

    /// Has the wormhole forget how often the program failed. It is less important than all that the program has sent,
    /// so that is over, too.
    pub(super) fn reset(&self) -> Done<()> {
        // Behind a flood there is no room at first.
        if wait_until(|| self.person.reset().is_ok()) { Ok(()) } else { Ok(self.person.reset()?) }
    }

    /// Shows the wormhole what is around the robot.
    pub(super) fn scan_if_due(&mut self) -> Done<()> {
        self.scanner.scan_if_due()
    }
}

/// Looks until it is so; false when that takes longer than anything here may.
pub(super) fn wait_until(is_so: impl Fn() -> bool) -> bool {
    let deadline = Instant::now() + ANSWER_WITHIN;
    while !is_so() {
        if Instant::now() > deadline {
            return false;
        }
        std::thread::sleep(LOOK_EACH);
    }
    true
}

/// The scanner of a robot with much room around it.
struct Scanner {
    writer: StreamWriter,
    clock: SystemClock,
    scan: LaserScan,
    bytes: Vec<u8>,
    due: Instant,
}

impl Scanner {
    fn open(robot: &Robot) -> Done<Self> {
        let participant = robot.join(LASER)?;
        let shape = StreamShape { record_bytes: 8 * BEAMS as u32, ..StreamShape::default() };
        let id = StreamId { name: LASER, number: LaserInterface::SCAN.number };
        Ok(Self {
            clock: SystemClock::open(participant.node()),
            writer: participant.stream_writer(id, shape)?,
            scan: LaserScan {
                start_rad: 0.0,
                step_rad: TAU / BEAMS as f32,
                range_max_m: 8.0,
                ranges_m: vec![0.0; BEAMS],
                pose: None,
            },
            bytes: Vec::new(),
            due: Instant::now(),
        })
    }

    fn scan_if_due(&mut self) -> Done<()> {
        let now = Instant::now();
        if now < self.due {
            return Ok(());
        }
        self.due = now + SCAN_EACH;
        // With noise: readings that stay the same are those of a scanner that is frozen.
        let noise = self.writer.written() as usize;
        let ranges = self.scan.ranges_m.iter_mut().enumerate();
        ranges.for_each(|(beam, range_m)| *range_m = 5.0 + 1e-3 * ((noise + beam) % 17) as f32);
        self.bytes.clear();
        append(&mut self.bytes, &self.scan)?;
        let now = self.clock.now();
        self.writer.write(Stamp { epoch: now.epoch, ns: now.ns }, &self.bytes)?;
        Ok(())
    }
}
