//! From a program's `main` to a module that runs, and to its exit code.

use super::context::Context;
use super::error::StartError;
use super::start::{ModuleProgram, Start};
use crate::interface::{Interfaces, StandIn};
use crate::journal::{Tag, end_unmade, end_unstarted};
use crate::made::MadeModule;
use crate::module::{Module, ModuleError};
use crate::output;
use rohrpost_config::Installation;
use serde::de::DeserializeOwned;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;

/// Runs a module until it is told to end; the whole of a module's `main`.
///
/// Launch tells it by its environment what it is; by hand say `--config FILE --name CLASS.INSTANCE` (and `--off`, to
/// leave it switched off).
///
/// ```
/// use rohrpost_modules::{Module, ModuleError, runtime::Context};
///
/// #[derive(serde::Deserialize)]
/// #[serde(deny_unknown_fields)]
/// struct Settings {}
///
/// struct Idle;
///
/// impl Module for Idle {
///     type Settings = Settings;
///     type Interfaces = ();
///
///     fn new(_: Settings, _: &mut Context) -> Result<Self, ModuleError> {
///         Ok(Self)
///     }
/// }
///
/// fn main() -> std::process::ExitCode {
///     # if true { return std::process::ExitCode::SUCCESS }
///     rohrpost_modules::run::<Idle>()
/// }
/// ```
pub fn run<M: Module>() -> ExitCode {
    exit(Start::from_environment().and_then(run_started::<M>))
}

/// Tells what went wrong, and turns it into an exit code.
pub fn exit(result: Result<(), StartError>) -> ExitCode {
    ExitCode::from(tell_exit(result))
}

/// The same as a number, for programs that are not left by `main`.
pub fn tell_exit(result: Result<(), StartError>) -> u8 {
    let Err(error) = result else { return 0 };
    tracing::error!(errno = error.errno(), "{error}");
    output::flush();
    if !output::is_installed() {
        output::print(&error);
    }
    error.exit_code()
}

/// Runs a module as something that was started already says: for programs that hold several kinds of module.
///
/// ```
/// # use rohrpost_modules::{Module, runtime::{Start, StartError, run_started}};
/// fn start<A: Module, B: Module>(first: bool) -> Result<(), StartError> {
///     let start = Start::from_environment()?;
///     if first { run_started::<A>(start) } else { run_started::<B>(start) }
/// }
/// ```
///
/// # Errors
/// See [`StartError`].
pub fn run_started<M: Module>(start: Start) -> Result<(), StartError> {
    let (stand_ins, new) = (Box::new(M::stand_ins), Box::new(M::new));
    run_program(start, ModuleProgram { served: M::Interfaces::table(), stand_ins, new })
}

/// Runs a module that is described now, since there are no types of it: `described` says what it serves under its
/// names, and `new` makes it of its settings.
///
/// # Errors
/// See [`StartError`].
pub fn run_described<M: MadeModule, S: DeserializeOwned>(
    start: Start,
    described: impl FnOnce(&S, &Installation) -> Result<Vec<StandIn>, ModuleError>,
    new: impl FnOnce(S, &mut Context) -> Result<M, ModuleError>,
) -> Result<(), StartError> {
    run_program(start, ModuleProgram { served: Vec::new(), stand_ins: Box::new(described), new: Box::new(new) })
}

fn run_program<M: MadeModule, S: DeserializeOwned>(
    start: Start,
    program: ModuleProgram<'_, M, S>,
) -> Result<(), StartError> {
    let joined = catch_unwind(AssertUnwindSafe(|| start.join(program)));
    let joined = joined.unwrap_or_else(|panic| {
        end_unmade(Tag::Panicked, text_of(&*panic));
        output::flush();
        std::panic::resume_unwind(panic)
    });
    let mut running = joined.inspect_err(|error| match error {
        StartError::Module { text: why, .. } => end_unmade(Tag::Failed, why),
        error => end_unstarted(&error.to_string()),
    })?;
    let worked = catch_unwind(AssertUnwindSafe(|| {
        if running.is_replayed() {
            running.repeat();
        }
        running.turn_on_if_wanted();
        running.go();
    }));
    if let Err(panic) = worked {
        running.panicked(text_of(&*panic));
        std::panic::resume_unwind(panic);
    }
    running.end();
    Ok(())
}

/// What a panic says.
fn text_of(panic: &(dyn std::any::Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("for no reason told")
}
