//! Two systems that meet at a TCP router, each a single node: real processes, as launch would start them.

use crate::lan::router::make_keys;
use rohrpost_bench_local::Failure;
use rohrpost_bench_local::harness::{Child, End, OrFail, Placement, Scheduling, Scratch, look_for, settle};
use rohrpost_bench_local::settings::Settings;
use rohrpost_config::Installation;
use rohrpost_mailbox::{Class, Name, node_directory};
use rohrpost_routers::tcp::{ClientSeal, Holder};
use serde::Deserialize;
use std::fs;
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

const INSTALLATION: &str = "bench-tcp";
/// Class of what is timed.
const BENCH: Class = Class(96);
/// More than any case has.
const CLIENTS_MAX: u16 = 2048;
/// Reading a configuration and making a mailbox takes milliseconds, on a busy computer a second.
const READY_WITHIN: Duration = Duration::from_secs(20);
const LOOK_EACH: Duration = Duration::from_millis(10);

/// Whether what passes is sealed by TLS.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Security {
    /// It is not.
    None,
    /// It is, and both ends show certificates.
    Tls,
}

/// Both systems, until this is dropped.
pub struct Systems {
    /// The TCP router, then clients.
    processes: Vec<Process>,
    command: PathBuf,
    security: Security,
    address: SocketAddr,
    common: u64,
    scratch: Scratch,
}

struct Process {
    child: Child,
    log: PathBuf,
}

impl Systems {
    /// Writes both configurations, and starts the TCP router alone.
    ///
    /// # Errors
    /// What it failed with; [`Failure::Skipped`] when the command is not there.
    pub fn start(settings: &Settings, security: Security) -> Result<Self, Failure> {
        let (command, scratch) = (settings.command()?, Scratch::new()?);
        let address = free_address()?;
        for end in [End::Ping, End::Pong] {
            let text = configuration(end, security, address);
            fs::write(config(&scratch, end), text).or_fail("configuration")?;
        }
        let installation = Installation::load(&config(&scratch, End::Ping));
        let common = installation.or_fail("configuration")?.digest().common;
        let mut systems = Self { processes: Vec::new(), command, security, address, common, scratch };
        if security == Security::Tls {
            for end in [End::Ping, End::Pong] {
                make_keys(&systems.command, &systems.configuration(end))?;
            }
        }
        systems.launch("tcp-router", "tcp.255", End::Ping, End::Pong)?;
        systems.await_ready(|_| Ok(TcpStream::connect(address).is_ok()))?;
        Ok(systems)
    }

    /// Starts the client of each node, and waits until both take part.
    ///
    /// # Errors
    /// What a client failed with.
    pub fn with_clients(mut self) -> Result<Self, Failure> {
        for end in [End::Ping, End::Pong] {
            self.launch("tcp-client", "tcp.0", end, end)?;
        }
        for end in [End::Ping, End::Pong] {
            self.await_ready(|systems| systems.is_up(end))?;
        }
        Ok(self)
    }

    /// Where the TCP router listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Where both nodes lie.
    pub fn folder(&self) -> PathBuf {
        self.scratch.directory()
    }

    /// The configuration of an end.
    pub fn configuration(&self, end: End) -> PathBuf {
        config(&self.scratch, end)
    }

    /// Digest of what is equal in both configurations.
    pub fn common(&self) -> u64 {
        self.common
    }

    /// Process of the TCP router.
    pub fn router_pid(&self) -> i32 {
        self.processes[0].child.pid()
    }

    /// What sessions of the second system begin their connections with; none if nothing is sealed.
    ///
    /// # Errors
    /// When the certificates are no good.
    pub fn seal(&self) -> Result<Option<ClientSeal>, Failure> {
        let holder = Holder::Node { node: End::Pong.node().into(), system: system_of(End::Pong) };
        let load = || ClientSeal::load(&self.scratch.directory().join("certificates"), &holder);
        (self.security == Security::Tls).then(load).transpose().or_fail("certificates")
    }

    /// The directory of an end's node.
    pub fn directory(&self, end: End) -> PathBuf {
        let file = node_directory(INSTALLATION, end.node());
        self.scratch.directory().join(file.file_name().unwrap_or_default())
    }

    /// Fails with the output of an ended process.
    ///
    /// # Errors
    /// If one has ended.
    pub fn check(&mut self) -> Result<(), Failure> {
        for process in &mut self.processes {
            if process.child.has_ended()? {
                return Err(Failure::Failed(format!("ended: {}", process.said())));
            }
        }
        Ok(())
    }

    fn launch(&mut self, what: &str, name: &str, end: End, place: End) -> Result<(), Failure> {
        let log = self.scratch.directory().join(format!("{what}-{}.log", end.node()));
        let child = Child::start(|| {
            let log = fs::File::create(&log).or_fail("log")?;
            settle(place, Placement::TwoCores, Scheduling::Fifo)?;
            let error = Command::new(&self.command)
                .args([what, "--name", name, "--config"])
                .arg(config(&self.scratch, end))
                .env("ROHRPOST_DIR", self.scratch.directory())
                .stdin(Stdio::null())
                .stdout(Stdio::null())
                .stderr(log)
                .exec();
            Err(Failure::of(what, error))
        })?;
        self.processes.push(Process { child, log });
        Ok(())
    }

    fn await_ready(&mut self, is_ready: impl Fn(&Self) -> Result<bool, Failure>) -> Result<(), Failure> {
        let ready = look_for(READY_WITHIN, LOOK_EACH, || {
            self.check()?;
            Ok(is_ready(self)?.then_some(()))
        })?;
        let said = || self.processes.iter().map(Process::said).collect::<String>();
        ready.ok_or_else(|| Failure::Failed(format!("the systems did not get ready: {}", said())))
    }

    /// As a user would ask.
    fn is_up(&self, end: End) -> Result<bool, Failure> {
        #[derive(Deserialize)]
        struct StatusJson {
            beyond: Option<Beyond>,
        }
        #[derive(Deserialize)]
        struct Beyond {
            state: String,
        }
        let asked = Command::new(&self.command)
            .args(["net", "--json", "--config"])
            .arg(config(&self.scratch, end))
            .env("ROHRPOST_DIR", self.scratch.directory())
            .output();
        let output = asked.or_fail("rohrpost net")?;
        // The file is empty until the client writes.
        let told: Vec<StatusJson> = serde_json::from_slice(&output.stdout).unwrap_or_default();
        Ok(told.into_iter().filter_map(|told| told.beyond).any(|beyond| beyond.state == "up"))
    }
}

impl Process {
    fn said(&self) -> String {
        fs::read_to_string(&self.log).unwrap_or_default()
    }
}

/// First byte of the names of an end.
pub fn system_of(end: End) -> u8 {
    if end == End::Ping { 1 } else { 2 }
}

/// The mailbox of a timed module at this end; each turn has one of its own.
pub fn bench(end: End, turn: u8) -> Name {
    Name::new(system_of(end), BENCH.0, 0, turn)
}

/// The mailbox of a session of the crowd, all of which belong to the second system. No name of its module, since those
/// belong to its node.
pub fn guest(index: u16) -> Name {
    let [instance, local] = (index + 256).to_be_bytes();
    Name::new(system_of(End::Pong), BENCH.0, instance, local)
}

fn config(scratch: &Scratch, end: End) -> PathBuf {
    Path::new(&scratch.directory()).join(format!("{}.toml", end.node()))
}

/// A free port of a loopback address of this process alone: nobody else connects from there, and so takes the port
/// meanwhile.
pub fn free_address() -> Result<SocketAddr, Failure> {
    let [_, high, middle, low] = std::process::id().to_be_bytes();
    // 127.128.0.0/9 without its first and last addresses; a PID has 22 bits.
    let own = Ipv4Addr::new(127, 128 | high, middle, low.clamp(1, 254));
    let found = TcpListener::bind((own, 0)).and_then(|listener| listener.local_addr());
    found.or_fail("a free port")
}

fn configuration(end: End, security: Security, at: SocketAddr) -> String {
    let (node, system) = (end.node(), system_of(end));
    let security = match security {
        Security::None => "security = \"none\"",
        Security::Tls => "security = \"tls\"\ncertificates = \"certificates\"",
    };
    let server = if end == End::Ping { "server = \"near\"" } else { "" };
    format!(
        r#"installation = "{INSTALLATION}"
[system]
name = "{node}"
id = {system}
[classes]
motor = {{ id = 200, text = "Answers calls" }}
router = {{ id = 250, text = "Carries packages between nodes" }}
bench = {{ id = {bench}, text = "Is timed" }}
tcp = {{ id = 64, text = "Carries packages beyond the LAN" }}
tool = {{ id = 16, text = "Tools" }}
[nodes.{node}]
[tcp]
{security}
address = "{address}"
port = {port}
clients = {CLIENTS_MAX}
{server}
[[module]]
name = "bench.0"
node = "{node}"
program = "bench"
optional = true
[[module]]
name = "motor.0"
node = "{node}"
program = "motor"
optional = true
"#,
        bench = BENCH.0,
        address = at.ip(),
        port = at.port(),
    )
}
