//! `rohrpost param`: settings of modules that change at run time.

mod save;
mod session;
mod values;

use crate::look::target::Target;
use crate::terminal::Failure;
use session::Session;
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost param list                          the parameters of all modules
  rohrpost param get pilot.0                   the parameters of one module
  rohrpost param set pilot.0 cruise-m-s 0.4    sets a value at once
  rohrpost param save                          saves to the file that the configuration names
  rohrpost param load tuned.toml --dry-run     shows what a file would change")]
pub(crate) struct Arguments {
    #[command(subcommand)]
    action: ParamCommand,
}

#[derive(clap::Subcommand)]
enum ParamCommand {
    /// List parameters with their values.
    List(List),
    /// Show the parameters of a module, or one of them.
    Get(Get),
    /// Change a parameter of a running module.
    Set(ParamAssignment),
    /// Write present values into a file.
    Save(Save),
    /// Set the values of a file: for each module all of them, or none.
    Load(Load),
}

#[derive(clap::Args)]
struct Common {
    #[command(flatten)]
    target: Target,
    /// Timeout for an answer, seconds.
    #[arg(long, default_value_t = 1.0, value_name = "SECONDS")]
    timeout: f64,
}

#[derive(clap::Args)]
struct List {
    /// Module; all, if none is named.
    name: Option<String>,
    #[command(flatten)]
    common: Common,
    /// One JSON object a parameter, in a list.
    #[arg(long)]
    json: bool,
}

#[derive(clap::Args)]
struct Get {
    /// Module, such as pilot.0.
    name: String,
    /// Parameter; all, if none is named.
    parameter: Option<String>,
    #[command(flatten)]
    common: Common,
    /// One JSON object a parameter, in a list.
    #[arg(long)]
    json: bool,
}

#[derive(clap::Args)]
struct ParamAssignment {
    /// Module, such as pilot.0.
    name: String,
    /// Parameter, as `param get` lists it.
    parameter: String,
    /// Its new value.
    #[arg(allow_hyphen_values = true)]
    value: String,
    #[command(flatten)]
    common: Common,
}

#[derive(clap::Args)]
struct Save {
    /// Modules; all that have parameters, if none is named.
    names: Vec<String>,
    /// File to write; default: `parameters` of the configuration.
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    common: Common,
}

#[derive(clap::Args)]
struct Load {
    /// File to read; default: `parameters` of the configuration.
    file: Option<PathBuf>,
    /// Only show what would change, or be refused for its name, type or range.
    #[arg(long)]
    dry_run: bool,
    #[command(flatten)]
    common: Common,
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    match &arguments.action {
        ParamCommand::List(list) => {
            at_work(&list.common, |session| values::list(session, list.name.as_deref(), list.json))
        }
        ParamCommand::Get(get) => {
            at_work(&get.common, |session| values::get(session, &get.name, get.parameter.as_deref(), get.json))
        }
        ParamCommand::Set(set) => {
            at_work(&set.common, |session| values::set_one(session, &set.name, &set.parameter, &set.value))
        }
        ParamCommand::Save(save) => {
            at_work(&save.common, |session| save::run(session, &save.names, save.output.as_deref()))
        }
        ParamCommand::Load(load) => {
            at_work(&load.common, |session| values::load_file(session, load.file.as_deref(), load.dry_run))
        }
    }
}

/// Takes part as a tool while `work` runs.
fn at_work(common: &Common, work: impl FnOnce(&mut Session) -> Result<ExitCode, Failure>) -> Result<ExitCode, Failure> {
    let running = common.target.find()?;
    let tool = running.join(crate::terminal::units::seconds(common.timeout)?)?;
    work(&mut Session { running, tool })
}
