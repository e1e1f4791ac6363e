//! A module in a process of its own waits for a pipe, as a driver for its serial port, beside its mailboxes and with
//! one thread.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_mailbox::{Interest, Name, Ready, Watch};
use rohrpost_modules::call::{CallError, Fault};
use rohrpost_modules::common;
use rohrpost_modules::interface::Proxy;
use rohrpost_modules::interfaces::{DriveError, Motor, MotorInterface, MotorProxy};
use rohrpost_modules::runtime::Context;
use rohrpost_modules::types::Twist;
use rohrpost_modules::{Module, ModuleError};
use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::PathBuf;
use std::process::Child;
use std::time::{Duration, Instant};
use support::{PATIENCE, Place, play, process};

pub mod support;

const MOTOR: Name = Name::new(1, 100, 0, 0);

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
installation = "watching-NUMBER"
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
    play::<Driver>("motor.0");
}

/// Ended when dropped.
struct Driving(Child);

impl Driving {
    /// Names of its threads.
    fn threads(&self) -> Vec<String> {
        let tasks = std::fs::read_dir(format!("/proc/{}/task", self.0.id())).unwrap();
        tasks.map(|task| std::fs::read_to_string(task.unwrap().path().join("comm")).unwrap().trim().into()).collect()
    }
}

impl Drop for Driving {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_driver_waits_for_its_port_and_its_mailboxes_with_one_thread() {
    let directory = tempfile::tempdir().unwrap();
    let port = directory.path().join("port");
    nix::unistd::mkfifo(&port, nix::sys::stat::Mode::S_IRWXU).unwrap();
    let place = Place::new(&CONFIG.replace("PORT", port.to_str().unwrap()), &[]);
    let mut driving = Driving(process("role", &place.installation.path));
    place.wait_until_on(MOTOR, || assert_eq!(driving.0.try_wait().unwrap(), None, "it ended"));
    let threads = driving.threads();
    // The test harness's main thread, the module's, and the one for signals.
    assert_eq!(threads.len(), 3, "{threads:?}");

    let mut far = OpenOptions::new().write(true).open(&port).unwrap();
    let link = place.caller();
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
