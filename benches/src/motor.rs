//! A module that does nothing but answer: what commands are measured with. It is this program again, in a process of
//! its own.

use rohrpost_bench_local::harness::{
    Child, End, Failure, OrFail, Placement, Samples, Scheduling, given_away, require_asleep, settle,
};
use rohrpost_bench_local::settings::Settings;
use rohrpost_config::Installation;
use rohrpost_mailbox::{Name, Node, ParticipantInfo, node_directory};
use rohrpost_modules::call::Caller;
use rohrpost_modules::interface::Proxy;
use rohrpost_modules::interfaces::{DriveError, Motor, MotorInterface, MotorProxy};
use rohrpost_modules::runtime::{Context, Start, ToolLink, run_started};
use rohrpost_modules::{Module, ModuleError, NoSettings};
use std::error::Error;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Its name.
pub const MOTOR: Name = Name::new(1, 200, 0, 0);
/// The node of a configuration with a single one.
pub const NODE: &str = "main";
/// A module starts in milliseconds.
const READY_WITHIN: Duration = Duration::from_secs(20);
const LOOK_EACH: Duration = Duration::from_millis(2);
/// No command waits longer for its answer.
const ANSWER_WITHIN: Duration = Duration::from_secs(5);
/// Commands of a turn, and those before them that do not count.
const COMMANDS: usize = 10_000;
const WARM_UP: usize = 1_000;
/// Before a command to a module on the other processor, which goes to sleep meanwhile.
const PAUSE: Duration = Duration::from_micros(100);

/// Why a motor does not answer.
type Unreachable = Box<dyn Error + Send + Sync>;

/// Set for the hidden program that is the module.
pub const ROLE: &str = "ROHRPOST_BENCH_MODULE";

/// A configuration with it as a module of this program, with more keys.
pub fn configuration(program: &str, keys: &str) -> String {
    format!(
        r#"
installation = "bench"
[system]
name = "bench"
id = 1
[classes]
motor = {{ id = 200, text = "Drives" }}
logd = {{ id = 24, text = "Records" }}
tool = {{ id = 16, text = "Tools" }}
[nodes.{NODE}]
[[module]]
name = "motor.0"
program = {program:?}
{keys}
"#
    )
}

/// Where the node of a configuration lies, if nodes lie in `folder`.
pub fn node_of(folder: &Path, installation: &Installation) -> PathBuf {
    folder.join(node_directory(&installation.name, NODE).file_name().unwrap_or_default())
}

/// Starts it as `motor.0` of a configuration; nodes lie in `folder`.
///
/// # Errors
/// When there can be no further process.
pub fn start_motor(folder: &Path, config: &Path, placement: Placement) -> Result<Child, Failure> {
    Child::start(|| {
        settle(End::Pong, placement, Scheduling::Fifo)?;
        let own = std::env::current_exe().or_fail("this program")?;
        let error = Command::new(own)
            .arg("--config")
            .arg(config)
            .args(["--name", "motor.0"])
            .env(ROLE, "")
            .env("ROHRPOST_DIR", folder)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .exec();
        Err(Failure::of("a module", error))
    })
}

/// Joins the node of this configuration as a tool, and waits until the motor answers.
///
/// # Errors
/// When the configuration is no good, or it does not answer.
pub fn reach_motor(folder: &Path, config: &Path) -> Result<(Arc<Node>, MotorProxy), Unreachable> {
    let installation = Installation::load(config)?;
    let path = node_of(folder, &installation);
    let deadline = Instant::now() + READY_WITHIN;
    // The module makes it.
    let node = loop {
        match Node::open(&path) {
            Ok(node) => break node,
            Err(error) if Instant::now() > deadline => return Err(error.into()),
            Err(_) => std::thread::sleep(LOOK_EACH),
        }
    };
    let tool = ToolLink::join(&installation, &node, NODE, ANSWER_WITHIN)?;
    let motor = MotorProxy::new(&Caller::from(tool.link), MOTOR).with_timeout(ANSWER_WITHIN);
    await_answer(&motor)?;
    Ok((node, motor))
}

/// Waits until the motor answers, which has just been started, or will be.
///
/// # Errors
/// When it does not.
pub fn await_answer(motor: &MotorProxy) -> Result<(), Unreachable> {
    let deadline = Instant::now() + READY_WITHIN;
    while let Err(error) = motor.halt() {
        if Instant::now() > deadline {
            return Err(error.into());
        }
        std::thread::sleep(LOOK_EACH);
    }
    Ok(())
}

/// The motor that runs on a node, as the node knows it.
///
/// # Errors
/// When there is none.
pub fn find_motor(node: &Node) -> Result<ParticipantInfo, Failure> {
    let found = node.participants().into_iter().find(|participant| participant.module == MOTOR);
    found.ok_or_else(|| Failure::Failed("no motor runs".into()))
}

/// A command to the motor and its answer. Both ends sleep before each.
#[derive(Clone, Copy, Debug)]
pub enum CommandedEvent {
    /// Both on one processor: the one runs only while the other sleeps. No processor is woken, so it takes the least
    /// time, of which what is compared is the largest part.
    OneProcessor,
    /// Each on its own: a processor is woken for each.
    Woken,
}

impl CommandedEvent {
    /// Where both run.
    pub fn placement(self) -> Placement {
        match self {
            Self::OneProcessor => Placement::OneCore,
            Self::Woken => Placement::TwoCores,
        }
    }

    fn before_each(self) {
        match self {
            Self::OneProcessor => {}
            Self::Woken => std::thread::sleep(PAUSE),
        }
    }

    /// Gives the motor commands, one after the other; µs of each. Changes how the calling process is placed and
    /// scheduled.
    ///
    /// # Errors
    /// When it does not answer; [`Failure::Skipped`] when it was awake before some.
    pub fn time(
        self,
        settings: &Settings,
        folder: &Path,
        config: &Path,
        samples: &Samples,
    ) -> Result<Arc<Node>, Unreachable> {
        settle(End::Ping, self.placement(), Scheduling::Fifo)?;
        let (node, motor) = reach_motor(folder, config)?;
        for _ in 0..settings.count(WARM_UP) {
            self.before_each();
            motor.drive(0.5, 0.25)?;
        }
        let (commands, pid) = (settings.count(COMMANDS), find_motor(&node)?.pid.cast_signed());
        let slept = given_away(pid)?;
        for _ in 0..commands {
            self.before_each();
            let began = Instant::now();
            motor.drive(0.5, 0.25)?;
            samples.push(began.elapsed().as_secs_f64() * 1e6);
        }
        require_asleep("the module", commands as u64, given_away(pid)?.saturating_sub(slept))?;
        Ok(node)
    }
}

/// If this process was started as the module: runs it until it is killed.
pub(crate) fn run_hidden_module() -> Option<Result<(), Failure>> {
    std::env::var_os(ROLE)?;
    let ended = Start::from_environment().and_then(run_started::<CommandedMotor>);
    Some(ended.or_fail("the module"))
}

/// Does nothing else. At a speed that is no number it hangs.
struct CommandedMotor {
    speed_m_s: f64,
}

impl Module for CommandedMotor {
    type Settings = NoSettings;
    type Interfaces = MotorInterface;

    fn new(_: NoSettings, _: &mut Context) -> Result<Self, ModuleError> {
        Ok(Self { speed_m_s: 0.0 })
    }
}

impl Motor for CommandedMotor {
    fn drive(&mut self, speed_m_s: f64, _: f64) -> Result<(), DriveError> {
        while speed_m_s.is_nan() {
            std::thread::park();
        }
        self.speed_m_s = speed_m_s;
        Ok(())
    }

    fn halt(&mut self) -> Result<(), DriveError> {
        self.speed_m_s = 0.0;
        Ok(())
    }
}
