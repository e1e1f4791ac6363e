//! `rohrpost demo`: a simulated robot, or the log of a real one.

mod account;
mod arguments;
mod asked;
mod beyond;
mod chaos;
mod copy;
pub(crate) mod folder;
mod gui;
mod incarnations;
mod losses;
mod masters;
mod nodes;
mod recording;
mod replicas;
mod takeover;
mod team;

use crate::launch::{TerminalView, end};
use crate::look::summary::print_classes;
use crate::terminal::speech::Speech;
use crate::terminal::{Failure, say};
pub(crate) use arguments::Arguments;
use arguments::GuiConnection;
use asked::{FIRST_FUNCTION, map_line, running};
pub(crate) use copy::{is_built_in, write_map};
pub(crate) use folder::{Folder, remove_abandoned};
pub(crate) use gui::{drawing, drawn};
use recording::{DemoRecording, ONE_NODE};
use rohrpost::Name;
use rohrpost::common::State;
use rohrpost::interface::Interface;
use rohrpost::interfaces::{CartographerInterface, MapCounts, PlayerInterface, Progress};
use rohrpost_launch::{Launch, choose_node, events};
use rohrpost_mailbox::{ClassTraffic, saturating_sum};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

/// After the end of a log, wait this long until the last packages are mapped and drawn.
const SETTLE: Duration = Duration::from_secs(2);

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let long = arguments.seconds.map(crate::terminal::units::seconds).transpose()?;
    if let Some(count) = arguments.team {
        return team::run(count, long, !arguments.no_gui);
    }
    if let Some(count) = arguments.nodes.filter(|count| *count > 1) {
        if arguments.record.is_some() {
            return Err(ONE_NODE.into());
        }
        if let (Some(seed), Some(long)) = (arguments.chaos, long) {
            return chaos::run(arguments, count, seed, long);
        }
        return nodes::run(arguments, count, long);
    }
    if arguments.gui == GuiConnection::Tcp {
        return Err("with one node there is no other way to join the GUI; use --nodes 3".into());
    }
    if arguments.chaos.is_some() {
        return Err("a robot on one node has no computer that may die; use --nodes 3".into());
    }
    if arguments.kill_master {
        return Err("one node alone has no master to kill; use --nodes 3".into());
    }
    let folder = Folder::new()?;
    let recording = arguments.record.as_deref().map(|to| DemoRecording::begin(to, arguments.overwrite)).transpose()?;
    let installation = Arc::new(copy::installation(arguments, folder.path())?);
    let node = choose_node(&installation, None)?.name.clone();
    let (drawing, begun) = (drawing(&installation), SystemTime::now());
    let speech = Speech::begin()?;
    let resolved = crate::look::resolved::of_node(&installation, &node);
    let mut launch = Launch::begin(installation, &node, std::env::current_exe()?, events()?, &resolved)?;
    let outcome = watch(arguments, long, &mut launch, &speech);
    let summary = summary(&mut launch);
    let gui_build = gui::build_progress(arguments.gui_build.as_deref(), &launch);
    let code = end(launch, &speech);
    speech.settle();
    let recorded = recording.map(DemoRecording::end);
    outcome?;
    let (text, well) = summary?;
    say(text.trim_end());
    drawn(drawing, begun);
    if let Some(line) = gui_build {
        say(line);
    }
    if let Some(recorded) = recorded {
        say(recorded?);
    }
    Ok(if well { code } else { ExitCode::FAILURE })
}

/// Runs until the time is over, the log is over, or a stop is requested.
fn watch(arguments: &Arguments, long: Option<Duration>, launch: &mut Launch, speech: &Speech) -> Result<(), Failure> {
    let mut deadline = long.map(|long| Instant::now() + long);
    let mut view = TerminalView::new(arguments.quiet, speech);
    let mut ask_at = Instant::now();
    let mut over = false;
    while launch.watch(view.wait()) {
        view.show_with(launch, |launch| gui::build_progress(arguments.gui_build.as_deref(), launch))?;
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

fn progress(launch: &mut Launch) -> Option<Progress> {
    let player = running(launch.installation(), PlayerInterface::CLASS)?;
    ask(launch, player, PlayerInterface::hash())
}

/// The first function of a module's own interface that takes no arguments.
fn ask<T: serde::de::DeserializeOwned>(launch: &mut Launch, module: Name, interface: u32) -> Option<T> {
    let read = |bytes: &[u8]| rohrpost::wire::from_bytes::<T>(bytes);
    launch.tool().call(module, FIRST_FUNCTION, interface, |_| Ok(()), read).ok()
}

/// The summary: the result, then packages, losses and latencies by class; and whether all is well.
fn summary(launch: &mut Launch) -> Result<(String, bool), Failure> {
    let survey = launch.survey()?;
    let received = saturating_sum(survey.classes.iter().map(|class| class.received));
    let lost = saturating_sum(survey.classes.iter().map(ClassTraffic::lost_in_all));
    let (mut text, mut well) = (format!("{received} packages received, {lost} lost\n"), true);
    if let Some(played) = progress(launch) {
        let Progress { scans, odometries, discarded, malformed, .. } = played;
        if played.finished && scans + odometries == 0 {
            well = false;
            text.push_str("the log contains no known record: is it a CARMEN log?\n");
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
    text.push('\n');
    text.push_str(&print_classes(launch.installation(), &survey.classes));
    text.push_str("(data and replies carry the class of the module that asked for them)\n");
    Ok((text, well))
}
