//! A module that does nothing but answer: what commands are measured with. It is this program again, in a process of
//! its own.

use rohrpost_bench_local::harness::{Child, End, Failure, OrFail, Placement, Scheduling, settle};
use rohrpost_config::Installation;
use rohrpost_mailbox::{Name, Node, node_directory};
use rohrpost_modules::call::Caller;
use rohrpost_modules::interface::Proxy;
use rohrpost_modules::interfaces::{DriveError, Motor, MotorInterface, MotorProxy};
use rohrpost_modules::runtime::{Context, Start, ToolLink, run_started};
use rohrpost_modules::{Module, ModuleError, NoSettings};
use std::error::Error;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Its name.
pub const MOTOR: Name = Name::new(1, 200, 0, 0);
/// The node of a configuration with a single one.
const NODE: &str = "main";
/// A module starts in milliseconds.
const READY_WITHIN: Duration = Duration::from_secs(20);
const LOOK_EACH: Duration = Duration::from_millis(2);
/// No command waits longer for its answer.
const ANSWER_WITHIN: Duration = Duration::from_secs(5);

/// Set for the hidden program that is the module.
const ROLE: &str = "ROHRPOST_BENCH_MODULE";

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
pub fn reach_motor(folder: &Path, config: &Path) -> Result<(Arc<Node>, MotorProxy), Box<dyn Error + Send + Sync>> {
    let installation = Installation::load(config)?;
    let path = node_directory(&installation.name, NODE);
    let deadline = Instant::now() + READY_WITHIN;
    // The module makes it.
    let node = loop {
        match Node::open(&folder.join(path.file_name().unwrap_or_default())) {
            Ok(node) => break node,
            Err(error) if Instant::now() > deadline => return Err(error.into()),
            Err(_) => std::thread::sleep(LOOK_EACH),
        }
    };
    let tool = ToolLink::join(&installation, &node, NODE, ANSWER_WITHIN)?;
    let motor = MotorProxy::new(&Caller::from(tool.link), MOTOR).with_timeout(ANSWER_WITHIN);
    while let Err(error) = motor.halt() {
        if Instant::now() > deadline {
            return Err(error.into());
        }
        std::thread::sleep(LOOK_EACH);
    }
    Ok((node, motor))
}

/// If this process was started as the module: runs it until it is killed.
pub(crate) fn run_hidden_module() -> Option<Result<(), Failure>> {
    std::env::var_os(ROLE)?;
    let ended = Start::from_environment().and_then(run_started::<CommandedMotor>);
    Some(ended.or_fail("the module"))
}

/// Does nothing else.
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
        self.speed_m_s = speed_m_s;
        Ok(())
    }

    fn halt(&mut self) -> Result<(), DriveError> {
        self.speed_m_s = 0.0;
        Ok(())
    }
}
