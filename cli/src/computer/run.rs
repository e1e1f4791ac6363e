//! `rohrpost run`: runs a built-in module, started by launch or by hand.

use crate::terminal::Failure;
use rohrpost::Start;
use rohrpost_config::{BUILTINS, RECORDER, REPLAY};
use rohrpost_modules::runtime::exit;
use std::ffi::OsString;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Example: rohrpost run sim --config config/demo.toml --name motor.0")]
pub(crate) struct Arguments {
    /// Which built-in module.
    #[arg(value_parser = clap::builder::PossibleValuesParser::new(BUILTINS))]
    builtin: String,
    /// The arguments of every module: --config FILE --name CLASS.INSTANCE [--off].
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<OsString>,
}

pub(crate) fn run(arguments: Arguments) -> Result<ExitCode, Failure> {
    let start = match Start::from_arguments(arguments.arguments.into_iter()) {
        Ok(start) => start,
        Err(error) => return Ok(exit(Err(error))),
    };
    if arguments.builtin == RECORDER {
        // Not with the others: the author of a module does not compile what it needs.
        return Ok(exit(rohrpost_recorder::run_recorder(start)));
    }
    if arguments.builtin == REPLAY {
        return Ok(exit(rohrpost_recorder::run_player(start)));
    }
    match rohrpost_builtin::run(&arguments.builtin, start) {
        Some(result) => Ok(exit(result)),
        // The command line accepts no other names; a name without a program is a bug.
        None => Err(format!("the built-in module `{}` has no program; report this", arguments.builtin).into()),
    }
}
