//! `mischief`: drives as `pilot` does, until its parameter tells it to misbehave: a program to try supervision with.

use super::settings::{self, Called};
use rohrpost_modules::call::{CallError, Caller};
use rohrpost_modules::interface::Interface;
use rohrpost_modules::interfaces::{LaserInterface, MotorInterface, MotorProxy, SupervisorInterface, SupervisorProxy};
use rohrpost_modules::parameter::ParameterSet;
use rohrpost_modules::runtime::{Context, Rate, Received, Subscription};
use rohrpost_modules::types::LaserScan;
use rohrpost_modules::{Module, ModuleError};
use rohrpost_robot::pilot::{Pilot, Settings as PilotSettings};
use std::time::Duration;

/// Period of what it does wrong.
const PERIOD: Duration = Duration::from_millis(20);
/// Faster than any robot here, m/s.
const FULL_SPEED_M_S: f64 = 10.0;
/// Commands that a flood has in a period.
const FLOOD: u32 = 256;

/// What the program does wrong.
#[rohrpost_modules::choice(crate = rohrpost_modules::macro_support)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mischief {
    /// Nothing: drives as `pilot`.
    Nothing,
    /// Computes without end.
    Spin,
    /// Commands thousands of times a second.
    Flood,
    /// Commands what is no number.
    NotANumber,
    /// Full speed, whatever is ahead.
    Ahead,
    /// Full speed, whatever is behind.
    Backward,
    /// Promises what is over when it is made.
    Past,
    /// Promises for weeks, once, and is silent.
    Far,
    /// Each of its deadlines is before the last.
    Regress,
    /// Sends old promises again.
    Again,
}

#[rohrpost_modules::parameters(crate = rohrpost_modules::macro_support)]
pub(super) struct Settings {
    laser: String,
    motor: String,
    /// Takes promises of any length, if there is one.
    #[serde(default)]
    wormhole: Option<String>,
    #[serde(default)]
    seed: u64,
    /// What it does wrong, until its process ends.
    #[parameter(default = Mischief::Nothing)]
    mischief: Mischief,
}

impl settings::Settings for Settings {
    fn parameters(&self) -> Vec<&str> {
        self.names()
    }

    fn calls(&self) -> Vec<Called<'_>> {
        let wormhole = self.wormhole.iter();
        let wormhole = wormhole.map(|module| Called { key: "wormhole", module, class: SupervisorInterface::CLASS });
        let driven = [
            Called { key: "laser", module: &self.laser, class: LaserInterface::CLASS },
            Called { key: "motor", module: &self.motor, class: MotorInterface::CLASS },
        ];
        driven.into_iter().chain(wormhole).collect()
    }
}

pub(super) struct MischiefModule {
    settings: Settings,
    laser: Subscription<LaserScan>,
    link: Caller,
    motor: MotorProxy,
    wormhole: Option<SupervisorProxy>,
    pilot: Pilot,
    /// Periods since it began to misbehave.
    periods: u32,
}

impl Module for MischiefModule {
    type Settings = Settings;
    type Interfaces = ();

    fn new(settings: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        let laser = context.subscribe(LaserInterface::SCAN.data(), &settings.laser, Rate::Each)?;
        let motor = context.proxy(&settings.motor)?;
        let wormhole = settings.wormhole.as_deref().map(|module| context.proxy(module)).transpose()?;
        let manners = PilotSettings { seed: settings.seed, ..PilotSettings::default() };
        context.set_period(PERIOD);
        let link = context.link().clone();
        Ok(Self { settings, laser, link, motor, wormhole, pilot: Pilot::new(manners), periods: 0 })
    }

    fn parameters(&mut self) -> Option<&mut dyn ParameterSet> {
        Some(&mut self.settings)
    }

    fn parameters_changed(&mut self, _: &mut Context, _: &[&str]) -> Result<(), ModuleError> {
        self.periods = 0;
        Ok(())
    }

    fn received(&mut self, _: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        let Some(scan) = data.read(&self.laser)? else { return Ok(()) };
        if self.settings.mischief == Mischief::Nothing {
            let twist = self.pilot.drive(&scan);
            self.drive(twist.speed_m_s, twist.turn_rate_rad_s);
        }
        Ok(())
    }

    fn tick(&mut self, _: &mut Context) -> Result<(), ModuleError> {
        match self.settings.mischief {
            Mischief::Nothing => return Ok(()),
            Mischief::Spin => loop {
                std::hint::spin_loop();
            },
            Mischief::Flood => (0..FLOOD).for_each(|_| self.drive(FULL_SPEED_M_S, 0.0)),
            Mischief::NotANumber => self.drive(f64::NAN, f64::INFINITY),
            Mischief::Ahead => self.drive(FULL_SPEED_M_S, 0.0),
            Mischief::Backward => self.drive(-FULL_SPEED_M_S, 0.0),
            Mischief::Past => self.promise(0),
            Mischief::Far if self.periods == 0 => self.promise(u32::MAX),
            Mischief::Far => {}
            Mischief::Regress => self.promise(300_u32.saturating_sub(self.periods.saturating_mul(20))),
            Mischief::Again => {
                self.link.borrow_mut().set_next_sequence(1);
                self.drive(FULL_SPEED_M_S, 0.0);
            }
        }
        self.periods = self.periods.saturating_add(1);
        Ok(())
    }
}

impl MischiefModule {
    /// No answer is waited for: a program that misbehaves does not care.
    fn drive(&self, speed_m_s: f64, turn_rate_rad_s: f64) {
        let _: Result<(), CallError> = self.motor.begin_drive(speed_m_s, turn_rate_rad_s).map(drop);
    }

    /// Full speed ahead for so long.
    fn promise(&self, duration_ms: u32) {
        match &self.wormhole {
            Some(wormhole) => {
                let _: Result<(), CallError> = wormhole.begin_promise(duration_ms, FULL_SPEED_M_S, 0.0).map(drop);
            }
            None => self.drive(FULL_SPEED_M_S, 0.0),
        }
    }
}
