//! `sim`: a robot in a text map stands in for the drivers of motor, wheels, scanner, camera and depth sensor.
//!
//! With the setting `arena` the robot is in another process, which moves and referees it; this module is its body.

mod body;
mod every;
mod eyes;
mod sensors;

use super::settings::{self, Recorded, RefusedSetting, Settings as _};
use body::Body;
pub(super) use body::{body_path, remove};
use every::Every;
use eyes::{Eyes, ScannerHealth};
use rohrpost_modules::interface::Interface;
use rohrpost_modules::interfaces::{
    CameraInterface, DepthInterface, DriveError, LaserInterface, Motor, MotorInterface, WheelsInterface,
};
use rohrpost_modules::parameter::ParameterSet;
use rohrpost_modules::runtime::{Context, ModuleClock};
use rohrpost_modules::types::Twist;
use rohrpost_modules::{Module, ModuleError};
use rohrpost_robot::simulator::{NoMotion, STEP_NS, Scanner, Settings as RobotSettings, Simulator};
use rohrpost_robot::world::World;
use sensors::Sensors;
use std::path::Path;
use std::time::Duration;

/// Name of the built-in module in a configuration.
pub(super) const NAME: &str = "sim";

#[rohrpost_modules::parameters(crate = rohrpost_modules::macro_support)]
#[serde(default)]
pub(super) struct Settings {
    /// A text map, see `robot::world`.
    pub(super) map: String,
    /// Socket of the arena that the robot is in; empty: the robot is simulated here.
    pub(super) arena: String,
    /// Side of a cell of an octile map, which does not say it.
    cell_m: f64,
    seed: u64,
    /// Scans in a second of system time.
    #[parameter(unit = "Hz", min = 0.01, max = 100.0)]
    laser_rate_hz: f64,
    /// Standard deviation of a reading of the scanner.
    #[parameter(unit = "m", min = 0.0, max = 1.0)]
    laser_noise_m: f64,
    /// Odometry in a second of system time.
    #[parameter(unit = "Hz", min = 0.01, max = 100.0)]
    odometry_rate_hz: f64,
    /// Pictures in a second of system time.
    #[parameter(unit = "Hz", min = 0.01, max = 100.0)]
    camera_rate_hz: f64,
    /// Point clouds in a second of system time.
    #[parameter(unit = "Hz", min = 0.01, max = 100.0)]
    depth_rate_hz: f64,
    /// Fault of the scanner, to try the robot.
    #[parameter]
    scanner: ScannerHealth,
    beams: usize,
    range_max_m: f64,
    dead_man_ms: u64,
}

impl Settings {
    /// The robot that is simulated.
    pub(super) fn robot(&self) -> RobotSettings {
        let Self { beams, range_max_m, laser_noise_m: range_noise_m, .. } = *self;
        let scanner = Scanner { beams, range_max_m, range_noise_m, ..Scanner::default() };
        RobotSettings { seed: self.seed, scanner, dead_man_ns: self.dead_man_ns(), ..RobotSettings::default() }
    }

    /// Without a command for so long the motor brakes.
    pub(super) fn dead_man(&self) -> Duration {
        Duration::from_nanos(self.dead_man_ns())
    }

    fn dead_man_ns(&self) -> u64 {
        self.dead_man_ms * 1_000_000
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            map: String::new(),
            arena: String::new(),
            cell_m: 0.5,
            seed: 1,
            laser_rate_hz: 10.0,
            laser_noise_m: Scanner::default().range_noise_m,
            odometry_rate_hz: 20.0,
            camera_rate_hz: 10.0,
            depth_rate_hz: 5.0,
            scanner: ScannerHealth::Works,
            beams: 181,
            range_max_m: 8.0,
            dead_man_ms: 500,
        }
    }
}

impl settings::Settings for Settings {
    fn parameters(&self) -> Vec<&str> {
        self.names()
    }

    fn recorded(&self) -> Vec<Recorded> {
        // Four numbers and a length of at most five bytes each, and no pose.
        let bytes = 25 + 4 * self.beams;
        let scan = Recorded { class: LaserInterface::CLASS, stream: LaserInterface::SCAN.name, bytes };
        [scan].into_iter().chain(Sensors::recorded()).collect()
    }

    fn check(&self) -> Result<(), RefusedSetting> {
        for (key, value, least, most) in [
            ("beams", self.beams as f64, 1.0, 10_000.0),
            ("dead-man-ms", self.dead_man_ms as f64, 10.0, 60_000.0),
            ("range-max-m", self.range_max_m, 0.1, 1000.0),
        ] {
            if !(least..=most).contains(&value) {
                return Err(RefusedSetting { key, why: format!("is {value}; use {least} to {most}") });
            }
        }
        Ok(())
    }
}

pub(super) struct Sim {
    settings: Settings,
    simulator: Simulator,
    clock: ModuleClock,
    /// Epoch of system time; another epoch may have any time.
    epoch: u64,
    odometry: Every,
    laser: Every,
    sensors: Sensors,
    eyes: Eyes,
    bumps: u64,
    /// What moves the robot, if it is in an arena.
    body: Option<Body>,
}

pub(super) fn world(settings: &Settings, path: &Path) -> Result<World, ModuleError> {
    let text = std::fs::read_to_string(path).map_err(|error| ModuleError::at(path.display(), error))?;
    let world =
        if text.starts_with("type") { World::parse_octile(&text, settings.cell_m) } else { World::parse(&text) };
    world.map_err(|error| ModuleError::at(path.display(), error))
}

impl Module for Sim {
    type Settings = Settings;
    type Interfaces =
        (MotorInterface, WheelsInterface, LaserInterface, Option<CameraInterface>, Option<DepthInterface>);

    fn new(settings: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        settings.check()?;
        let world = world(&settings, &context.path(&settings.map))?;
        let (width_m, height_m) = world.size_m();
        tracing::info!("simulates a robot in {}, {width_m:.0} m by {height_m:.0} m", settings.map);
        let body = body(&settings, context)?;
        // Ticks follow the simulation's time; a thousand steps a second are enough to wake up for.
        let pace = context.clock().record().map_or(1.0, |record| record.pace_ppb as f64 / 1e9);
        context.set_period(Duration::from_nanos(STEP_NS).mul_f64((pace / 10.0).max(1.0)));
        Ok(Self {
            simulator: Simulator::new(world, settings.robot()),
            clock: context.clock().clone(),
            epoch: context.clock().now().epoch,
            odometry: Every::hz(settings.odometry_rate_hz),
            laser: Every::hz(settings.laser_rate_hz),
            sensors: Sensors::new(context, settings.camera_rate_hz, settings.depth_rate_hz),
            eyes: Eyes::default(),
            bumps: 0,
            body,
            settings,
        })
    }

    fn parameters(&mut self) -> Option<&mut dyn ParameterSet> {
        Some(&mut self.settings)
    }

    fn parameters_changed(&mut self, _: &mut Context, _: &[&str]) -> Result<(), ModuleError> {
        self.laser.set_hz(self.settings.laser_rate_hz);
        self.odometry.set_hz(self.settings.odometry_rate_hz);
        self.sensors.set_rates(self.settings.camera_rate_hz, self.settings.depth_rate_hz);
        self.simulator.set_range_noise(self.settings.laser_noise_m);
        Ok(())
    }

    fn off(&mut self, _: &mut Context) {
        // The safe state: the wheels stand.
        let _ = self.halt();
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        let now_ns = self.now_ns();
        let Some(stamp_ns) = self.advance(context, now_ns) else { return Ok(()) };
        if self.odometry.is_due(now_ns) {
            let odometry = self.simulator.odometry();
            context.write(WheelsInterface::ODOMETRY, stamp_ns, &odometry)?;
            context.publish(MotorInterface::MOTION, stamp_ns, &odometry.twist)?;
        }
        if self.laser.is_due(now_ns)
            && let Some(scan) = self.eyes.scan(self.settings.scanner, &mut self.simulator)
        {
            context.write(LaserInterface::SCAN, stamp_ns, &scan)?;
        }
        Ok(self.sensors.look(context, &self.simulator, now_ns)?)
    }
}

fn body(settings: &Settings, context: &mut Context) -> Result<Option<Body>, ModuleError> {
    if settings.arena.is_empty() {
        return Ok(None);
    }
    let arena = context.installation().resolve(&settings.arena);
    let body = Body::open(context, arena, settings.dead_man_ns());
    body.map(Some).map_err(|error| ModuleError::at(&settings.arena, error))
}

impl Sim {
    /// Brings the robot to its present place. The system time of that; none if the arena has told nothing new.
    fn advance(&mut self, context: &mut Context, now_ns: u64) -> Option<u64> {
        let Some(body) = &mut self.body else {
            self.step_to(now_ns);
            return Some(now_ns);
        };
        let monotonic_ns = self.clock.monotonic_ns();
        let moment = body.newest(context, monotonic_ns);
        context.complain(body.hears(monotonic_ns).err().map(|silent| silent.to_string()).unwrap_or_default());
        let moment = moment?;
        self.simulator.place(moment);
        Some(now_ns.saturating_sub(monotonic_ns.saturating_sub(moment.at_ns)))
    }

    fn step_to(&mut self, now_ns: u64) {
        let stepped = self.simulator.step_to(now_ns);
        if stepped.skipped > 0 {
            tracing::warn!("the simulation left out {} steps: this computer was too slow", stepped.skipped);
        }
        if self.simulator.bumps() > self.bumps {
            self.bumps = self.simulator.bumps();
            tracing::error!("the robot drove against something ({} times so far)", self.bumps);
        }
    }

    /// System time. A node that sets its clock to the master's begins a new epoch, an hour earlier or later perhaps:
    /// the robot neither waits for that hour nor drives through it.
    fn now_ns(&mut self) -> u64 {
        let now = self.clock.now();
        if now.epoch != self.epoch {
            self.epoch = now.epoch;
            self.simulator.set_time(now.ns);
            self.odometry.restart(now.ns);
            self.laser.restart(now.ns);
            self.sensors.restart(now.ns);
        }
        now.ns
    }
}

impl Motor for Sim {
    fn drive(&mut self, speed_m_s: f64, turn_rate_rad_s: f64) -> Result<(), DriveError> {
        let twist = Twist { speed_m_s, turn_rate_rad_s };
        let Some(body) = &self.body else {
            let now_ns = self.now_ns();
            return self.simulator.command(twist, now_ns).map(drop).map_err(|_| DriveError::NotFinite);
        };
        NoMotion::check(twist).map_err(|_| DriveError::NotFinite)?;
        let sent = body.drive(self.clock.monotonic_ns(), twist);
        sent.map_err(|silent| DriveError::Hardware(silent.to_string()))
    }

    fn halt(&mut self) -> Result<(), DriveError> {
        self.drive(0.0, 0.0)
    }
}

impl rohrpost_modules::interfaces::Wheels for Sim {}
impl rohrpost_modules::interfaces::Laser for Sim {}
impl rohrpost_modules::interfaces::Camera for Sim {}
impl rohrpost_modules::interfaces::Depth for Sim {}
