//! `rohrpost launch`: the modules of a node, with a live table.

use super::manager::{Manager, Urgency, for_journal};
use super::summary::{ModuleLine, module_lines, print_modules_live};
use super::{Failure, say};
use rohrpost::launch::{Launch, choose_node, events};
use rohrpost::survey::Survey;
use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The live table is drawn so often.
const REFRESH: Duration = Duration::from_millis(500);

#[derive(clap::Args)]
#[command(after_help = "Example: rohrpost launch config/demo.toml\nCtrl-C stops the modules in reverse order.")]
pub(super) struct Arguments {
    /// The configuration.
    file: PathBuf,
    /// Node to launch, if the configuration has several.
    #[arg(long, value_name = "NAME")]
    node: Option<String>,
    /// No live table, only what happens.
    #[arg(long)]
    quiet: bool,
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let installation = Arc::new(super::check::load(&arguments.file)?);
    let node = choose_node(&installation, arguments.node.as_deref())?.name.clone();
    let mut manager = Manager::from_environment()?;
    manager.starting(&node);
    let mut launch = Launch::begin(installation, &node, std::env::current_exe()?, events()?)?;
    manager.ready(&launch);
    let mut view = View::new(arguments.quiet);
    view.began(&launch, &node);
    let mut shown = Ok(());
    while shown.is_ok() && launch.watch(view.wait().min(manager.wait())) {
        manager.alive(&launch);
        shown = view.show(&mut launch);
    }
    view.leave();
    manager.stopping();
    // Also when it can be shown no more: the modules are stopped in order.
    let code = end(launch);
    shown.map(|()| code)
}

/// Stops everything; what failed for good makes the exit code.
pub(super) fn end(mut launch: Launch) -> ExitCode {
    say_all(&launch.take_notes());
    let failures = launch.failures();
    say_all(&launch.stop());
    for (module, why) in &failures {
        let line = format!("{module} failed for good: {why}");
        eprintln!("{}", for_journal(std::io::stderr(), Urgency::Error, &line));
    }
    if failures.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn say_all(notes: &[String]) {
    for note in notes {
        say(for_journal(std::io::stdout(), Urgency::Notice, note));
    }
}

/// What a person at the terminal sees while a node runs.
pub(super) struct View {
    /// Draw the table over and over in one place.
    live: bool,
    begun: Instant,
    next: Instant,
    last: Option<Survey>,
    notes: Vec<String>,
}

/// Notes that stay below the live table.
const NOTES_MAX: usize = 8;

impl View {
    pub(super) fn new(quiet: bool) -> Self {
        let live = !quiet && std::io::stdout().is_terminal();
        Self { live, begun: Instant::now(), next: Instant::now(), last: None, notes: Vec::new() }
    }

    /// All modules are on. Without a table, one line says so.
    fn began(&self, launch: &Launch, node: &str) {
        if !self.live {
            let modules = launch.phases().count();
            let word = if modules == 1 { "module" } else { "modules" };
            let line = format!("node {node} of {} runs: {modules} {word}", launch.installation().name);
            say_all(&[line]);
        }
    }

    /// How long to watch until the next drawing.
    pub(super) fn wait(&self) -> Duration {
        self.next.saturating_duration_since(Instant::now()).max(Duration::from_millis(1))
    }

    /// Shows what is new, if it is time.
    pub(super) fn show(&mut self, launch: &mut Launch) -> Result<(), Failure> {
        let notes = launch.take_notes();
        if !self.live {
            say_all(&notes);
        }
        self.notes.extend(notes);
        if Instant::now() < self.next {
            return Ok(());
        }
        self.next = Instant::now() + REFRESH;
        if !self.live {
            return Ok(());
        }
        let survey = launch.survey()?;
        let lines = module_lines(launch.installation(), &survey, self.last.as_ref(), |name| {
            (launch.restarts(name), launch.phase(name))
        });
        self.draw(&launch.installation().name, &lines);
        self.last = Some(survey);
        Ok(())
    }

    fn draw(&mut self, installation: &str, lines: &[ModuleLine]) {
        let excess = self.notes.len().saturating_sub(NOTES_MAX);
        self.notes.drain(..excess);
        let head = format!("{installation}, {} s. Ctrl-C stops it.", self.begun.elapsed().as_secs());
        // Home, then each line cleared to its end, then all below: no flicker. Lines that are too long are cut off, not
        // wrapped: else the table would be no table.
        let text = format!("{head}\n\n{}\n{}\n", print_modules_live(lines), self.notes.join("\n"));
        let text = text.replace('\n', "\x1b[K\n");
        let first = if self.last.is_none() { "\x1b[2J" } else { "" };
        let _ = write!(std::io::stdout(), "{first}\x1b[H\x1b[?7l{text}\x1b[?7h\x1b[J");
        let _ = std::io::stdout().flush();
    }

    /// Leaves the last table where it stands.
    pub(super) fn leave(&mut self) {
        if self.live {
            say("");
        }
        self.notes.clear();
    }
}
