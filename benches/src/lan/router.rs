//! One real router, as launch would start it: `rohrpost router` or `rohrpost team-router`, at its node's place on the
//! network.

use nix::sys::signal::Signal;
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::{Child, OrFail, look_for};
use rohrpost_mailbox::{Class, Name, Node, local, node_directory};
use std::fs;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Of every configuration here.
pub const SYSTEM: u8 = 1;
/// Class of routers.
pub const ROUTER: Class = Class(250);

/// Reading a configuration and making a mailbox takes milliseconds, on a busy computer a second.
const READY_WITHIN: Duration = Duration::from_secs(20);
/// A router told to end has told its peers within this time.
const ENDS_WITHIN: Duration = Duration::from_secs(5);
const LOOK_EACH: Duration = Duration::from_millis(5);

/// The router of the LAN at a node's place in the configuration.
pub fn router_of(node: u8) -> Name {
    Name::new(SYSTEM, ROUTER.0, node, local::COMMANDS)
}

/// Which router.
pub struct RouterSpec<'a> {
    /// The `rohrpost` command.
    pub command: &'a Path,
    /// The configuration.
    pub config: &'a Path,
    /// Name of the installation in it.
    pub installation: &'a str,
    /// The node in it.
    pub node: String,
    /// Subcommand that runs it, which is also the word of its class.
    pub program: &'static str,
    /// Module that it is; the instance is the place of the node in the configuration, from 0.
    pub module: Name,
    /// Directories of nodes and output of routers.
    pub scratch: &'a Path,
}

impl RouterSpec<'_> {
    /// The directory of its node.
    pub fn directory(&self) -> PathBuf {
        let file = node_directory(self.installation, &self.node);
        self.scratch.join(file.file_name().unwrap_or_default())
    }

    /// The file of the router's output.
    fn log(&self) -> PathBuf {
        self.scratch.join(format!("router-{}.log", self.node))
    }
}

/// A router's process; killed when this is dropped.
pub struct Router {
    child: Child,
    module: Name,
    node: String,
    directory: PathBuf,
    log: PathBuf,
}

impl Router {
    /// Starts it; `prepare` runs in its process before, to move it to its place.
    ///
    /// # Errors
    /// When there can be no further process.
    pub fn start(spec: &RouterSpec<'_>, prepare: impl FnOnce() -> Result<(), Failure>) -> Result<Self, Failure> {
        let child = Child::start(|| {
            prepare()?;
            let log = fs::File::create(spec.log()).or_fail("router's log")?;
            let error = Command::new(spec.command)
                .args([spec.program, "--config"])
                .arg(spec.config)
                .args(["--name", &format!("{}.{}", spec.program, spec.module.instance())])
                .env("ROHRPOST_DIR", spec.scratch)
                .stdin(Stdio::null())
                .stdout(Stdio::null())
                .stderr(log)
                .exec();
            Err(Failure::of("rohrpost router", error))
        })?;
        let (module, node) = (spec.module, spec.node.clone());
        Ok(Self { child, module, node, directory: spec.directory(), log: spec.log() })
    }

    /// Waits until its mailbox for others' packages exists, which it makes last.
    ///
    /// # Errors
    /// Its output, if it ended or did not get ready.
    pub fn await_ready(&mut self) -> Result<(), Failure> {
        let transit = self.module.with_local(local::TRANSIT);
        let ready = look_for(READY_WITHIN, LOOK_EACH, || match has_mailbox(&self.directory, transit) {
            true => Ok(Some(true)),
            false => Ok(self.child.has_ended()?.then_some(false)),
        })?;
        if ready == Some(true) {
            return Ok(());
        }
        Err(Failure::Failed(format!("the router of node `{}` did not get ready: {}", self.node, self.said())))
    }

    /// Place of its node in the configuration.
    pub fn index(&self) -> u8 {
        self.module.instance()
    }

    /// Its output.
    pub fn said(&self) -> String {
        fs::read_to_string(&self.log).unwrap_or_default()
    }

    /// Its process.
    pub fn pid(&self) -> i32 {
        self.child.pid()
    }
}

/// Makes keys or certificates.
///
/// # Errors
/// What the command says.
pub(crate) fn make_keys(command: &Path, what: &Path) -> Result<(), Failure> {
    let made = Command::new(command).args(["keys", "new"]).arg(what).output().or_fail("rohrpost keys new")?;
    let said = || Failure::of("rohrpost keys new", String::from_utf8_lossy(&made.stderr));
    if made.status.success() { Ok(()) } else { Err(said()) }
}

/// Ends all, and waits until they have told their peers.
pub fn end_all(routers: &mut [Router]) {
    routers.iter_mut().for_each(|router| router.child.signal(Signal::SIGTERM));
    let give_up = Instant::now() + ENDS_WITHIN;
    for router in routers {
        // One that does not end is killed when it is dropped.
        while !router.child.has_ended().unwrap_or(true) && Instant::now() < give_up {
            std::thread::sleep(LOOK_EACH);
        }
    }
}

fn has_mailbox(directory: &Path, name: Name) -> bool {
    Node::open(directory).is_ok_and(|node| node.look_at(name).is_some())
}
