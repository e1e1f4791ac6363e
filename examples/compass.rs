//! A compass: tells which way the robot looks, by how far its wheels have turned since somebody told it.

use rohrpost::{Context, Module, ModuleError, Rate, Received, Subscription, interfaces, types::Odometry};

/// Tells which way the robot looks.
#[rohrpost::interface(class = "compass")]
pub trait Compass {
    /// Says which way the robot looks now, degrees clockwise from north. Returns the correction before.
    #[command(16)]
    fn calibrate(&mut self, bearing_deg: f64) -> f64;

    /// Which way the robot looks, degrees clockwise from north.
    #[data(1)]
    fn bearing() -> f64;
}

#[derive(rohrpost::serde::Deserialize)]
#[serde(crate = "rohrpost::serde", deny_unknown_fields, rename_all = "kebab-case")]
struct Settings {
    rate_hz: Option<f64>,
}

struct WheelCompass {
    wheels: Subscription<Odometry>,
    turned_deg: f64,
    correction_deg: f64,
}

impl Module for WheelCompass {
    type Settings = Settings;
    type Interfaces = CompassInterface;

    fn new(settings: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        context.set_period(std::time::Duration::try_from_secs_f64(1.0 / settings.rate_hz.unwrap_or(5.0))?);
        let wheels = context.subscribe(interfaces::WheelsInterface::ODOMETRY.data(), "odometry.0", Rate::Each)?;
        Ok(Self { wheels, turned_deg: 0.0, correction_deg: 0.0 })
    }

    fn received(&mut self, _: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        let odometry = data.read(&self.wheels)?;
        self.turned_deg = odometry.map_or(self.turned_deg, |odometry| -odometry.pose.heading_rad.to_degrees());
        Ok(())
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        let bearing_deg = (self.turned_deg + self.correction_deg).rem_euclid(360.0);
        Ok(context.publish_now(CompassInterface::BEARING, &bearing_deg)?)
    }
}

impl Compass for WheelCompass {
    fn calibrate(&mut self, bearing_deg: f64) -> f64 {
        std::mem::replace(&mut self.correction_deg, bearing_deg - self.turned_deg)
    }
}

fn main() -> std::process::ExitCode {
    rohrpost::run::<WheelCompass>()
}
