//! The command line of a demo.

use rohrpost_routers::impair;
use std::path::PathBuf;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost demo                            a simulated robot drives and maps until Ctrl-C
  rohrpost demo --seconds 20
  rohrpost demo --seconds 20 --record out.mcap
  rohrpost demo --log run.log.gz --speed 10
  rohrpost demo --nodes 3 --seconds 30 --impair loss=5%,delay=2ms,reorder=5%
  rohrpost demo --nodes 3 --secure --seconds 30
  rohrpost demo --nodes 3 --gui tcp --secure --seconds 30
  rohrpost demo --nodes 3 --tdma --seconds 30
  rohrpost demo --nodes 3 --tdma --seconds 30 --kill-master
  rohrpost demo --nodes 3 --chaos 7 --seconds 60
  rohrpost demo --team 6 --seconds 60
Reads config/demo.toml (or config/demo-log.toml, config/demo-nodes.toml, config/demo-tdma.toml, config/demo-tcp.toml, \
    config/demo-chaos.toml) \
    of the present folder if it exists, else its own copy.")]
pub(crate) struct Arguments {
    /// End after this many seconds.
    #[arg(long, value_name = "SECONDS")]
    pub(super) seconds: Option<f64>,
    /// Play this CARMEN log (also gzipped) instead of simulating.
    #[arg(long, value_name = "FILE")]
    pub(super) log: Option<PathBuf>,
    /// Record all streams, data and output into this new file (see `rohrpost record`).
    #[arg(long, value_name = "FILE")]
    pub(super) record: Option<PathBuf>,
    /// With --record: replace the file if it is there.
    #[arg(long, requires = "record")]
    pub(super) overwrite: bool,
    /// Playback speed; 1 is the speed of the recording.
    #[arg(long, default_value_t = 10.0, value_name = "X", requires = "log")]
    pub(super) speed: f64,
    /// Number of simulated computers, each a network namespace on this computer.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..), conflicts_with = "log")]
    pub(super) nodes: Option<u8>,
    /// The nodes send in time slots, each in its own.
    #[arg(long, requires = "nodes", conflicts_with = "config")]
    pub(super) tdma: bool,
    /// How the node with the GUI is connected to the robot: by the LAN, or only through the TCP router. With `tcp` and
    /// --seconds the TCP router is killed in the middle of the run (SIGKILL); launch restarts it.
    #[arg(long, value_enum, default_value = "lan", requires = "nodes", conflicts_with = "tdma")]
    pub(super) gui: GuiConnection,
    /// Seal the traffic between the nodes, with keys and certificates that are made for this run.
    #[arg(long, requires = "nodes")]
    pub(super) secure: bool,
    /// In the middle of the run, kill (SIGKILL) the router of the node that is master of time; launch restarts it.
    #[arg(long, requires_all = ["nodes", "seconds"])]
    pub(super) kill_master: bool,
    /// Kill, hang and corrupt the program that drives, and kill its computer, drawn from this seed; a referee says
    /// whether the robot touched anything.
    #[arg(long, value_name = "SEED", requires_all = ["nodes", "seconds"], conflicts_with_all = ["tdma", "gui", "secure",
        "kill_master", "config", "record", "viewer"])]
    pub(super) chaos: Option<u64>,
    /// Number of robots of a team, each a system of its own on a computer of its own. They wander, find an intruder and
    /// block it. Their network is divided and joined, a payload and the leader's computer are killed; a referee says
    /// whether a robot touched anything, and a table after how many beats all agreed.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(2..=60), conflicts_with_all = ["nodes",
        "log", "config", "record", "viewer", "gui_build"])]
    pub(super) team: Option<u8>,
    /// Faults of the network between them: loss, delay, jitter, duplicate, reorder, rate, corrupt, seed. For nodes that
    /// are reached only by TCP, a loss becomes a delay of that package and of all packages behind it.
    #[arg(long, value_name = "TEXT", requires = "nodes")]
    pub(super) impair: Option<impair::ImpairmentSettings>,
    /// Another configuration.
    #[arg(long, value_name = "FILE", conflicts_with = "log")]
    pub(super) config: Option<PathBuf>,
    /// Show the robot live in the Rerun viewer, if one is installed, instead of writing a file.
    #[arg(long)]
    pub(super) viewer: bool,
    /// Leave the GUI out.
    #[arg(long, conflicts_with = "viewer")]
    pub(super) no_gui: bool,
    /// The GUI's program is being built, and may join later: show the last line of this file until it does.
    #[arg(long, hide = true, value_name = "FILE", conflicts_with_all = ["no_gui", "nodes"])]
    pub(super) gui_build: Option<PathBuf>,
    /// No live table, only events.
    #[arg(long)]
    pub(super) quiet: bool,
    /// The summary of several nodes also lists mailboxes, links, time slots and declared flows.
    #[arg(long, short, requires = "nodes")]
    pub(super) verbose: bool,
}

/// How a node is connected to the others.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum GuiConnection {
    Lan,
    Tcp,
}
