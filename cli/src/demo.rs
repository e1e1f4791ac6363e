//! `rohrpost demo`: a simulated robot, or the log of a real one.

mod account;
mod beyond;
mod copy;
mod ears;
mod folder;
mod lives;
mod losses;
mod nodes;
mod reigns;
mod takeover;

use super::launch::{View, end};
use super::speech::Speech;
use super::summary::print_classes;
use crate::terminal::{Failure, say};
use folder::Folder;
pub(super) use folder::remove_abandoned;
use rohrpost::common::State;
use rohrpost::interface::Interface;
use rohrpost::interfaces::{CartographerInterface, MapCounts, PlayerInterface, Progress};
use rohrpost::launch::{Launch, choose_node, events};
use rohrpost::{Class, Name};
use rohrpost_config::Installation;
use rohrpost_mailbox::{ClassTraffic, saturating_sum};
use rohrpost_routers::impair;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

const GUI: &str = "gui";
/// After the end of a log, so long for the last packages to be mapped and drawn.
const SETTLE: Duration = Duration::from_secs(2);
/// Functions asked for in the summary; their numbers in the interfaces.
const FIRST_FUNCTION: u16 = 16;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost demo                            a simulated robot drives and maps until Ctrl-C
  rohrpost demo --seconds 20
  rohrpost demo --log run.log.gz --speed 10
  rohrpost demo --nodes 3 --seconds 30 --impair loss=5%,delay=2ms,reorder=5%
  rohrpost demo --nodes 3 --secure --seconds 30
  rohrpost demo --nodes 3 --gui tcp --secure --seconds 30
  rohrpost demo --nodes 3 --tdma --seconds 30
  rohrpost demo --nodes 3 --tdma --seconds 30 --kill-master
Reads config/demo.toml (or config/demo-log.toml, config/demo-nodes.toml, config/demo-tdma.toml, config/demo-tcp.toml) of the present folder if there is one, else its own copy.")]
pub(super) struct Arguments {
    /// End by itself after so many seconds.
    #[arg(long, value_name = "SECONDS")]
    seconds: Option<f64>,
    /// Play this CARMEN log (also gzipped) instead of simulating.
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    /// Times the speed at which the log was recorded.
    #[arg(long, default_value_t = 10.0, value_name = "X", requires = "log")]
    speed: f64,
    /// Over so many computers, each a network namespace of this one.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..), conflicts_with = "log")]
    nodes: Option<u8>,
    /// The nodes send in time slots, each in its own.
    #[arg(long, requires = "nodes", conflicts_with = "config")]
    tdma: bool,
    /// How the node with the GUI is joined to the robot: on its LAN, or through the TCP router alone. With `tcp` and --seconds the TCP router
    /// is killed in the middle of the run (SIGKILL); launch starts it again.
    #[arg(long, value_enum, default_value = "lan", requires = "nodes", conflicts_with = "tdma")]
    gui: Joined,
    /// What passes between the nodes is sealed, with keys and certificates that are made for this run.
    #[arg(long, requires = "nodes")]
    secure: bool,
    /// In the middle of the run, kill (SIGKILL) the router of the node that is master of time; launch starts it again.
    #[arg(long, requires_all = ["nodes", "seconds"])]
    kill_master: bool,
    /// How bad the network between them is: loss, delay, jitter, duplicate, reorder, rate, corrupt, seed. To nodes that are reached by TCP alone
    /// what is lost is a delay, for all that is behind it.
    #[arg(long, value_name = "TEXT", requires = "nodes")]
    impair: Option<impair::Settings>,
    /// Another configuration.
    #[arg(long, value_name = "FILE", conflicts_with = "log")]
    config: Option<PathBuf>,
    /// Show it live in the Rerun viewer, if one is installed, instead of writing a file.
    #[arg(long)]
    viewer: bool,
    /// Leave the GUI out.
    #[arg(long, conflicts_with = "viewer")]
    no_gui: bool,
    /// No live table, only what happens.
    #[arg(long)]
    quiet: bool,
}

/// How a node is joined to the others.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Joined {
    Lan,
    Tcp,
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let long = arguments.seconds.map(super::units::seconds).transpose()?;
    if let Some(count) = arguments.nodes.filter(|count| *count > 1) {
        return nodes::run(arguments, count, long);
    }
    if arguments.gui == Joined::Tcp {
        return Err("one node alone has its GUI beside it; say --nodes 3".into());
    }
    if arguments.kill_master {
        return Err("one node alone has no master to be killed; say --nodes 3".into());
    }
    let folder = Folder::new()?;
    let installation = Arc::new(copy::installation(arguments, folder.path())?);
    let node = choose_node(&installation, None)?.name.clone();
    let (drawing, begun) = (drawing(&installation), SystemTime::now());
    let speech = Speech::begin()?;
    let resolved = crate::resolved::of_node(&installation, &node);
    let mut launch = Launch::begin(installation, &node, std::env::current_exe()?, events()?, &resolved)?;
    let outcome = watch(arguments, long, &mut launch, &speech);
    let summary = summary(&mut launch);
    let code = end(launch, &speech);
    speech.settle();
    outcome?;
    let (text, well) = summary?;
    say(text.trim_end());
    drawn(drawing, begun);
    Ok(if well { code } else { ExitCode::FAILURE })
}

/// Says where the drawing is that was made since.
fn drawn(drawing: Option<PathBuf>, begun: SystemTime) {
    let is_new = |path: &PathBuf| path.metadata().and_then(|file| file.modified()).is_ok_and(|at| at >= begun);
    if let Some(path) = drawing.filter(is_new) {
        let path = path.canonicalize().unwrap_or(path);
        let here = std::env::current_dir().unwrap_or_default();
        let path = path.strip_prefix(here).unwrap_or(&path).display();
        say(format_args!("drawing: {path} (to open it: rerun {path})"));
    }
}

/// The file that the GUI will write, if it writes one.
fn drawing(installation: &Installation) -> Option<PathBuf> {
    let class = installation.classes.id(GUI)?;
    let gui = installation.modules.iter().find(|module| module.name.class() == class)?;
    let file = gui.settings.get("file").filter(|_| !gui.settings.contains_key("viewer"))?;
    Some(installation.resolve(file.as_str()?))
}

/// Until the time is over, the log is over, or it is told to stop.
fn watch(arguments: &Arguments, long: Option<Duration>, launch: &mut Launch, speech: &Speech) -> Result<(), Failure> {
    let mut deadline = long.map(|long| Instant::now() + long);
    let mut view = View::new(arguments.quiet, speech);
    let mut ask_at = Instant::now();
    let mut over = false;
    while launch.watch(view.wait()) {
        view.show(launch)?;
        if !over && Instant::now() >= ask_at {
            ask_at = Instant::now() + Duration::from_millis(500);
            over = progress(launch).is_some_and(|progress| progress.finished);
            if over {
                deadline = Some(deadline.unwrap_or(Instant::now() + SETTLE).min(Instant::now() + SETTLE));
            }
        }
        if deadline.is_some_and(|deadline| Instant::now() >= deadline) {
            break;
        }
    }
    view.leave();
    Ok(())
}

/// The module of a class, if it runs.
fn running(installation: &Installation, class: &str) -> Option<Name> {
    let class: Class = installation.classes.id(class)?;
    installation.modules.iter().flat_map(|module| module.names()).find(|name| name.class() == class)
}

fn progress(launch: &mut Launch) -> Option<Progress> {
    let player = running(launch.installation(), PlayerInterface::CLASS)?;
    ask(launch, player, PlayerInterface::hash())
}

/// The first function of a module's own, without arguments.
fn ask<T: serde::de::DeserializeOwned>(launch: &mut Launch, module: Name, interface: u32) -> Option<T> {
    let read = |bytes: &[u8]| rohrpost::macro_support::from_bytes::<T>(bytes);
    launch.tool().call(module, FIRST_FUNCTION, interface, |_| Ok(()), read).ok()
}

fn map_line(counts: &MapCounts) -> String {
    let MapCounts { scans, odometries, mapped, without_pose, free, occupied } = counts;
    format!(
        "map: {scans} scans and {odometries} odometry received, {mapped} scans mapped ({without_pose} without pose), \
         {free} cells free, {occupied} occupied\n"
    )
}

/// What there is to say at the end: packages, losses and latencies by class, and what came of them; and
/// whether all is well.
fn summary(launch: &mut Launch) -> Result<(String, bool), Failure> {
    let survey = launch.survey()?;
    let mut text = print_classes(launch.installation(), &survey.classes);
    let received = saturating_sum(survey.classes.iter().map(|class| class.received));
    let lost = saturating_sum(survey.classes.iter().map(ClassTraffic::lost_in_all));
    text.push_str("(data and replies carry the class of the module that asked for them)\n");
    text.push_str(&format!("\n{received} packages received, {lost} lost\n"));
    let mut well = true;
    if let Some(played) = progress(launch) {
        let Progress { scans, odometries, discarded, malformed, .. } = played;
        if played.finished && scans + odometries == 0 {
            well = false;
            text.push_str("the log holds no record that is known: is it a CARMEN log?\n");
        }
        text.push_str(&format!(
            "log: {scans} scans and {odometries} odometry lines played, {discarded} discarded for their stamps, \
             {malformed} broken\n"
        ));
    }
    let mapper = running(launch.installation(), CartographerInterface::CLASS);
    if let Some(counts) = mapper.and_then(|name| ask::<MapCounts>(launch, name, CartographerInterface::hash())) {
        text.push_str(&map_line(&counts));
    }
    for module in &survey.modules {
        if let Ok(status) = launch.tool().status(module.name)
            && status.state == State::Error
        {
            let name = launch.installation().classes.format(module.name);
            well = false;
            text.push_str(&format!("{name} is in error: {}\n", status.error));
        }
    }
    Ok((text, well))
}
