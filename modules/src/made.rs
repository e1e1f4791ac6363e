//! A module as the runtime calls it, once it is made: one with types, or one that has none.

use crate::call::Fault;
use crate::interface::StandInCommand;
use crate::module::{Module, ModuleError};
use crate::parameter::ParameterSet;
use crate::runtime::{Context, Received};
use rohrpost_mailbox::Ready;

/// What the runtime calls of a module. Each [`Module`] is one; a module that is described while it runs, since there
/// are no Rust types of it, implements this and is run by [`crate::runtime::run_described`].
///
/// ```
/// use rohrpost_modules::interface::{StandIn, StandInCommand};
/// use rohrpost_modules::runtime::{Context, Start, StartError, run_described};
/// use rohrpost_modules::schema::Description;
/// use rohrpost_modules::{CommandFailure, MadeModule, ModuleError};
///
/// /// Answers each command with what came.
/// struct Echo;
///
/// impl MadeModule for Echo {
///     fn command(
///         &mut self,
///         _: &mut Context,
///         command: &StandInCommand<'_>,
///         reply: &mut Vec<u8>,
///     ) -> Result<(), CommandFailure> {
///         Ok(reply.extend_from_slice(command.arguments))
///     }
/// }
///
/// fn serve(start: Start, description: Description) -> Result<(), StartError> {
///     let interface = StandIn { name: start.name, description };
///     run_described(start, |_: &(), _| Ok(vec![interface]), |(), _| Ok(Echo))
/// }
/// ```
pub trait MadeModule {
    /// As [`Module::on`].
    ///
    /// # Errors
    /// The module is in error and stays off.
    fn on(&mut self, _context: &mut Context) -> Result<(), ModuleError> {
        Ok(())
    }

    /// As [`Module::off`].
    fn off(&mut self, _context: &mut Context) {}

    /// As [`Module::tick`].
    ///
    /// # Errors
    /// The module is switched off and in error.
    fn tick(&mut self, _context: &mut Context) -> Result<(), ModuleError> {
        Ok(())
    }

    /// A command to a name that it serves by a description.
    ///
    /// # Errors
    /// See [`CommandFailure`].
    fn command(
        &mut self,
        context: &mut Context,
        command: &StandInCommand<'_>,
        reply: &mut Vec<u8>,
    ) -> Result<(), CommandFailure>;

    /// As [`Module::parameters`].
    fn parameters(&mut self) -> Option<&mut dyn ParameterSet> {
        None
    }

    /// As [`Module::parameters_changed`].
    ///
    /// # Errors
    /// The old values are put back, and the caller gets the reason.
    fn parameters_changed(&mut self, _context: &mut Context, _changed: &[&str]) -> Result<(), ModuleError> {
        Ok(())
    }

    /// As [`Module::received`].
    ///
    /// # Errors
    /// The module is switched off and in error.
    fn received(&mut self, _context: &mut Context, _data: &Received<'_>) -> Result<(), ModuleError> {
        Ok(())
    }

    /// As [`Module::ready`].
    ///
    /// # Errors
    /// The module is switched off and in error.
    fn ready(&mut self, _context: &mut Context, _ready: Ready) -> Result<(), ModuleError> {
        Ok(())
    }
}

/// Why a command has no result.
#[derive(Debug)]
pub enum CommandFailure {
    /// Its caller is told, and that is all.
    Fault(Fault),
    /// The module is switched off and in error, too.
    Module(ModuleError),
}

impl<M: Module> MadeModule for M {
    fn on(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        Module::on(self, context)
    }

    fn off(&mut self, context: &mut Context) {
        Module::off(self, context);
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        Module::tick(self, context)
    }

    fn command(
        &mut self,
        context: &mut Context,
        command: &StandInCommand<'_>,
        reply: &mut Vec<u8>,
    ) -> Result<(), CommandFailure> {
        self.stand_in_command(context, command, reply).map_err(CommandFailure::Fault)
    }

    fn parameters(&mut self) -> Option<&mut dyn ParameterSet> {
        Module::parameters(self)
    }

    fn parameters_changed(&mut self, context: &mut Context, changed: &[&str]) -> Result<(), ModuleError> {
        Module::parameters_changed(self, context, changed)
    }

    fn received(&mut self, context: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        Module::received(self, context, data)
    }

    fn ready(&mut self, context: &mut Context, ready: Ready) -> Result<(), ModuleError> {
        Module::ready(self, context, ready)
    }
}
