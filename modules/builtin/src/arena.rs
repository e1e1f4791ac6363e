//! The process that moves a simulated robot and referees it, out of reach of all that may go wrong on the robot's own
//! computers. What it computes is in [`rohrpost_robot::arena`]; here are its socket and its clock.

use crate::settings::RefusedSetting;
use crate::sim::{self, Settings};
use rohrpost_config::{Installation, Module, Program, SettingsError};
use rohrpost_mailbox::monotonic_ns;
use rohrpost_mailbox::sys::{Scheduling, schedule};
use rohrpost_modules::wire::{append, from_bytes};
use rohrpost_robot::arena::{Arena, Drive, Report};
use rohrpost_robot::simulator::{STEP_NS, Touch};
use std::io;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::time::Duration;
use thiserror::Error;

/// Before all modules: physics does not wait.
const PRIORITY: u8 = 98;
/// No command takes more bytes than this: three numbers.
const DRIVE_BYTES_MAX: usize = 32;

/// Why an arena does not begin.
#[derive(Debug, Error)]
pub enum ArenaError {
    /// No robot of the configuration is in an arena.
    #[error("{0}: no module with `builtin = \"sim\"` has `arena` in its settings; write `arena = \"arena.sock\"`")]
    NoRobot(PathBuf),
    /// An arena holds one robot.
    #[error("{0}: `{1}` and `{2}` are in an arena, which holds one robot; leave `arena` out of one of them")]
    Robots(PathBuf, String, String),
    /// The settings of the robot's body are wrong.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// A value of the robot's body is out of range.
    #[error("`{0}`: settings: {1}")]
    Refused(String, String),
    /// The map cannot be read.
    #[error("{0}")]
    Map(String),
    /// Another arena has this socket.
    #[error("{0}: an arena runs there; end it first, or name another socket")]
    Runs(PathBuf),
    /// The socket cannot be made.
    #[error("{0}: cannot make this socket: {1}")]
    Socket(PathBuf, io::Error),
}

/// An arena with its socket. Dropped, it removes that.
pub struct OpenArena {
    arena: Arena,
    path: PathBuf,
    body: PathBuf,
    /// Takes commands, and waits for the next step.
    commands: UnixDatagram,
    /// Tells moments, and never waits for their reader.
    moments: UnixDatagram,
}

impl OpenArena {
    /// The arena that the settings of a configuration's `sim` name: with its map, its seed, its dead-man time.
    ///
    /// # Errors
    /// Says what is missing or wrong, and what would be right.
    pub fn open(installation: &Installation) -> Result<Self, ArenaError> {
        let (module, settings) = robot(installation)?;
        let name = installation.classes.format(module.name);
        let refused = |error: RefusedSetting| ArenaError::Refused(name.clone(), error.to_string());
        crate::settings::Settings::check(&settings).map_err(refused)?;
        let world = sim::world(&settings, &installation.resolve(&settings.map));
        let world = world.map_err(|error| ArenaError::Map(error.to_string()))?;
        let path = installation.resolve(&settings.arena);
        let socket = |error| ArenaError::Socket(path.clone(), error);
        if UnixDatagram::unbound().map_err(socket)?.connect(&path).is_ok() {
            return Err(ArenaError::Runs(path));
        }
        sim::remove(&path).map_err(socket)?;
        let commands = UnixDatagram::bind(&path).map_err(socket)?;
        let moments = UnixDatagram::unbound().map_err(socket)?;
        moments.set_nonblocking(true).map_err(socket)?;
        let body = sim::body_path(&path, &name);
        Ok(Self { arena: Arena::new(world, settings.robot(), monotonic_ns()), path, body, commands, moments })
    }

    /// Where bodies find it.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Moves the robot until it is over. Each touch is told when it happens.
    ///
    /// # Errors
    /// When the socket fails.
    pub fn run(&mut self, mut is_over: impl FnMut() -> bool, mut told: impl FnMut(Touch)) -> io::Result<Report> {
        // Without the right to it the arena is late at times, and catches up.
        let _ = schedule(Scheduling::Fifo(PRIORITY));
        let mut next_ns = monotonic_ns();
        while !is_over() {
            self.take(next_ns, &mut told)?;
            let now_ns = monotonic_ns();
            if now_ns >= next_ns {
                self.arena.step_to(now_ns, &mut told);
                self.tell();
                next_ns = now_ns + STEP_NS;
            }
        }
        Ok(self.arena.report())
    }

    /// Waits for a command until then, and obeys it.
    fn take(&mut self, until_ns: u64, told: impl FnMut(Touch)) -> io::Result<()> {
        let left = Duration::from_nanos(until_ns.saturating_sub(monotonic_ns())).max(Duration::from_micros(1));
        self.commands.set_read_timeout(Some(left))?;
        let mut bytes = [0; DRIVE_BYTES_MAX];
        match self.commands.recv(&mut bytes) {
            Ok(count) => {
                // What is no command, or no motion, moves nothing.
                if let Ok(drive) = from_bytes::<Drive>(&bytes[..count]) {
                    let _ = self.arena.drive(monotonic_ns(), drive, told);
                }
                Ok(())
            }
            Err(error) => match error.kind() {
                io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut | io::ErrorKind::Interrupted => Ok(()),
                _ => Err(error),
            },
        }
    }

    /// A body that is dead or stopped misses it.
    fn tell(&self) {
        let mut bytes = Vec::new();
        if append(&mut bytes, &self.arena.moment()).is_ok() {
            let _ = self.moments.send_to(&bytes, &self.body);
        }
    }
}

impl Drop for OpenArena {
    fn drop(&mut self) {
        let _ = sim::remove(&self.path);
    }
}

/// The one robot that is in an arena.
fn robot(installation: &Installation) -> Result<(&Module, Settings), ArenaError> {
    let document = installation.document();
    let mut found: Option<(&Module, Settings)> = None;
    for module in installation.modules.iter().filter(|module| module.program == Program::Builtin(sim::NAME.into())) {
        let settings: Settings = document.settings_as(module)?;
        if settings.arena.is_empty() {
            continue;
        }
        if let Some((other, _)) = found {
            let [one, two] = [other, module].map(|module| installation.classes.format(module.name));
            return Err(ArenaError::Robots(installation.shown.clone(), one, two));
        }
        found = Some((module, settings));
    }
    found.ok_or_else(|| ArenaError::NoRobot(installation.shown.clone()))
}
