//! What launch reports to the service manager that started it (systemd). Without a manager, it reports nothing.
//!
//! The protocol is sd_notify(3): lines in a datagram. The existing crate blocks when the manager does not read, and
//! knows no abstract sockets; launch must never block, and containers use such sockets.

use rohrpost_launch::Launch;
use rohrpost_launch::launcher::Phase;
use std::collections::VecDeque;
use std::ffi::OsStr;
use std::io::{self, ErrorKind};
use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::time::{Duration, Instant};

/// Messages that wait for a manager that does not read; the oldest are dropped first.
const WAITING_MAX: usize = 8;

/// A service manager that expects messages from launch.
pub(super) struct Manager {
    socket: Option<(UnixDatagram, SocketAddr)>,
    waiting: VecDeque<String>,
    /// Its watchdog expects two messages in this time.
    watchdog: Option<Duration>,
    ping_at: Instant,
    status: String,
}

impl Manager {
    /// The manager that the environment names, if any. An unusable one does not keep a robot from starting:
    /// the result is none, and `warn` gets the reason.
    pub(super) fn from_environment(warn: impl FnOnce(&str)) -> Self {
        let socket = std::env::var_os("NOTIFY_SOCKET").and_then(|name| match connect(&name) {
            Ok(socket) => Some(socket),
            Err(error) => {
                warn(&format!("no word to the service manager: NOTIFY_SOCKET={}: {error}", name.display()));
                None
            }
        });
        let number = |name| std::env::var(name).ok().and_then(|text| text.parse::<u64>().ok());
        let ours = number("WATCHDOG_PID").is_none_or(|pid| pid == u64::from(std::process::id()));
        let watchdog = number("WATCHDOG_USEC").filter(|us| ours && *us > 0).map(Duration::from_micros);
        Self { socket, waiting: VecDeque::new(), watchdog, ping_at: Instant::now(), status: String::new() }
    }

    /// The modules are being started.
    pub(super) fn starting(&mut self, node: &str) {
        self.say(format!("STATUS=starting the modules of node {node}"));
    }

    /// All modules are on.
    pub(super) fn ready(&mut self, launch: &Launch) {
        self.status = status(launch);
        // It is off after a way back, until here.
        let watchdog = self.watchdog.map(|period| format!("\nWATCHDOG_USEC={}", period.as_micros()));
        self.say(format!("READY=1\nSTATUS={}{}", self.status, watchdog.unwrap_or_default()));
    }

    /// Launch has completed a round of its loop. Sends the watchdog's message when it is due, and changes.
    pub(super) fn alive(&mut self, launch: &Launch) {
        if self.socket.is_none() {
            return;
        }
        let status = status(launch);
        if status != self.status {
            self.say(format!("STATUS={status}"));
            self.status = status;
        }
        if let Some(period) = self.watchdog
            && Instant::now() >= self.ping_at
        {
            self.ping_at = Instant::now() + period / 2;
            self.say("WATCHDOG=1".into());
        }
        self.send();
    }

    /// How long launch may sleep before the next round.
    pub(super) fn wait(&self) -> Duration {
        match (&self.socket, self.watchdog) {
            (Some(_), Some(_)) => self.ping_at.saturating_duration_since(Instant::now()),
            _ => Duration::MAX,
        }
    }

    /// All modules are being stopped. The watchdog is off from here on: `TimeoutStopSec` bounds their time.
    pub(super) fn stopping(&mut self) {
        self.say("STOPPING=1\nSTATUS=stopping the modules, the last first\nWATCHDOG_USEC=0".into());
    }

    /// All modules are being stopped, and others are started next. The watchdog is off until they are on.
    pub(super) fn going_back(&mut self) {
        self.say("STATUS=stopping the modules, to go back to the bundle before\nWATCHDOG_USEC=0".into());
    }

    fn say(&mut self, words: String) {
        if self.waiting.len() == WAITING_MAX {
            self.waiting.pop_front();
        }
        self.waiting.push_back(words);
        self.send();
    }

    fn send(&mut self) {
        let Some((socket, address)) = &self.socket else { return self.waiting.clear() };
        while let Some(words) = self.waiting.front() {
            match socket.send_to_addr(words.as_bytes(), address) {
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                // A manager that is gone gets no message; that does not stop a robot.
                Ok(_) | Err(_) => self.waiting.pop_front(),
            };
        }
    }
}

fn connect(name: &OsStr) -> io::Result<(UnixDatagram, SocketAddr)> {
    let (address, socket) = (address(name)?, UnixDatagram::unbound()?);
    socket.set_nonblocking(true)?;
    Ok((socket, address))
}

/// A path, or an abstract name after an `@`.
fn address(name: &OsStr) -> io::Result<SocketAddr> {
    match name.as_bytes() {
        [b'@', name @ ..] => SocketAddr::from_abstract_name(name),
        _ => SocketAddr::from_pathname(name),
    }
}

/// One line: how many modules run, and which do not.
fn status(launch: &Launch) -> String {
    let (mut running, mut others) = (0, String::new());
    for (module, phase) in launch.phases() {
        if phase == Phase::Running {
            running += 1;
        } else {
            others.push_str(&format!(", {module} {}", phase.name()));
        }
    }
    format!("{running} modules run{others}")
}
