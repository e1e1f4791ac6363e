//! `pilot`: drives about without hitting anything, by what the scanner sees.

use super::settings::{self, Called};
use rohrpost_modules::interface::Interface;
use rohrpost_modules::interfaces::{LaserInterface, MotorInterface, MotorProxy};
use rohrpost_modules::parameter::ParameterSet;
use rohrpost_modules::runtime::{Context, Rate, Received, Subscription};
use rohrpost_modules::types::LaserScan;
use rohrpost_modules::{Module, ModuleError};
use rohrpost_robot::pilot::{Pilot, Settings as PilotSettings};
use std::time::Duration;

/// A motor that does not answer in this time is not waited for: the next scan brings the next command.
const PATIENCE: Duration = Duration::from_millis(200);

#[rohrpost_modules::parameters(crate = rohrpost_modules::macro_support)]
pub(super) struct Settings {
    laser: String,
    motor: String,
    /// Speed where there is room.
    #[parameter(unit = "m/s", min = 0.0, max = 1.5, default = PilotSettings::CRUISE_M_S)]
    cruise_m_s: f64,
    #[serde(default)]
    seed: u64,
}

impl settings::Settings for Settings {
    fn parameters(&self) -> Vec<&str> {
        self.names()
    }

    fn calls(&self) -> Vec<Called<'_>> {
        vec![
            Called { key: "laser", module: &self.laser, class: LaserInterface::CLASS },
            Called { key: "motor", module: &self.motor, class: MotorInterface::CLASS },
        ]
    }
}

pub(super) struct PilotModule {
    settings: Settings,
    laser: Subscription<LaserScan>,
    motor: MotorProxy,
    pilot: Pilot,
    /// What the motor said last, so that it is told once.
    trouble: Option<String>,
}

impl Module for PilotModule {
    type Settings = Settings;
    type Interfaces = ();

    fn new(settings: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        let laser = context.subscribe(LaserInterface::SCAN.data(), &settings.laser, Rate::Each)?;
        let motor = context.proxy::<MotorProxy>(&settings.motor)?.with_timeout(PATIENCE);
        let manners =
            PilotSettings { cruise_m_s: settings.cruise_m_s, seed: settings.seed, ..PilotSettings::default() };
        Ok(Self { settings, laser, motor, pilot: Pilot::new(manners), trouble: None })
    }

    fn parameters(&mut self) -> Option<&mut dyn ParameterSet> {
        Some(&mut self.settings)
    }

    fn parameters_changed(&mut self, _: &mut Context, _: &[&str]) -> Result<(), ModuleError> {
        self.pilot.set_cruise(self.settings.cruise_m_s);
        Ok(())
    }

    fn off(&mut self, _: &mut Context) {
        if let Err(error) = self.motor.halt() {
            tracing::warn!("could not halt the motor ({error}); its dead-man time will");
        }
    }

    fn received(&mut self, _: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        let Some(scan) = data.read(&self.laser)? else { return Ok(()) };
        let twist = self.pilot.drive(&scan);
        let trouble = self.motor.drive(twist.speed_m_s, twist.turn_rate_rad_s).err().map(|error| error.to_string());
        if trouble != self.trouble {
            match &trouble {
                Some(error) => tracing::warn!("cannot drive: {error}"),
                None => tracing::info!("drives again"),
            }
            self.trouble = trouble;
        }
        Ok(())
    }
}
