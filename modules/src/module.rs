//! What a module's author writes: a struct, its interface, and what it does when it is switched on, off, ticked or
//! given data.

use crate::call::Fault;
use crate::interface::{Interfaces, StandIn, StandInCommand};
use crate::output::errno_of;
use crate::parameter::ParameterSet;
use crate::runtime::{Context, Received, is_misconfigured};
use rohrpost_config::Installation;
use rohrpost_mailbox::Ready;
use serde::de::DeserializeOwned;
use std::fmt;

/// A program of a class. Implement this for a struct, the interface's trait too, and call [`crate::run`] in `main`.
///
/// One thread calls all of it, one thing at a time: commands of the interface, these functions, nothing else.
///
/// ```
/// use rohrpost_modules::interfaces::WheelsInterface;
/// use rohrpost_modules::runtime::{Context, Rate, Received, Subscription};
/// use rohrpost_modules::types::Odometry;
/// use rohrpost_modules::{Module, ModuleError};
///
/// #[derive(serde::Deserialize)]
/// #[serde(deny_unknown_fields)]
/// struct Settings {
///     odometry: String,
/// }
///
/// /// Says how fast the robot is.
/// struct Speedometer {
///     odometry: Subscription<Odometry>,
/// }
///
/// impl Module for Speedometer {
///     type Settings = Settings;
///     type Interfaces = ();
///
///     fn new(settings: Settings, context: &mut Context) -> Result<Self, ModuleError> {
///         let odometry = context.subscribe(WheelsInterface::ODOMETRY.data(), &settings.odometry, Rate::hz(1.0)?)?;
///         Ok(Self { odometry })
///     }
///
///     fn received(&mut self, _: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
///         if let Some(odometry) = data.read(&self.odometry)? {
///             tracing::info!("{} m/s", odometry.twist.speed_m_s);
///         }
///         Ok(())
///     }
/// }
/// ```
pub trait Module: Sized {
    /// What the configuration says under `settings`; use `#[serde(deny_unknown_fields, rename_all = "kebab-case")]`.
    type Settings: DeserializeOwned;
    /// The interface it serves: `MotorInterface`; for a module with aliases a tuple, one each; `()` for none.
    type Interfaces: Interfaces<Self>;

    /// Makes the module, switched off. Subscribe here, and keep the proxies that you need.
    ///
    /// # Errors
    /// Ends the process; launch says why and tries again as the restart policy has it; not if the configuration is at
    /// fault ([`ModuleError::configuration`]).
    fn new(settings: Self::Settings, context: &mut Context) -> Result<Self, ModuleError>;

    /// Begins to work.
    ///
    /// # Errors
    /// The module is in error and stays off.
    fn on(&mut self, _context: &mut Context) -> Result<(), ModuleError> {
        Ok(())
    }

    /// Goes to its safe state: also when launch has died, and before the process ends.
    fn off(&mut self, _context: &mut Context) {}

    /// Called once a period while it is on, if [`Context::set_period`] asked for it.
    ///
    /// # Errors
    /// The module is switched off and in error.
    fn tick(&mut self, _context: &mut Context) -> Result<(), ModuleError> {
        Ok(())
    }

    /// Names under which it stands in for other modules by their descriptions, without their types. It publishes there
    /// by [`Context::publish_as`]; commands come to [`Module::stand_in_command`]. Called before `new`, since mailboxes
    /// and streams are made of it. Each is a name of this module, and of the class that the description says.
    ///
    /// # Errors
    /// Ends the process, as an error of [`Module::new`] does.
    fn stand_ins(_settings: &Self::Settings, _installation: &Installation) -> Result<Vec<StandIn>, ModuleError> {
        Ok(Vec::new())
    }

    /// Takes a command to a module that it stands in for, while it is on; the result's postcard is appended to the
    /// reply.
    ///
    /// # Errors
    /// What the caller is told; as long as the module does not take commands, that nobody runs them.
    fn stand_in_command(
        &mut self,
        _context: &mut Context,
        _command: &StandInCommand<'_>,
        _reply: &mut Vec<u8>,
    ) -> Result<(), Fault> {
        Err(Fault::ModuleError("another module stands in for this one, and runs no commands".into()))
    }

    /// Its settings that may change while it runs: `Some(&mut self.settings)`, if their struct has
    /// [`crate::parameters`].
    fn parameters(&mut self) -> Option<&mut dyn ParameterSet> {
        None
    }

    /// These parameters have new values by now, on or off; what depends on them is changed here. All that one command
    /// sets comes at once, and only what really differs.
    ///
    /// # Errors
    /// The old values are put back, and the caller gets the reason. So check first, then act.
    fn parameters_changed(&mut self, _context: &mut Context, _changed: &[&str]) -> Result<(), ModuleError> {
        Ok(())
    }

    /// Takes data that it subscribed to, while it is on.
    ///
    /// # Errors
    /// The module is switched off and in error.
    fn received(&mut self, _context: &mut Context, _data: &Received<'_>) -> Result<(), ModuleError> {
        Ok(())
    }

    /// Takes what a descriptor brings that it watches ([`Context::watch`]), while it is on. It is called again as long
    /// as there is something; so read what there is, and when that is the end, [`Context::unwatch`].
    ///
    /// Whatever waits here keeps all else of the module waiting: read once, or make the descriptor non-blocking and
    /// read until `WouldBlock`.
    ///
    /// # Errors
    /// The module is switched off and in error.
    fn ready(&mut self, _context: &mut Context, _ready: Ready) -> Result<(), ModuleError> {
        Ok(())
    }
}

/// Settings of a module that its configuration tells nothing.
#[derive(Clone, Copy, Debug, Default, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoSettings {}

/// Why a module cannot work, in words for its user. `?` converts any error into it.
///
/// ```
/// use rohrpost_modules::ModuleError;
///
/// fn parse(port: &str) -> Result<u16, ModuleError> {
///     Ok(port.parse()?)
/// }
/// assert_eq!(parse("x").unwrap_err().to_string(), "invalid digit found in string");
/// ```
pub struct ModuleError {
    text: String,
    errno: Option<u16>,
    is_configuration: bool,
}

impl ModuleError {
    /// From words.
    pub fn new(text: impl Into<String>) -> Self {
        Self { text: text.into(), errno: None, is_configuration: false }
    }

    /// The configuration, or the program itself, is wrong: started again, the module would fail in the same way. Of
    /// [`Module::new`], launch tells it once and does not try again. Unknown names and wrong classes in settings are
    /// such errors by themselves.
    ///
    /// ```
    /// use rohrpost_modules::ModuleError;
    ///
    /// fn check(pins: &[u8]) -> Result<(), ModuleError> {
    ///     if pins.len() == 4 { Ok(()) } else { Err(ModuleError::configuration("`pins` names 4 pins")) }
    /// }
    /// assert!(check(&[1]).unwrap_err().is_configuration());
    /// ```
    pub fn configuration(text: impl Into<String>) -> Self {
        Self { is_configuration: true, ..Self::new(text) }
    }

    /// From an error, behind words that say where it happened.
    ///
    /// ```
    /// use rohrpost_modules::ModuleError;
    ///
    /// let error = std::fs::read_to_string("/no/such.map").unwrap_err();
    /// let error = ModuleError::at("/no/such.map", error);
    /// assert_eq!(error.to_string(), "/no/such.map: No such file or directory (os error 2)");
    /// assert_eq!(error.errno(), Some(2));
    /// ```
    pub fn at(place: impl fmt::Display, error: impl Into<Self>) -> Self {
        let error = error.into();
        Self { text: format!("{place}: {}", error.text), ..error }
    }

    /// This error with the number of the kernel's error that is behind it, where a language other than Rust tells it.
    ///
    /// ```
    /// use rohrpost_modules::ModuleError;
    ///
    /// assert_eq!(ModuleError::new("the map is not there").with_errno(Some(2)).errno(), Some(2));
    /// ```
    #[must_use]
    pub fn with_errno(self, errno: Option<u16>) -> Self {
        Self { errno, ..self }
    }

    /// The number of the kernel's error, if one is behind it.
    pub fn errno(&self) -> Option<u16> {
        self.errno
    }

    /// Whether the configuration or the program is wrong, so that starting again does not help.
    pub fn is_configuration(&self) -> bool {
        self.is_configuration
    }
}

impl fmt::Display for ModuleError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl fmt::Debug for ModuleError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

// Like anyhow's: it is made from every error, so it cannot be one itself.
impl<E: std::error::Error + 'static> From<E> for ModuleError {
    fn from(error: E) -> Self {
        let (errno, is_configuration) = (errno_of(&error), is_misconfigured(&error));
        let mut text = error.to_string();
        let mut source = error.source();
        while let Some(cause) = source {
            let cause_text = cause.to_string();
            if !text.contains(&cause_text) {
                text = format!("{text}: {cause_text}");
            }
            source = cause.source();
        }
        Self { text, errno, is_configuration }
    }
}
