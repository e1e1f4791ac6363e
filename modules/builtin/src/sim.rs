//! `sim`: a robot in a text map stands in for the drivers of motor, wheels, scanner, camera and depth sensor.

mod every;
mod sensors;

use super::settings::{self, Recorded, RefusedSetting, Settings as _};
use every::Every;
use rohrpost_modules::interface::Interface;
use rohrpost_modules::interfaces::{
    CameraInterface, DepthInterface, DriveError, LaserInterface, Motor, MotorInterface, WheelsInterface,
};
use rohrpost_modules::parameter::ParameterSet;
use rohrpost_modules::runtime::{Context, ModuleClock};
use rohrpost_modules::types::Twist;
use rohrpost_modules::{Module, ModuleError};
use rohrpost_robot::simulator::{STEP_NS, Scanner, Settings as RobotSettings, Simulator};
use rohrpost_robot::world::World;
use sensors::Sensors;
use std::time::Duration;

#[rohrpost_modules::parameters(crate = rohrpost_modules::macro_support)]
#[serde(default)]
pub(super) struct Settings {
    /// A text map, see `robot::world`.
    map: String,
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
    beams: usize,
    range_max_m: f64,
    dead_man_ms: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            map: String::new(),
            cell_m: 0.5,
            seed: 1,
            laser_rate_hz: 10.0,
            laser_noise_m: Scanner::default().range_noise_m,
            odometry_rate_hz: 20.0,
            camera_rate_hz: 10.0,
            depth_rate_hz: 5.0,
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
    bumps: u64,
}

fn world(settings: &Settings, context: &Context) -> Result<World, ModuleError> {
    let path = context.path(&settings.map);
    let text = std::fs::read_to_string(&path).map_err(|error| ModuleError::at(path.display(), error))?;
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
        let world = world(&settings, context)?;
        let (width_m, height_m) = world.size_m();
        tracing::info!("simulates a robot in {}, {width_m:.0} m by {height_m:.0} m", settings.map);
        let Settings { beams, range_max_m, laser_noise_m: range_noise_m, .. } = settings;
        let scanner = Scanner { beams, range_max_m, range_noise_m, ..Scanner::default() };
        let dead_man_ns = settings.dead_man_ms * 1_000_000;
        let robot = RobotSettings { seed: settings.seed, scanner, dead_man_ns, ..RobotSettings::default() };
        // Ticks follow the simulation's time; a thousand steps a second are enough to wake up for.
        let pace = context.clock().record().map_or(1.0, |record| record.pace_ppb as f64 / 1e9);
        context.set_period(Duration::from_nanos(STEP_NS).mul_f64((pace / 10.0).max(1.0)));
        Ok(Self {
            simulator: Simulator::new(world, robot),
            clock: context.clock().clone(),
            epoch: context.clock().now().epoch,
            odometry: Every::hz(settings.odometry_rate_hz),
            laser: Every::hz(settings.laser_rate_hz),
            sensors: Sensors::new(context, settings.camera_rate_hz, settings.depth_rate_hz),
            bumps: 0,
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
        let now_ns = self.now_ns();
        let _ = self.simulator.command(Twist::default(), now_ns);
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        let now_ns = self.now_ns();
        let stepped = self.simulator.step_to(now_ns);
        if stepped.skipped > 0 {
            tracing::warn!("the simulation left out {} steps: this computer was too slow", stepped.skipped);
        }
        if self.simulator.bumps() > self.bumps {
            self.bumps = self.simulator.bumps();
            tracing::error!("the robot drove against something ({} times so far)", self.bumps);
        }
        if self.odometry.is_due(now_ns) {
            let odometry = self.simulator.odometry();
            context.write(WheelsInterface::ODOMETRY, now_ns, &odometry)?;
            context.publish(MotorInterface::MOTION, now_ns, &odometry.twist)?;
        }
        if self.laser.is_due(now_ns) {
            context.write(LaserInterface::SCAN, now_ns, &self.simulator.scan())?;
        }
        Ok(self.sensors.look(context, &self.simulator, now_ns)?)
    }
}

impl Sim {
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
        let now_ns = self.now_ns();
        self.simulator.command(twist, now_ns).map(drop).map_err(|_| DriveError::NotFinite)
    }

    fn halt(&mut self) -> Result<(), DriveError> {
        self.drive(0.0, 0.0)
    }
}

impl rohrpost_modules::interfaces::Wheels for Sim {}
impl rohrpost_modules::interfaces::Laser for Sim {}
impl rohrpost_modules::interfaces::Camera for Sim {}
impl rohrpost_modules::interfaces::Depth for Sim {}
