//! A module with parameters of every kind, for tests of `rohrpost param`. Like the probe it is this test program
//! itself.

use crate::harness::{program, run_if_launched};
use crate::process::Said;
use rohrpost::parameter::ParameterSet;
use rohrpost::{Context, Module, ModuleError};
use std::time::Duration;

/// A table's line in a configuration: such a module with these settings and other keys.
pub(crate) fn tuned(name: &str, settings: &str, keys: &str) -> String {
    let program = program("tuned::module");
    format!("[[module]]\nname = \"{name}\"\nprogram = {program}\nsettings = {{ {settings} }}\n{keys}\n")
}

/// Not a test: what launch starts. Run as a test it ends at once.
#[test]
fn module() {
    run_if_launched::<Tuned>();
}

/// Where it looks first.
#[rohrpost::choice]
#[derive(Clone, Copy, Debug)]
enum Side {
    Left,
    StraightAhead,
}

#[rohrpost::parameters]
struct Settings {
    /// Read once, at the start.
    #[serde(default)]
    mount: String,
    /// Factor of what is published.
    #[parameter(min = -10.0, max = 10.0, default = 1.0)]
    gain: f64,
    /// Nearest thing that counts.
    #[parameter(unit = "m", min = 0, max = 100, default = 1)]
    near_m: u16,
    /// Farthest thing that counts.
    #[parameter(unit = "m", min = 0, max = 100, default = 9)]
    far_m: u16,
    /// Where it looks first.
    #[parameter(default = Side::Left)]
    side: Side,
    /// Whether it looks.
    #[parameter(default = true)]
    look: bool,
    /// What it is called.
    #[parameter(default = "a \"word\"")]
    label: String,
}

/// Publishes what its parameters are.
#[rohrpost::interface(class = "probe")]
pub(crate) trait Tunable {
    /// What `gain` is at present.
    #[data(1)]
    fn gain() -> f64;
    /// All parameters as the module itself has them, and how often it was told of changes.
    #[data(2)]
    fn all() -> String;
}

struct Tuned {
    settings: Settings,
    told: Vec<String>,
}

impl Tunable for Tuned {}

impl Module for Tuned {
    type Settings = Settings;
    type Interfaces = TunableInterface;

    fn new(settings: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        context.set_period(Duration::from_millis(5));
        Ok(Self { settings, told: Vec::new() })
    }

    fn parameters(&mut self) -> Option<&mut dyn ParameterSet> {
        Some(&mut self.settings)
    }

    fn parameters_changed(&mut self, _: &mut Context, changed: &[&str]) -> Result<(), ModuleError> {
        let Settings { near_m, far_m, .. } = self.settings;
        if near_m >= far_m {
            return Err(ModuleError::new(format!("near-m {near_m} must be below far-m {far_m}")));
        }
        self.told.push(changed.join("+"));
        Ok(())
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        let Settings { mount, gain, near_m, far_m, side, look, label } = &self.settings;
        let all = format!("{mount} {gain} {near_m} {far_m} {side:?} {look} {label} [{}]", self.told.join(" "));
        context.publish_now(TunableInterface::GAIN, gain)?;
        Ok(context.publish_now(TunableInterface::ALL, &all)?)
    }
}

/// The value that a table of `param get` shows.
pub(crate) fn shown(said: Said, parameter: &str) -> String {
    let text = said.ok();
    let line =
        text.lines().find(|line| line.starts_with(parameter)).unwrap_or_else(|| panic!("no {parameter}: {text}"));
    line.split_whitespace().nth(1).unwrap_or_default().to_owned()
}
