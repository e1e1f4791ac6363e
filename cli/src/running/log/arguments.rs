//! The command line's options for lines and levels.

use crate::look::target::Target;
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
