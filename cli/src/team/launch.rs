//! `rohrpost team launch`: all robots of a team on this computer, and the arena in which they are simulated.

use super::referee::{ArenaReferee, Verdict};
use super::squad::{Squad, SquadFile, SquadNetwork};
use crate::begin::demo::{Folder, drawing, drawn};
use crate::launch::LaunchedNodes;
use crate::terminal::speech::Speech;
use crate::terminal::{Failure, say};
use rohrpost_config::Installation;
use rohrpost_routers::lab::{Lab, NodeSpec, become_able};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

/// The referee is asked so often.
const LOOK: Duration = Duration::from_millis(500);
/// Links of Ethernet.
const MTU: u16 = 1500;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost team launch config/team.toml
  rohrpost team launch config/team.toml --robots 30 --seconds 90
  rohrpost team launch config/team.toml --namespaces
  rohrpost team launch config/team.toml --draw team.rrd
The file is that of one robot, with a section [team.launch]. While it runs: `rohrpost team --node robot2`, `rohrpost \
log --node robot2`, `rohrpost team kill 4`. Ctrl-C ends all. Exit code 1: a robot did what robots must not, or did \
not end in order.")]
pub(super) struct Arguments {
    /// The configuration of a robot.
    file: PathBuf,
    /// Number of robots; default: as the file says.
    #[arg(long, value_name = "N")]
    robots: Option<u8>,
    /// Each robot gets a network namespace of its own.
    #[arg(long)]
    namespaces: bool,
    /// Draw it in 3-D with Rerun: into this file, or a viewer's `rerun+http://HOST:PORT/proxy`.
    #[arg(long, value_name = "FILE")]
    draw: Option<String>,
    /// End after this many seconds.
    #[arg(long, value_name = "SECONDS")]
    seconds: Option<f64>,
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let long = arguments.seconds.map(crate::terminal::units::seconds).transpose()?;
    let mut file = SquadFile::read(&arguments.file)?;
    arguments.draw.iter().try_for_each(|to| file.draw(to))?;
    let folder = Folder::new()?;
    let network = if arguments.namespaces { SquadNetwork::Namespaces } else { SquadNetwork::Loopback };
    let squad = file.write(arguments.robots, network, folder.path())?;
    // Must run before the first thread; the speech has two.
    let lab = arguments.namespaces.then(|| lab(&squad)).transpose()?;
    let speech = Speech::begin()?;
    let begun = SystemTime::now();
    let mut nodes = LaunchedNodes::begin(all(&squad), lab, None, None, &speech)?;
    let watched = watch(&mut nodes, &squad.arena, long, &speech);
    let code = nodes.stop();
    speech.settle();
    drawn(drawing(&squad.arena), begun);
    let Some(verdict) = watched? else { return Ok(ExitCode::FAILURE) };
    say(&verdict);
    Ok(if verdict.is_well() { code } else { ExitCode::FAILURE })
}

/// The network of a team: each robot, and the arena, is a computer there.
pub(crate) fn lab(squad: &Squad) -> Result<Lab, Failure> {
    let spec = |installation: &Arc<Installation>| {
        let name = installation.nodes.first().map(|node| node.name.clone()).unwrap_or_default();
        NodeSpec { name, address: SquadNetwork::Namespaces.address(installation.system.id).into() }
    };
    let specs: Vec<NodeSpec> = squad.robots.iter().chain([&squad.arena]).map(spec).collect();
    become_able()?;
    Ok(Lab::new(&specs, MTU)?)
}

/// All systems, the arena first: it ends last.
pub(crate) fn all(squad: &Squad) -> impl Iterator<Item = Arc<Installation>> {
    [&squad.arena].into_iter().chain(&squad.robots).cloned()
}

/// Waits until all run, then until the time is over or a stop is requested. What the referee said last; `None`: they
/// did not begin.
fn watch(
    nodes: &mut LaunchedNodes<'_>,
    arena: &Installation,
    long: Option<Duration>,
    speech: &Speech,
) -> Result<Option<Verdict>, Failure> {
    while !nodes.all_run() {
        if !nodes.watch(Duration::MAX) {
            return Ok(None);
        }
    }
    let mut referee = ArenaReferee::join(arena)?;
    let (began, mut told) = (Instant::now(), String::new());
    while nodes.watch(LOOK) && long.is_none_or(|long| began.elapsed() < long) {
        referee.look();
        let verdict = referee.verdict();
        if told != verdict {
            speech.say(&verdict);
            told = verdict;
        }
    }
    Ok(Some(referee.leave()))
}
