//! `rohrpost launch`: runs the modules of a node, with a live table.

mod all;
mod bundled;
mod log_lines;

use super::manager::Manager;
use crate::begin::check;
use crate::look::summary::{ModuleLine, module_lines, print_modules_live};
use crate::running::call::level_of;
use crate::terminal::speech::Speech;
use crate::terminal::units::counted;
use crate::terminal::{Failure, columns, folded, rows};
pub(super) use all::{LaunchedNodes, lab};
use bundled::{Bundled, launch_again};
use log_lines::LogLines;
use rohrpost::output::plain::Lines;
use rohrpost_config::{Installation, Keys, Module, Replica};
use rohrpost_launch::launcher::Phase;
use rohrpost_launch::survey::Survey;
use rohrpost_launch::{Launch, choose_node, events};
use rohrpost_mailbox::sys;
use rohrpost_routers::impair;
use std::io::IsTerminal;
use std::os::fd::OwnedFd;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Redraw period of the live table.
const REFRESH: Duration = Duration::from_millis(500);

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost launch config/demo.toml
  rohrpost launch robot.toml --log=warn
  rohrpost launch robot.toml --node base
  rohrpost launch config/demo-nodes.toml --all --impair loss=5%,delay=2ms,reorder=5%
Ctrl-C stops the modules in reverse order.")]
pub(super) struct Arguments {
    /// The configuration.
    file: PathBuf,
    /// Node to launch, if the configuration has several.
    #[arg(long, value_name = "NAME")]
    node: Option<String>,
    /// Launch all nodes on this computer, each in its own network namespace.
    #[arg(long, conflicts_with = "node")]
    all: bool,
    /// Faults of the network between them: loss, delay, jitter, duplicate, reorder, rate, corrupt, seed. For nodes that
    /// are reached only by TCP, a loss becomes a delay of that package and of all packages behind it.
    #[arg(long, value_name = "TEXT", requires = "all")]
    impair: Option<impair::ImpairmentSettings>,
    /// No live table, only events.
    #[arg(long)]
    quiet: bool,
    /// Also show what the modules say, of this severity and above: error, warn, info, debug, trace. Below the live
    /// table, or else on the standard error.
    #[arg(long, value_name = "LEVEL", num_args = 0..=1, require_equals = true, default_missing_value = "info")]
    log: Option<String>,
    /// Launch from a bundle also where its files were changed since it was pushed, or its signature is not trusted.
    #[arg(long)]
    accept_changed_files: bool,
    /// The node ends when this module has.
    #[arg(skip)]
    ends_with: Option<String>,
}

impl Arguments {
    /// Whether the module has ended with which all ends.
    fn is_over(&self, launch: &Launch) -> bool {
        let is_over = |(name, phase): (&str, Phase)| Some(name) == self.ends_with.as_deref() && phase.is_over();
        launch.phases().any(is_over)
    }
}

/// Runs a configuration that the command has made itself, until its module `ends_with` has ended for good.
pub(super) fn run_made(file: PathBuf, quiet: bool, ends_with: &str) -> Result<ExitCode, Failure> {
    let (node, all, impair, log, accept_changed_files) = (None, false, None, None, false);
    run(&Arguments { file, node, all, impair, quiet, log, accept_changed_files, ends_with: Some(ends_with.into()) })
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    if arguments.all {
        return launch_all(arguments);
    }
    all::stop_with_it()?;
    let speech = Speech::begin()?;
    let code = launch(arguments, &speech).unwrap_or_else(|error| {
        speech.complain(&error.to_string());
        ExitCode::FAILURE
    });
    speech.settle();
    Ok(code)
}

/// Mistakes that a router would find only at its start are reported at once. A node without a router needs no keys.
fn check_keys(installation: &Installation, node: Option<&str>) -> Result<(), Failure> {
    if node.is_none_or(|node| installation.router_of(node).is_some()) {
        installation.keys.as_deref().map(|folder| Keys::load(&Keys::file(folder))).transpose()?;
    }
    Ok(())
}

/// Runs all nodes on this computer, until they have ended or a stop is requested.
fn launch_all(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let installation = Arc::new(check::load(&arguments.file)?);
    check_keys(&installation, None)?;
    // Must run before the first thread; the speech has two.
    let lab = all::lab(&installation)?;
    let speech = Speech::begin()?;
    installation.security_texts().iter().for_each(|security| speech.say(security));
    let mut nodes = LaunchedNodes::begin([installation], lab, arguments.impair, arguments.log.as_deref(), &speech)?;
    while nodes.watch(Duration::MAX) {}
    let code = nodes.stop();
    speech.settle();
    Ok(code)
}

/// Launches a node. If that is from a bundle which does not stay up in its trial, launches the bundle before.
fn launch(arguments: &Arguments, speech: &Speech) -> Result<ExitCode, Failure> {
    let scheduling = sys::scheduling().ok();
    let mut bundled = Bundled::begin(&arguments.file, speech)?;
    let ended = launch_once(arguments, &mut bundled, speech);
    if bundled.next().is_some()
        && let Err(error) = &ended
    {
        speech.complain(&error.to_string());
        speech.settle();
    }
    // Asked last: a word to stop that came meanwhile is the end.
    let Some(next) = bundled.next() else { return ended };
    Err(launch_again(&arguments.file, next, scheduling).into())
}

fn launch_once(arguments: &Arguments, bundled: &mut Bundled, speech: &Speech) -> Result<ExitCode, Failure> {
    let mut manager = Manager::from_environment(|warning| speech.complain(warning));
    let (mut launch, mut view) = begin(arguments, bundled, &mut manager, speech)?;
    bundled.began(speech);
    let (mut shown, mut is_over) = (Ok(()), false);
    while !is_over
        && !arguments.is_over(&launch)
        && shown.is_ok()
        && launch.watch(view.wait().min(manager.wait()).min(bundled.wait()))
    {
        manager.alive(&launch);
        shown = view.show(&mut launch);
        is_over = bundled.look(&launch, speech) && bundled.next().is_some();
    }
    bundled.told_to_stop(speech);
    view.leave();
    if is_over {
        manager.going_back()
    } else {
        manager.stopping()
    }
    // Also when the terminal is gone: the modules are stopped in order.
    let code = end(launch, speech);
    shown.map(|()| code)
}

/// Reads what is to be launched, and starts it.
fn begin<'s>(
    arguments: &Arguments,
    bundled: &mut Bundled,
    manager: &mut Manager,
    speech: &'s Speech,
) -> Result<(Launch, TerminalView<'s>), Failure> {
    let least = arguments.log.as_deref().map(level_of).transpose()?;
    let loaded = check::load(bundled.file(&arguments.file)).map_err(Failure::from);
    let (mut installation, permit) = bundled.verify(loaded, arguments.accept_changed_files, speech)?;
    installation.shown.clone_from(&arguments.file);
    check_keys(&installation, arguments.node.as_deref())?;
    let node = choose_node(&installation, arguments.node.as_deref())?.name.clone();
    let installation = Arc::new(installation.seen_from(&node));
    let log = least.map(|least| LogLines::new(&installation, &node, least)).transpose()?;
    manager.starting(&node);
    let resolved = crate::look::resolved::of_node(&installation, &node);
    let sockets = router_sockets(installation.clone(), node.clone());
    let executable = std::env::current_exe()?;
    bundled.start()?;
    let begun = Launch::begin_keeping(installation, &node, executable, events()?, &resolved, sockets, &permit);
    let launch = begun.inspect_err(|error| bundled.did_not_start(error, speech))?;
    manager.ready(&launch);
    let view = TerminalView { log, ..TerminalView::new(arguments.quiet, speech) };
    view.began(&launch, &node);
    Ok((launch, view))
}

/// Stops everything; a module that failed for good or is in error sets the exit code.
pub(super) fn end(mut launch: Launch, speech: &Speech) -> ExitCode {
    launch.take_notes().iter().for_each(|note| speech.say(note));
    let failures = launch.failures();
    launch.stop().iter().for_each(|note| speech.say(note));
    // Failures come last, where both streams go to the same place.
    speech.settle();
    failures.iter().for_each(|failure| speech.complain(failure));
    if failures.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// The output for a person at the terminal while a node runs.
pub(super) struct TerminalView<'a> {
    speech: &'a Speech,
    /// Redraw the table in place.
    live: bool,
    begun: Instant,
    next: Instant,
    last: Option<Survey>,
    notes: Vec<String>,
    /// What modules say, if that is wanted,
    log: Option<LogLines>,
    /// and the last of it, below the live table.
    said: Vec<String>,
}

/// Notes that stay below the live table, and likewise lines of modules.
const NOTES_MAX: usize = 8;

impl<'a> TerminalView<'a> {
    pub(super) fn new(quiet: bool, speech: &'a Speech) -> Self {
        let live = !quiet && std::io::stdout().is_terminal();
        let now = Instant::now();
        Self { speech, live, begun: now, next: now, last: None, notes: Vec::new(), log: None, said: Vec::new() }
    }

    /// All modules are on. Without a table, one line says so.
    fn began(&self, launch: &Launch, node: &str) {
        if !self.live {
            let modules = launch.phases().filter(|(_, phase)| *phase != Phase::LeftOut).count();
            let runs = all::runs(node, &launch.installation().name);
            self.speech.say(&format!("{runs}: {}", counted(modules as u64, "module")));
        }
    }

    /// Time until the next drawing.
    pub(super) fn wait(&self) -> Duration {
        let next = self.next.saturating_duration_since(Instant::now());
        self.log.iter().map(LogLines::wait).fold(next, Duration::min).max(Duration::from_millis(1))
    }

    /// Shows the news, if it is time.
    pub(super) fn show(&mut self, launch: &mut Launch) -> Result<(), Failure> {
        self.show_with(launch, |_| None)
    }

    /// Shows the news, if it is time, and in the live table this line below its head.
    pub(super) fn show_with(
        &mut self,
        launch: &mut Launch,
        line: impl FnOnce(&Launch) -> Option<String>,
    ) -> Result<(), Failure> {
        let notes = launch.take_notes();
        let said = self.log.as_mut().map(|log| log.take(launch)).unwrap_or_default();
        if !self.live {
            notes.iter().for_each(|note| self.speech.say(note));
            said.iter().for_each(|line| self.speech.complain(line));
        }
        keep_last(&mut self.notes, notes);
        keep_last(&mut self.said, said);
        if Instant::now() < self.next {
            return Ok(());
        }
        self.next = Instant::now() + REFRESH;
        if !self.live {
            return Ok(());
        }
        let survey = launch.survey()?;
        let lines = module_lines(launch.installation(), &survey, self.last.as_ref());
        let line = line(launch).map_or_else(String::new, |line| format!("{line}\n"));
        self.draw(&launch.installation().name, &line, &lines);
        self.last = Some(survey);
        Ok(())
    }

    /// `line`: a whole line below the head, or nothing.
    fn draw(&mut self, installation: &str, line: &str, lines: &[ModuleLine]) {
        let head = format!("{installation}, {} s. Ctrl-C stops it.", self.begun.elapsed().as_secs());
        // Home, then clear each line to its end, then everything below: no flicker. A line that is too long even so is
        // cut, so that the table keeps its shape.
        let notes = folded(&self.notes.join("\n"), columns());
        let mut text = format!("{head}\n{line}\n{}\n{notes}\n", print_modules_live(lines));
        // What finds no room would move the table.
        let said = folded(&self.said.join("\n"), columns());
        let room = rows().map_or(usize::MAX, |rows| rows.saturating_sub(text.lines().count() + 1));
        let excess = said.lines().count().saturating_sub(room);
        said.lines().skip(excess).for_each(|said| text += &format!("{said}\n"));
        let text = Lines(text).to_string().replace('\n', "\x1b[K\n");
        let first = if self.last.is_none() { "\x1b[2J" } else { "" };
        self.speech.draw(format!("{first}\x1b[H\x1b[?7l{text}\x1b[?7h\x1b[J"));
    }

    /// Leaves the last table on the screen.
    pub(super) fn leave(&mut self) {
        if self.live {
            self.speech.say("");
        }
        self.notes.clear();
    }
}

/// Adds to what is shown, and drops the oldest beyond what there is room for.
fn keep_last(shown: &mut Vec<String>, news: Vec<String>) {
    shown.extend(news);
    let excess = shown.len().saturating_sub(NOTES_MAX);
    shown.drain(..excess);
}

/// What launch keeps for a node's modules: the sockets of its router.
fn router_sockets(installation: Arc<Installation>, node: String) -> impl Fn(&Module) -> Vec<OwnedFd> {
    move |module| {
        let network = installation.network.filter(|_| installation.router_of(&node) == Some(module.name));
        let address = installation.node(&node).and_then(|node| node.address);
        let (Some(network), Some(address)) = (network, address) else { return Vec::new() };
        let others = installation.lan_nodes().iter().filter(|other| other.name != node);
        let peers: Vec<_> = others.filter_map(|other| other.address).collect();
        // Also where a stream is written: parts of it are asked for again.
        let is_end =
            |replica: &Replica| replica.to.contains(&node) || installation.node_of(replica.from) == Some(node.as_str());
        let replicas = installation.replica_port().filter(|_| installation.replicas.iter().any(is_end));
        rohrpost_routers::shell::listen(address, (network.port, [installation.rest_port(), replicas]), &peers)
    }
}
