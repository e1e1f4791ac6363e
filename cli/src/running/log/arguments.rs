//! The command line's options for lines and levels, and the lines that they select. The collector does not filter: it
//! hands out pages, and the tool selects.

use crate::look::target::{Running, Target};
use crate::running::call;
use crate::terminal::Failure;
use rohrpost::Name;
use rohrpost::common::OutputLevel;
use rohrpost::output::OutputLine;
use rohrpost_config::Installation;
use rohrpost_mailbox::Class;
use std::path::PathBuf;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost log                           the output so far
  rohrpost log --follow                  also new output, as it comes
  rohrpost log --level warn              only warnings and errors
  rohrpost log --module pilot.0 --text wall --since '5 min'
  rohrpost log --level pilot.0=debug     makes pilot.0 more verbose; with --follow, also shows it
  rohrpost log --level laser=error       limits all lasers to errors
  rohrpost log --levels                  the level of each module
  rohrpost log --file main-0001.mcap --level warn --module pilot.0")]
pub(crate) struct Arguments {
    #[command(flatten)]
    pub(super) target: Target,
    /// Show the lines of these recordings, in the order of their arrival, instead of asking a running node. Names are
    /// those of the first file's configuration, or of --config.
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with_all = ["follow", "levels", "node", "timeout"])]
    pub(super) file: Vec<PathBuf>,
    /// Go on with new lines until Ctrl-C.
    #[arg(long, short)]
    pub(super) follow: bool,
    /// LEVEL: only lines of this severity and above: error, warn, info, debug, trace. NAME=LEVEL: set the level of this
    /// module, or of each module of this class, until it restarts.
    #[arg(long, value_name = "LEVEL|NAME=LEVEL")]
    pub(super) level: Vec<String>,
    /// List each module's level.
    #[arg(long, conflicts_with_all = ["follow", "level"])]
    pub(super) levels: bool,
    /// Only lines of this module; may be given several times.
    #[arg(long, value_name = "NAME")]
    pub(super) module: Vec<String>,
    /// Only lines of modules of this class; may be given several times.
    #[arg(long, value_name = "CLASS")]
    pub(super) class: Vec<String>,
    /// Only lines that contain this text; case does not matter.
    #[arg(long)]
    pub(super) text: Option<String>,
    /// Only lines of this last time, such as '5 min'; with --file, before the end of the recordings.
    #[arg(long, value_name = "DURATION")]
    pub(super) since: Option<String>,
    /// Only this many last lines.
    #[arg(long, short = 'n', value_name = "COUNT")]
    pub(super) last: Option<usize>,
    /// Timeout for each answer, seconds.
    #[arg(long, default_value_t = 1.0, value_name = "SECONDS")]
    pub(super) timeout: f64,
    /// One JSON object a line.
    #[arg(long)]
    pub(super) json: bool,
}

impl Arguments {
    /// Whether any option selects lines.
    pub(super) fn chooses_lines(&self) -> bool {
        let level = self.level.iter().any(|level| !level.contains('='));
        level
            || !(self.module.is_empty() && self.class.is_empty())
            || self.text.is_some()
            || self.since.is_some()
            || self.last.is_some()
    }
}

pub(super) struct Filter {
    level: OutputLevel,
    modules: Vec<Name>,
    classes: Vec<Class>,
    /// In lower case.
    text: Option<String>,
    pub(super) since_ns: Option<u64>,
}

/// A parsed `NAME=LEVEL`.
type LevelAssignment<'a> = (&'a str, &'a str);

impl Filter {
    /// Parses the command line: levels to set, and lines to show. `find` finds a module, alias or tool by its name.
    pub(super) fn read<'a>(
        arguments: &'a Arguments,
        installation: &Installation,
        find: &dyn Fn(&str) -> Result<Name, Failure>,
    ) -> Result<(Vec<LevelAssignment<'a>>, Self), Failure> {
        let (settings, shown): (Vec<_>, Vec<_>) = arguments.level.iter().partition(|level| level.contains('='));
        let level = match shown[..] {
            [] => OutputLevel::Trace,
            [level] => call::level_of(level)?,
            _ => return Err("--level selects lines twice; to set levels write --level NAME=LEVEL".into()),
        };
        let own = |text: &String| own_name(text, find(text)?, installation);
        let modules = arguments.module.iter().map(own).collect::<Result<_, _>>()?;
        let classes = arguments.class.iter().map(|name| class(name, installation)).collect::<Result<_, _>>()?;
        let text = arguments.text.as_ref().map(|text| text.to_lowercase());
        let settings = settings.into_iter().filter_map(|setting| setting.split_once('=')).collect();
        Ok((settings, Self { level, modules, classes, text, since_ns: None }))
    }

    pub(super) fn passes(&self, line: &OutputLine) -> bool {
        let module = line.module();
        let named = self.modules.contains(&module) || self.classes.contains(&module.class());
        line.level <= self.level
            && (named || self.modules.is_empty() && self.classes.is_empty())
            && self.since_ns.is_none_or(|since_ns| line.time_ns >= since_ns)
            && self.text.as_ref().is_none_or(|text| line.full_text().to_lowercase().contains(text))
    }
}

/// Resolves a module's own name or an alias: lines carry the module's own name.
pub(super) fn module(text: &str, running: &Running) -> Result<Name, Failure> {
    own_name(text, running.module(text)?, &running.installation)
}

fn own_name(text: &str, name: Name, installation: &Installation) -> Result<Name, Failure> {
    let module = installation.module(name);
    let module =
        module.ok_or_else(|| format!("{text} is a program run by hand, and sends no lines to the collector"))?;
    Ok(module.name)
}

pub(super) fn class(text: &str, installation: &Installation) -> Result<Class, Failure> {
    let classes = &installation.classes;
    let class = classes.id(text).ok_or_else(|| {
        let all: Vec<&str> = classes.iter().map(|entry| entry.name.as_str()).collect();
        format!("no class `{text}`; there are {}", all.join(", "))
    })?;
    Ok(class)
}
