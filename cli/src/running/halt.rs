//! `rohrpost halt` and `rohrpost resume`: stop a robot, and let it go on. Each supervisor is asked until it answers;
//! one that does not is named, and never told as stopped.

use crate::look::control::{STATE, holders};
use crate::look::newest;
use crate::look::observer::{PATIENCE, Tool};
use crate::look::target::{Running, Target};
use crate::terminal::units::seconds;
use crate::terminal::{Failure, complain, say};
use nix::sys::utsname::uname;
use nix::unistd::{User, getuid};
use rohrpost::interface::Interface;
use rohrpost::interfaces::{
    BeyondHosts, ControlRefusal, ControlState, HeldHalt, SupervisorInterface, TeamRouterInterface,
};
use rohrpost::output::plain;
use rohrpost::wire::{append, from_bytes};
use rohrpost::{CallError, Fault};
use rohrpost_builtin::holder_text;
use rohrpost_mailbox::{Class, Name, local, realtime_ns};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// A supervisor is asked for so long, seconds.
const TIMEOUT_S: f64 = 5.0;
/// Functions of a supervisor.
const HALT: u16 = 17;
const RESUME: u16 = 18;
const RESUME_ALL: u16 = 19;

/// Between two looks at what is to be repeated; answers wake up at once.
const POLL: Duration = Duration::from_millis(20);
/// Names of a client in a row: all mailboxes of 256 modules.
const RANGE_MAX: u32 = 1 << 16;
/// Between two tries that fail at once.
const PAUSE: Duration = Duration::from_millis(50);

#[derive(clap::Args)]
pub(crate) struct Which {
    #[command(flatten)]
    target: Target,
    /// Robots of other systems, too, as far as the routers know them.
    #[arg(long)]
    all: bool,
    /// The one that holds the robot; default: you, as USER@COMPUTER.
    #[arg(long = "as", value_name = "NAME")]
    holder: Option<String>,
    /// Ask for so long, seconds.
    #[arg(long, default_value_t = TIMEOUT_S, value_name = "SECONDS")]
    timeout: f64,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

#[derive(clap::Args)]
#[command(
    after_help = "Example: rohrpost halt\nIt brakes as hard as its motor does, and stands until `rohrpost resume`, \
    whatever its programs do; this node's robot is asked first. It is no emergency stop: what protects people is a \
    switch in the motor's power.\nExit code 1: a robot did not acknowledge it."
)]
pub(crate) struct HaltArguments {
    #[command(flatten)]
    which: Which,
}

#[derive(clap::Args)]
#[command(
    after_help = "Example: rohrpost resume\nLets go what you hold; what others hold, they let go.\nExit code 1: a \
    robot is still held, or did not answer."
)]
pub(crate) struct ResumeArguments {
    #[command(flatten)]
    which: Which,
    /// Let go what others hold, too. Ask them first.
    #[arg(long)]
    force: bool,
}

impl Which {
    /// The robot of a node, asked by the person at this terminal.
    fn on(target: Target) -> Self {
        Self { target, all: false, holder: None, timeout: TIMEOUT_S, json: false }
    }
}

/// Halts the robot of a node, or lets it go on that this person halted.
pub(crate) fn halt_or_resume(target: Target, is_halt: bool) -> Result<ExitCode, Failure> {
    let which = Which::on(target);
    if is_halt { halt(&HaltArguments { which }) } else { resume(&ResumeArguments { which, force: false }) }
}

/// How it stands with one robot.
#[derive(Serialize)]
struct Outcome {
    module: String,
    /// Why it is not known what the robot does.
    #[serde(skip_serializing_if = "Option::is_none")]
    unanswered: Option<String>,
    halts: Vec<HeldHalt>,
    held_unnamed: bool,
}

pub(crate) fn halt(HaltArguments { which }: &HaltArguments) -> Result<ExitCode, Failure> {
    let mut robots = Robots::find(which)?;
    // The same one for all repetitions of this halt, and no other one's.
    let number = (realtime_ns() / 1000) as u32;
    let arguments = bytes(&(number, &robots.holder))?;
    let answers = robots.ask::<Result<(), ControlRefusal>>(HALT, |_| Some(arguments.clone()));
    let holder = robots.holder.clone();
    let mut outcomes = Vec::new();
    for (module, answer) in answers {
        let refusal = answer.as_ref().ok().and_then(|answer| answer.clone().err());
        let halts = vec![HeldHalt { holder: holder.clone(), number }];
        // A refusal here is one to remember the name: it is held all the same.
        outcomes.push(Outcome {
            module,
            unanswered: answer.err(),
            held_unnamed: refusal.is_some(),
            halts: if refusal.is_some() { Vec::new() } else { halts },
        });
    }
    let line = |outcome: &Outcome| match (&outcome.unanswered, &outcome.module) {
        (Some(why), module) => Err(format!("NOT halted: {module}: {why}")),
        (None, module) if outcome.held_unnamed => {
            Ok(format!("halted: {module}, without your name: until `rohrpost resume --force`"))
        }
        (None, module) => Ok(format!("halted: {module}, until `rohrpost resume` of {holder}")),
    };
    tell(which, &outcomes, line)?;
    Ok(exit(outcomes.iter().all(|outcome| outcome.unanswered.is_none())))
}

pub(crate) fn resume(ResumeArguments { which, force }: &ResumeArguments) -> Result<ExitCode, Failure> {
    let mut robots = Robots::find(which)?;
    if *force {
        robots.ask::<Result<(), ControlRefusal>>(RESUME_ALL, |_| Some(Vec::new()));
    } else {
        robots.let_go()?;
    }
    let mut outcomes = Vec::new();
    for (module, answer) in robots.ask::<ControlState>(STATE, |_| Some(Vec::new())) {
        let (unanswered, state) = match answer {
            Ok(state) => (None, state),
            Err(why) => (Some(why), ControlState::default()),
        };
        outcomes.push(Outcome { module, unanswered, halts: state.halts, held_unnamed: state.held_unnamed });
    }
    let line = |outcome: &Outcome| match (&outcome.unanswered, &outcome.module) {
        (Some(why), module) => Err(format!("not known whether free: {module}: {why}")),
        (None, module) if outcome.is_held() => {
            let by = holders(&outcome.halts, outcome.held_unnamed);
            Err(format!("still held: {module}, by {by}; `rohrpost resume --force` lets go these, too"))
        }
        (None, module) => Ok(format!("free: {module}; its program may drive")),
    };
    tell(which, &outcomes, line)?;
    Ok(exit(outcomes.iter().all(|outcome| outcome.unanswered.is_none() && !outcome.is_held())))
}

impl Outcome {
    fn is_held(&self) -> bool {
        self.held_unnamed || !self.halts.is_empty()
    }
}

fn exit(is_success: bool) -> ExitCode {
    if is_success { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// What is bad goes to stderr, and first.
fn tell(which: &Which, outcomes: &[Outcome], line: impl Fn(&Outcome) -> Result<String, String>) -> Result<(), Failure> {
    if which.json {
        say(serde_json::to_string(outcomes)?);
        return Ok(());
    }
    let (good, bad): (Vec<_>, Vec<_>) = outcomes.iter().map(line).partition(Result::is_ok);
    bad.into_iter().filter_map(Result::err).for_each(|line| complain(plain::line(&line)));
    good.into_iter().filter_map(Result::ok).for_each(|line| {
        say(plain::line(&line));
    });
    Ok(())
}

fn bytes<T: Serialize>(value: &T) -> Result<Vec<u8>, Failure> {
    let mut bytes = Vec::new();
    append(&mut bytes, value)?;
    Ok(bytes)
}

/// The supervisors that are asked, this node's first.
struct Robots {
    running: Running,
    tool: Tool,
    names: Vec<Name>,
    holder: String,
    until: Instant,
}

/// Modules of other systems: as the TCP router knows them, and the first supervisors of those that the team's router
/// hears.
///
/// # Errors
/// When some of them are not known: nobody is told that all were asked.
fn elsewhere(running: &Running, supervisors: Option<Class>) -> Result<Vec<Name>, Failure> {
    let team = running.installation.team.is_some();
    let mut names = match running.hosts_beyond() {
        None if team => Vec::new(),
        hosts => {
            by_tcp(hosts.ok_or("--all: no [tcp] or [team] in the configuration, so there are no other systems")??)?
        }
    };
    if team {
        let router = running.module(TeamRouterInterface::CLASS)?;
        let mut tool = running.join(PATIENCE)?;
        let links = newest(&mut tool, router, TeamRouterInterface::LINKS);
        let (_, links) = links.map_err(|error| running.told(router, &error))?;
        let heard = links.nodes.iter().filter(|node| node.proven).map(|node| node.system);
        names.extend(
            heard
                .zip(std::iter::repeat(supervisors))
                .filter_map(|(system, class)| Some(Name::new(system, class?.0, 0, local::COMMANDS))),
        );
        if names.is_empty() {
            return Err("--all: no other system is heard; `rohrpost net` says what is".into());
        }
    }
    names.sort_unstable();
    names.dedup();
    Ok(names)
}

fn by_tcp(hosts: BeyondHosts) -> Result<Vec<Name>, Failure> {
    if hosts.more > 0 || hosts.hosts.iter().any(|host| host.last.wrapping_sub(host.first) > RANGE_MAX) {
        let why = "the TCP router has more names than it can tell; ask each robot by `--config FILE`, without --all";
        return Err(format!("--all: {why}").into());
    }
    let names = hosts.hosts.iter().flat_map(|host| host.first..=host.last);
    Ok(names.map(|raw| Name::from_raw(raw).module()).collect())
}

/// One question to one of them.
struct Asked<T> {
    arguments: Option<Vec<u8>>,
    call: Option<u32>,
    next: Instant,
    why: String,
    answer: Option<Result<T, String>>,
}

impl Robots {
    fn find(which: &Which) -> Result<Self, Failure> {
        let until = Instant::now() + seconds(which.timeout)?;
        let running = which.target.find()?;
        let class = SupervisorInterface::CLASS;
        let id = running.installation.classes.id(class);
        let is_supervisor = |name: &Name| Some(name.class()) == id;
        let configured = running.installation.modules.iter().flat_map(|module| module.names());
        let mut names: Vec<Name> = configured.filter(is_supervisor).collect();
        names.sort_by_key(|name| (!running.is_own(*name), *name));
        if which.all {
            let known = names.clone();
            let others = elsewhere(&running, id)?;
            names.extend(others.into_iter().filter(|name| is_supervisor(name) && !known.contains(name)));
        }
        if names.is_empty() {
            return Err(format!(
                "no module of class `{class}` supervises a motor here, so nothing can hold the robot; `rohrpost stop` \
                 ends a program (the book's chapter \"Supervised control\" adds a supervisor)"
            )
            .into());
        }
        let tool = running.join(PATIENCE)?;
        Ok(Self { running, tool, names, holder: holder(which.holder.as_deref()), until })
    }

    /// What this holder holds, by each number that is told. One that is silent takes half of the time, and keeps none
    /// of the others.
    fn let_go(&mut self) -> Result<(), Failure> {
        let (holder, until) = (self.holder.clone(), self.until);
        let half = Instant::now() + until.saturating_duration_since(Instant::now()) / 2;
        loop {
            self.until = half;
            let told = self.ask::<ControlState>(STATE, |_| Some(Vec::new()));
            let mine = |state: &ControlState| {
                state.halts.iter().find(|halt| halt.holder == holder).map(|halt| bytes(&(halt.number, &holder)))
            };
            let next: Vec<Option<Result<Vec<u8>, Failure>>> =
                told.iter().map(|(_, state)| state.as_ref().ok().and_then(mine)).collect();
            self.until = until;
            if next.iter().all(Option::is_none) {
                return Ok(());
            }
            let next = next.into_iter().map(Option::transpose).collect::<Result<Vec<_>, Failure>>()?;
            self.ask::<Result<Vec<HeldHalt>, ControlRefusal>>(RESUME, |at| next[at].clone());
        }
    }

    /// Asks each of them at the same time and again, until all have answered or the time is over. None to ask: it is
    /// left out.
    fn ask<T: DeserializeOwned>(
        &mut self,
        function: u16,
        arguments: impl Fn(usize) -> Option<Vec<u8>>,
    ) -> Vec<(String, Result<T, String>)> {
        let now = Instant::now();
        let mut all: Vec<Asked<T>> = (0..self.names.len())
            .map(|at| Asked { arguments: arguments(at), call: None, next: now, why: String::new(), answer: None })
            .collect();
        let is_open = |asked: &Asked<T>| asked.arguments.is_some() && asked.answer.is_none();
        // Each is asked once, also with no time left.
        let mut is_first = true;
        while all.iter().any(is_open) && (is_first || Instant::now() < self.until || all.iter().any(Asked::is_called)) {
            for (at, asked) in all.iter_mut().enumerate().filter(|(_, asked)| is_open(asked)) {
                self.step(self.names[at], function, asked, is_first);
            }
            is_first = false;
            rohrpost_mailbox::wait_any(&mut [self.tool.link.replies()], Some(Instant::now() + POLL), || false);
            self.tool.link.collect();
        }
        let named = self.names.iter().map(|name| self.running.text(*name));
        let answered = |(name, asked): (String, Asked<T>)| {
            asked.arguments.is_some().then(|| (name, asked.answer.unwrap_or(Err(asked.why))))
        };
        named.zip(all).filter_map(answered).collect()
    }

    fn step<T: DeserializeOwned>(&mut self, to: Name, function: u16, asked: &mut Asked<T>, is_first: bool) {
        let now = Instant::now();
        let outcome = match asked.call {
            Some(call) => self.tool.link.poll_for(call, |bytes| from_bytes(bytes)),
            None if now < asked.next || now >= self.until && !is_first => return,
            None => {
                let arguments = asked.arguments.as_deref().unwrap_or_default();
                let write = |body: &mut Vec<u8>| {
                    body.extend_from_slice(arguments);
                    Ok(())
                };
                match self.tool.begin(to, function, SupervisorInterface::hash(), write) {
                    Ok(call) => {
                        asked.call = Some(call);
                        None
                    }
                    Err(error) => Some(Err(error)),
                }
            }
        };
        let Some(outcome) = outcome else { return };
        asked.call = None;
        match outcome {
            Ok(answer) => asked.answer = Some(Ok(answer)),
            Err(error) => {
                asked.next = now + PAUSE;
                asked.why = self.running.told(to, &error).to_string();
                if is_final(&error) {
                    asked.answer = Some(Err(std::mem::take(&mut asked.why)));
                }
            }
        }
    }
}

impl<T> Asked<T> {
    fn is_called(&self) -> bool {
        self.call.is_some()
    }
}

/// Whether another try would have the same answer.
fn is_final(error: &CallError) -> bool {
    matches!(error, CallError::Fault(_, Fault::NotAllowed { .. } | Fault::InterfaceDiffers { .. } | Fault::Unknown(_)))
}

/// A person, as supervisors name them.
fn holder(said: Option<&str>) -> String {
    // As the supervisor will have it, so that its answers have the same name.
    holder_text(&person(said))
}

fn person(said: Option<&str>) -> String {
    let computer = uname().map_or("here".into(), |system| system.nodename().to_string_lossy().into_owned());
    let user = || User::from_uid(getuid()).ok().flatten().map_or_else(|| getuid().to_string(), |user| user.name);
    match said {
        Some(said) if said.contains('@') => said.into(),
        said => format!("{}@{computer}", said.map_or_else(user, str::to_owned)),
    }
}
