//! `rohrpost restart`, `stop` and `start`: one module of a running node, through its launch.

use crate::look::observer::Tool;
use crate::look::target::{Running, Target};
use crate::terminal::{Failure, say};
use rohrpost::CallError;
use rohrpost::output::plain;
use rohrpost_launch::launcher::{AskLaunch, ChildState, ControlError, Phase};
use rohrpost_launch::survey::Scope;
use rohrpost_mailbox::{ModuleState, Name, ParticipantInfo};
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Launch answers within this time: it waits for nobody.
const PATIENCE: Duration = Duration::from_secs(2);
const POLL: Duration = Duration::from_millis(20);
/// Added to the module's own limits: time for a killed process to end, and for launch to notice.
const MARGIN: Duration = Duration::from_secs(7);

#[derive(clap::Args)]
#[command(
    after_help = "Example: rohrpost restart pilot.0\nExit code 1: launch refused, or the module did not reach the \
        state."
)]
pub(crate) struct Arguments {
    /// Module, such as pilot.0.
    name: String,
    #[command(flatten)]
    target: Target,
    /// Return as soon as launch has accepted the order.
    #[arg(long)]
    no_wait: bool,
    /// Timeout, seconds; without it, the time that the configuration gives the module to end and to get ready.
    #[arg(long, value_name = "SECONDS", conflicts_with = "no_wait")]
    timeout: Option<f64>,
}

/// What launch is asked for.
#[derive(Clone, Copy)]
pub(crate) enum Order {
    Restart,
    Stop,
    Start,
}

pub(crate) fn run(arguments: &Arguments, order: Order) -> Result<ExitCode, Failure> {
    let running = arguments.target.find()?.at_selected();
    let name = running.module(&arguments.name)?;
    let module = running.installation.module(name).ok_or_else(|| {
        format!("the configuration has no module `{}`; `rohrpost list` shows which there are", running.text(name))
    })?;
    let text = running.text(module.name);
    let node = running.node_of(module.name);
    let launcher = running.launcher_of(module.name).ok_or_else(|| format!("no node `{node}`"))?;
    if running.is_own(module.name) && running.node.launcher().is_none() {
        return Err(format!(
            "no launch watches over {text}: node {} runs by hand. End the module's process and start it yourself, or \
             launch the node: `rohrpost launch {}`",
            running.node_name,
            running.installation.path.display()
        )
        .into());
    }
    let timeout = match arguments.timeout {
        Some(seconds) => crate::terminal::units::seconds(seconds)?,
        None => module.stop_within + module.ready_within + MARGIN,
    };
    let tool = running.join(PATIENCE)?;
    let began = Instant::now();
    let mut asked = ModuleOrder { running: &running, name: module.name, text, launcher, tool, began, timeout };
    say(asked.carry_out(order, !arguments.no_wait)?);
    Ok(ExitCode::SUCCESS)
}

struct ModuleOrder<'a> {
    running: &'a Running,
    name: Name,
    text: String,
    /// Launch of the module's node.
    launcher: Name,
    tool: Tool,
    began: Instant,
    timeout: Duration,
}

impl ModuleOrder<'_> {
    /// The message after success.
    fn carry_out(&mut self, order: Order, wait: bool) -> Result<String, Failure> {
        let before = self.child()?.pid.map_or(String::new(), |pid| format!("; previously process {pid}"));
        let text = self.text.clone();
        let incarnation = match order {
            Order::Restart => self.tool.restart(self.launcher, &text),
            Order::Start => self.tool.start(self.launcher, &text),
            Order::Stop => {
                self.tool.stop(self.launcher, &text).map_err(|error| self.told(&error))?;
                return if wait { self.wait_stopped() } else { Ok(format!("{text} is being stopped")) };
            }
        };
        let incarnation = incarnation.map_err(|error| match &error {
            CallError::Module(_, ControlError::Running(_)) => self.runs_already(),
            error => self.told(error),
        })?;
        if wait { self.wait_running(incarnation, &before) } else { Ok(format!("{text} is being started")) }
    }

    fn wait_running(&mut self, incarnation: u32, before: &str) -> Result<String, Failure> {
        loop {
            let child = self.child()?;
            let text = &self.text;
            match child.phase {
                Phase::Running if child.lives == incarnation => return self.at_work(&child, before),
                Phase::StandsBy => {
                    let node = self.running.node_of(self.name);
                    return Ok(format!("{text} stands by on node {node}, and begins when that holds its lease"));
                }
                Phase::Stopped => return Err(format!("another user has stopped {text} meanwhile").into()),
                // It ran and ended, or could not even be started.
                _ if child.lives > incarnation || child.lives == incarnation && child.phase == Phase::Waiting => {
                    return Err(format!("{text} was started, and ended by itself: {}", child.last_end).into());
                }
                // It tries again, by its policy.
                Phase::Waiting if child.lives < incarnation && child.attempt > 0 => {
                    return Err(format!("{text} is not started: it {}; launch tries again", child.last_end).into());
                }
                Phase::Failed | Phase::Ended => return Err(format!("{text} does not run: {}", child.last_end).into()),
                _ => self.pause(&child)?,
            }
        }
    }

    /// Its process runs, and was switched on if required. The module itself reports its state.
    fn at_work(&mut self, child: &ChildState, before: &str) -> Result<String, Failure> {
        let (text, pid, took_s) = (&self.text, child.pid.unwrap_or_default(), self.began.elapsed().as_secs_f64());
        let process = self.process()?.filter(|process| process.pid == pid);
        let state = process.and_then(|process| process.state);
        if state == Some(ModuleState::Error) {
            let (text, why) = (text.clone(), self.error());
            return Err(format!("{text} was started (process {pid}), but is in error: {why}").into());
        }
        let state = state.map_or("gone", ModuleState::name);
        Ok(format!("{text} runs and is {state} after {took_s:.2} s (process {pid}{before})"))
    }

    /// Why it is not started, as `rohrpost list` and a call of it have it.
    fn runs_already(&mut self) -> Failure {
        let text = self.text.clone();
        match self.process().ok().flatten().and_then(|process| process.state) {
            Some(ModuleState::Error) => format!(
                "{text} runs, but is in error: {}; `rohrpost call {text} on` tries again, `rohrpost restart {text}` \
                 starts it anew",
                self.error()
            ),
            Some(ModuleState::Off) => {
                format!("{text} runs already, and is off; `rohrpost call {text} on` switches it on")
            }
            Some(ModuleState::Starting) => format!("{text} is starting already"),
            _ => ControlError::Running(text).to_string(),
        }
        .into()
    }

    /// What a command needs to reach this launch, also when another node runs the module.
    fn standby_node(&self) -> String {
        let module = self.running.installation.module(self.name).filter(|module| module.has_standby());
        module.map_or(String::new(), |module| format!(" --node {}", module.node))
    }

    /// The module's process, as its node has it.
    fn process(&self) -> Result<Option<ParticipantInfo>, Failure> {
        let survey = self.running.look(self.running.node_of(self.name), Scope::Module(self.name.raw()))?;
        Ok(survey.module(self.name).and_then(|module| module.process.clone()))
    }

    /// The last error, as the module says itself.
    fn error(&mut self) -> String {
        let why = self.tool.status(self.name).map(|status| status.error).unwrap_or_default();
        plain::line(&why).into_owned()
    }

    fn wait_stopped(&mut self) -> Result<String, Failure> {
        loop {
            let child = self.child()?;
            match child.phase {
                Phase::Stopping => self.pause(&child)?,
                phase if phase.is_over() => {
                    let (text, how) = (&self.text, child.last_end.lines().next().unwrap_or("it never ran"));
                    let node = self.standby_node();
                    return Ok(format!("{text} is stopped ({how}); `rohrpost start {text}{node}` starts it"));
                }
                _ => return Err(format!("another user has started {} again meanwhile", self.text).into()),
            }
        }
    }

    fn pause(&self, child: &ChildState) -> Result<(), Failure> {
        if self.began.elapsed() < self.timeout {
            std::thread::sleep(POLL);
            return Ok(());
        }
        let (text, phase, within) = (&self.text, child.phase.name(), self.timeout);
        Err(format!("{text} is still {phase} after {within:?}; launch goes on with it, see `rohrpost list`").into())
    }

    /// Launch's record of the module.
    fn child(&mut self) -> Result<ChildState, Failure> {
        let children = self.tool.children(self.launcher).map_err(|error| self.told(&error.widen()))?;
        let child = children.into_iter().find(|child| child.module == self.text);
        child.ok_or_else(|| ControlError::NoModule(self.text.clone()).into())
    }

    /// Lower layers know launch only by its number.
    fn told(&self, error: &CallError<ControlError>) -> Failure {
        let node = self.running.node_of(self.name);
        let launch = if self.running.is_own(self.name) { "launch".into() } else { format!("launch of node {node}") };
        plain::line(&error.to_string().replace(&self.launcher.to_string(), &launch)).into()
    }
}
