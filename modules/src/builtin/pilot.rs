//! `pilot`: drives about without hitting anything, by what the scanner sees.

use super::check::{self, Called};
use crate::interface::Interface;
use crate::interfaces::{LaserInterface, MotorInterface, MotorProxy};
use crate::module::{Module, ModuleError};
use crate::robot::pilot::{Pilot, Settings as PilotSettings};
use crate::runtime::{Context, Rate, Received, Subscription};
use crate::types::LaserScan;
use serde::Deserialize;
use std::time::Duration;

/// A motor that does not answer in this time is not waited for: the next scan brings the next command.
const PATIENCE: Duration = Duration::from_millis(200);

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct Settings {
    laser: String,
    motor: String,
    #[serde(default = "cruise_m_s")]
    cruise_m_s: f64,
    #[serde(default)]
    seed: u64,
}

impl check::Settings for Settings {
    fn calls(&self) -> Vec<Called<'_>> {
        vec![
            Called { key: "laser", module: &self.laser, class: LaserInterface::CLASS },
            Called { key: "motor", module: &self.motor, class: MotorInterface::CLASS },
        ]
    }
}

fn cruise_m_s() -> f64 {
    PilotSettings::default().cruise_m_s
}

pub(super) struct PilotModule {
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
        let laser = context.subscribe(LaserInterface::SCAN, &settings.laser, Rate::Each)?;
        let motor = context.proxy::<MotorProxy>(&settings.motor)?.with_timeout(PATIENCE);
        let manners =
            PilotSettings { cruise_m_s: settings.cruise_m_s, seed: settings.seed, ..PilotSettings::default() };
        Ok(Self { laser, motor, pilot: Pilot::new(manners), trouble: None })
    }

    fn off(&mut self, _: &mut Context) {
        if let Err(error) = self.motor.halt() {
            tracing::warn!("could not halt the motor ({error}); its dead-man time will");
        }
    }

    fn received(&mut self, _: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        let Some(scan) = data.read(&self.laser) else { return Ok(()) };
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
