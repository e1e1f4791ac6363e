//! A module in a process of its own waits for a pipe, as a driver for its serial port, beside its mailboxes and with
//! one thread.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_config::Installation;
use rohrpost_mailbox::{Interest, Name, Node, Ready, Watch, node_directory};
use rohrpost_modules::call::{CallError, Fault};
use rohrpost_modules::common;
use rohrpost_modules::interface::Proxy;
use rohrpost_modules::interfaces::{DriveError, Motor, MotorInterface, MotorProxy};
use rohrpost_modules::runtime::{Context, Start, ToolLink, run_started};
use rohrpost_modules::types::Twist;
use rohrpost_modules::{Module, ModuleError};
use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

const MOTOR: Name = Name::new(1, 100, 0, 0);
const PATIENCE: Duration = Duration::from_secs(60);

#[derive(serde::Deserialize)]
struct Settings {
    port: PathBuf,
}

/// Publishes as its speed how many bytes its port brought; at a byte 0 it looks no more.
struct Driver {
    port: File,
    watch: Option<Watch>,
    bytes: u32,
}

impl Module for Driver {
    type Settings = Settings;
    type Interfaces = MotorInterface;

    fn new(settings: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        let port = OpenOptions::new().read(true).write(true).custom_flags(nix::libc::O_NONBLOCK).open(settings.port)?;
        let watch = Some(context.watch(&port, Interest::Read)?);
        Ok(Self { port, watch, bytes: 0 })
    }

    fn on(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        self.publish(context)
    }

    fn ready(&mut self, context: &mut Context, ready: Ready) -> Result<(), ModuleError> {
        assert_eq!((Some(ready.watch), ready.readable, ready.writable), (self.watch, true, false));
        let mut bytes = [0; 16];
        match self.port.read(&mut bytes) {
            Ok(0) => return Err(ModuleError::new("a pipe that we hold open ourselves does not end")),
            Ok(count) => {
                self.bytes += count as u32;
                if bytes[..count].contains(&0) {
                    assert!(context.unwatch(ready.watch));
                    self.watch = None;
                }
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(error) => return Err(error.into()),
        }
        self.publish(context)
    }
}

impl Driver {
    fn publish(&self, context: &mut Context) -> Result<(), ModuleError> {
        let told = Twist { speed_m_s: self.bytes.into(), turn_rate_rad_s: 0.0 };
        Ok(context.publish_now(MotorInterface::MOTION, &told)?)
    }
}

impl Motor for Driver {
    fn drive(&mut self, _: f64, _: f64) -> Result<(), DriveError> {
        Ok(())
    }

    fn halt(&mut self) -> Result<(), DriveError> {
        Ok(())
    }
}

const CONFIG: &str = r#"
installation = "watching-PID"
[system]
name = "robot"
id = 1
[classes]
motor = { id = 100, text = "Drives" }
tool = { id = 16, text = "By hand" }
[nodes.main]
[[module]]
name = "motor.0"
program = "motor"
optional = true
spin = "20 us"
settings = { port = "PORT" }
"#;

/// Not a test of its own: the module's process comes here.
#[test]
fn role() {
    let Ok(file) = std::env::var("ROHRPOST_TEST_CONFIG") else { return };
    let words = ["--config", &file, "--name", "motor.0"].map(String::from);
    run_started::<Driver>(Start::from_arguments(words.into_iter()).unwrap()).unwrap();
}

/// Ended when dropped, and its node removed.
struct Driving {
    process: Child,
    node: PathBuf,
}

impl Driving {
    fn start(file: &Path, node: PathBuf) -> Self {
        let process = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "role", "--test-threads=1"])
            .env("ROHRPOST_TEST_CONFIG", file)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        Self { process, node }
    }

    /// Names of its threads.
    fn threads(&self) -> Vec<String> {
        let tasks = std::fs::read_dir(format!("/proc/{}/task", self.process.id())).unwrap();
        tasks.map(|task| std::fs::read_to_string(task.unwrap().path().join("comm")).unwrap().trim().into()).collect()
    }
}

impl Drop for Driving {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
        let _ = std::fs::remove_dir_all(&self.node);
    }
}

#[test]
fn a_driver_waits_for_its_port_and_its_mailboxes_with_one_thread() {
    let directory = tempfile::tempdir().unwrap();
    let port = directory.path().join("port");
    nix::unistd::mkfifo(&port, nix::sys::stat::Mode::S_IRWXU).unwrap();
    let file = directory.path().join("watching.toml");
    let text = CONFIG.replace("PID", &std::process::id().to_string()).replace("PORT", port.to_str().unwrap());
    std::fs::write(&file, text).unwrap();
    let installation = Arc::new(Installation::load(&file).unwrap());
    let path = node_directory(&installation.name, "main");
    let mut driving = Driving::start(&file, path.clone());

    let node = Node::create(&path, 0o700).unwrap();
    let mut tool = ToolLink::join(&installation, &node, "main", Duration::from_secs(5)).unwrap();
    let began = Instant::now();
    while tool.status(MOTOR).is_err() {
        assert!(began.elapsed() < PATIENCE, "it does not start");
        assert_eq!(driving.process.try_wait().unwrap(), None, "it ended");
    }
    let threads = driving.threads();
    // The test harness's main thread, the module's, and the one for signals.
    assert_eq!(threads.len(), 3, "{threads:?}");

    let mut far = OpenOptions::new().write(true).open(&port).unwrap();
    let link = rohrpost_modules::call::Caller::from(tool.link);
    let motor = MotorProxy::new(&link, MOTOR).with_timeout(Duration::from_secs(5));
    let mut written = 0.0;
    let mut write = |bytes: &[u8]| {
        far.write_all(bytes).unwrap();
        written += bytes.len() as f64;
        written
    };
    let read = |wanted: f64| {
        let began = Instant::now();
        while motor.motion().unwrap().1.speed_m_s != wanted {
            assert!(began.elapsed() < PATIENCE, "{wanted} bytes were written, and it has not read them");
        }
    };
    // Each byte alone, so that it sleeps before each; between them commands, which ring its bell in `poll`.
    for _ in 0..200 {
        read(write(b"x"));
        motor.drive(0.0, 0.0).unwrap();
    }

    let switch = |function| {
        let mut link = link.borrow_mut();
        let call = link.begin(MOTOR, function, common::HASH, PATIENCE, |_| Ok(())).unwrap();
        link.wait::<()>(call, |_| Ok(())).unwrap();
    };
    switch(common::OFF);
    let there = write(b"while it is off");
    assert!(matches!(motor.drive(0.0, 0.0), Err(CallError::Fault(_, Fault::ModuleOff))));
    switch(common::ON);
    read(there);

    let end = write(b"\0");
    read(end);
    write(b"nobody looks");
    (0..20).for_each(|_| motor.drive(0.0, 0.0).unwrap());
    read(end);
}
