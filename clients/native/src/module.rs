//! What the author of a module in another language writes, as this crate is given it.

use crate::context::NativeContext;
use crate::following::FollowedData;
use crate::parameters::NativeParameter;
use rohrpost_mailbox::Ready;
use rohrpost_modules::call::Fault;
use rohrpost_modules::{CommandFailure, ModuleError};
use rohrpost_schema::Description;

/// What a module offers, and what its settings are.
#[derive(Clone, Debug)]
pub struct NativeInterface {
    /// Functions, data and streams, of a class of which the module has a name.
    pub description: Description,
    /// Settings that may change while it runs.
    pub parameters: Vec<NativeParameter>,
    /// Names of its other settings. What the configuration has besides is a mistake.
    pub settings: Vec<String>,
}

/// A module in another language. One thread calls all of it, one thing at a time.
pub trait NativeModule {
    /// Begins to work.
    ///
    /// # Errors
    /// The module is in error and stays off.
    fn on(&mut self, _context: &mut NativeContext<'_>) -> Result<(), ModuleError> {
        Ok(())
    }

    /// Goes to its safe state: also when launch has died, and before the process ends.
    fn off(&mut self, _context: &mut NativeContext<'_>) {}

    /// Once a period while it is on, if [`NativeContext::set_period`] asked for it.
    ///
    /// # Errors
    /// The module is switched off and in error.
    fn tick(&mut self, _context: &mut NativeContext<'_>) -> Result<(), ModuleError> {
        Ok(())
    }

    /// Runs a function of the description, while it is on: arguments are postcard, one after the other; postcard of the
    /// result is appended to `reply`.
    ///
    /// # Errors
    /// What the caller is told; [`CommandFailure::Module`] switches the module off and puts it in error, too.
    fn command(
        &mut self,
        _context: &mut NativeContext<'_>,
        number: u16,
        _arguments: &[u8],
        _reply: &mut Vec<u8>,
    ) -> Result<(), CommandFailure> {
        Err(CommandFailure::Fault(Fault::Unknown(number)))
    }

    /// Takes what it follows, while it is on.
    ///
    /// # Errors
    /// The module is switched off and in error.
    fn received(&mut self, _context: &mut NativeContext<'_>, _data: &FollowedData<'_>) -> Result<(), ModuleError> {
        Ok(())
    }

    /// A descriptor that it watches is ready, while it is on.
    ///
    /// # Errors
    /// The module is switched off and in error.
    fn ready(&mut self, _context: &mut NativeContext<'_>, _ready: Ready) -> Result<(), ModuleError> {
        Ok(())
    }

    /// These parameters have new values by now, on or off; [`NativeContext::parameter`] has them.
    ///
    /// # Errors
    /// The old values are put back, and the caller gets the reason.
    fn parameters_changed(&mut self, _context: &mut NativeContext<'_>, _changed: &[&str]) -> Result<(), ModuleError> {
        Ok(())
    }
}
