//! `body`: stands in for the drivers of a robot in an arena of many: motor, scanner, and what tells the robot's place.
//! Real drivers of the same names take its place without a change elsewhere.
//!
//! The arena is another process ([`super::world`]). Commands go there by datagram, and what the sensors say comes back:
//! what waits between the two is the kernel's, so neither can keep the other from its work.

use super::settings::{self, RefusedSetting, Settings as _};
use super::sim::remove;
use super::world::wire::{Drive, SENSED_BYTES_MAX, Sensing, body_path};
use rohrpost_mailbox::{Interest, Ready};
use rohrpost_modules::interfaces::{DriveError, Laser, LaserInterface, Motor, MotorInterface, Wheels, WheelsInterface};
use rohrpost_modules::runtime::{Context, ModuleClock};
use rohrpost_modules::types::Twist;
use rohrpost_modules::wire::{append, from_bytes};
use rohrpost_modules::{Module, ModuleError};
use rohrpost_robot::simulator::NoMotion;
use serde::Deserialize;
use std::os::unix::net::UnixDatagram;
use std::path::PathBuf;
use std::time::Duration;

/// An arena that tells nothing for so long does not run.
const SILENCE_NS: u64 = 1_000_000_000;
/// Between two looks whether it tells something.
const LOOK: Duration = Duration::from_millis(500);

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct Settings {
    /// Socket of the arena.
    arena: String,
}

impl settings::Settings for Settings {
    fn check(&self) -> Result<(), RefusedSetting> {
        let is_missing = self.arena.is_empty();
        let missing = || RefusedSetting { key: "arena", why: "is empty; name the arena's socket".into() };
        if is_missing { Err(missing()) } else { Ok(()) }
    }
}

pub(super) struct BodyModule {
    socket: UnixDatagram,
    arena: PathBuf,
    robot: u8,
    clock: ModuleClock,
    /// When the arena told something last, ns of the monotonic clock.
    heard_ns: u64,
}

impl Module for BodyModule {
    type Settings = Settings;
    type Interfaces = (MotorInterface, WheelsInterface, LaserInterface);

    fn new(settings: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        settings.check()?;
        let (arena, robot) = (context.path(&settings.arena), context.me().system());
        let own = body_path(&arena, robot);
        let socket = context.open_outside(|| {
            remove(&own)?;
            let socket = UnixDatagram::bind(&own)?;
            socket.set_nonblocking(true)?;
            Ok(socket)
        });
        let socket = socket.map_err(|error| ModuleError::at(own.display(), error))?;
        context.watch(&socket, Interest::Read)?;
        context.set_period(LOOK);
        let clock = context.clock().clone();
        Ok(Self { socket, arena, robot, heard_ns: clock.monotonic_ns(), clock })
    }

    fn off(&mut self, _: &mut Context) {
        // The safe state: the wheels stand.
        let _ = self.halt();
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        context.complain(self.hears().err().unwrap_or_default());
        Ok(())
    }

    fn ready(&mut self, context: &mut Context, _: Ready) -> Result<(), ModuleError> {
        let read = || {
            let mut bytes = vec![0; SENSED_BYTES_MAX];
            let count = self.socket.recv(&mut bytes)?;
            bytes.truncate(count);
            Ok(bytes)
        };
        // One a call: it is called again as long as there is another. What is no sensing says nothing.
        let Ok(bytes) = context.take_in(read) else { return Ok(()) };
        let Ok(Sensing { at_ns, located, scan }) = from_bytes(&bytes) else { return Ok(()) };
        self.heard_ns = self.clock.monotonic_ns();
        let stamp_ns = self.clock.now().ns.saturating_sub(self.heard_ns.saturating_sub(at_ns));
        context.write(WheelsInterface::ODOMETRY, stamp_ns, &located)?;
        context.publish(MotorInterface::MOTION, stamp_ns, &located.twist)?;
        if let Some(scan) = scan {
            context.write(LaserInterface::SCAN, stamp_ns, &scan)?;
        }
        Ok(())
    }
}

impl BodyModule {
    /// Whether the arena has told something lately.
    fn hears(&self) -> Result<(), String> {
        let is_silent = self.clock.monotonic_ns().saturating_sub(self.heard_ns) > SILENCE_NS;
        let silent = || format!("{} is silent: start the arena (`rohrpost team launch`)", self.arena.display());
        if is_silent { Err(silent()) } else { Ok(()) }
    }
}

impl Motor for BodyModule {
    fn drive(&mut self, speed_m_s: f64, turn_rate_rad_s: f64) -> Result<(), DriveError> {
        let twist = Twist { speed_m_s, turn_rate_rad_s };
        NoMotion::check(twist).map_err(|_| DriveError::NotFinite)?;
        let mut bytes = Vec::new();
        // What does not reach the arena is told by its silence.
        if append(&mut bytes, &Drive { robot: self.robot, twist }).is_ok() {
            let _ = self.socket.send_to(&bytes, &self.arena);
        }
        self.hears().map_err(DriveError::Hardware)
    }

    fn halt(&mut self) -> Result<(), DriveError> {
        self.drive(0.0, 0.0)
    }
}

impl Wheels for BodyModule {}
impl Laser for BodyModule {}
