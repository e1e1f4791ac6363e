//! `rohrpost demo --nodes 3`: the robot over several nodes, each in its own network namespace of this computer.

use super::account::{self, Balance};
use super::arguments::{Arguments, GuiConnection};
use super::asked::{FIRST_FUNCTION, map_line, running};
use super::gui::{drawing, drawn};
use super::losses::ExchangeLosses;
use super::replicas::RecordBalance;
use super::takeover::{TakeoverRecord, Victim, Watch};
use super::{beyond, copy};
use crate::launch::{LaunchedNodes, lab};
use crate::look::newest;
use crate::look::summary::print_classes;
use crate::nodes::tables;
use crate::nodes::vocabulary::Vocabulary;
use crate::terminal::speech::Speech;
use crate::terminal::{Failure, say};
use rohrpost::ToolLink;
use rohrpost::common::State;
use rohrpost::interface::{DataPort, Interface};
use rohrpost::interfaces::{
    CartographerInterface, FlowStates, Links, MapCounts, ReplicaStates, RouterInterface, SlotState,
};
use rohrpost::wire::from_bytes;
use rohrpost_config::Installation;
use rohrpost_launch::survey::{Survey, sum};
use rohrpost_mailbox::{MailboxInfo, Node, SystemClock, TimeSource, monotonic_ns, node_directory};
use serde::de::DeserializeOwned;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

/// Timeout for modules' answers.
const PATIENCE: Duration = Duration::from_secs(2);
/// Routers publish their counters twice a second; they stay constant when nothing is under way.
const SETTLE: Duration = Duration::from_secs(8);
const LOOK: Duration = Duration::from_millis(600);

pub(super) fn run(arguments: &Arguments, count: u8, long: Option<Duration>) -> Result<ExitCode, Failure> {
    let folder = super::folder::Folder::new()?;
    let installation = Arc::new(copy::installation(arguments, folder.path())?);
    let nodes = installation.nodes.len();
    if nodes != usize::from(count) {
        return Err(format!("{} has {nodes} nodes; use --nodes {nodes}", installation.shown.display()).into());
    }
    let (drawing, begun) = (drawing(&installation), SystemTime::now());
    // Must run before the first thread; the speech has two.
    let lab = lab(&installation)?;
    let speech = Speech::begin()?;
    installation.security_texts().iter().for_each(|security| speech.say(security));
    let mut nodes = LaunchedNodes::begin([installation.clone()], lab, arguments.impair, None, &speech)?;
    let victims = [(Victim::Master, arguments.kill_master), (Victim::TcpRouter, arguments.gui == GuiConnection::Tcp)];
    let victims = victims.into_iter().filter(|(_, is_one)| *is_one).map(|(victim, _)| victim).collect();
    let summary =
        watch(&mut nodes, &installation, long, victims).map(|seen| summary(&installation, &seen?, arguments.verbose));
    let code = nodes.stop();
    speech.settle();
    let Some(summary) = summary else { return Ok(ExitCode::FAILURE) };
    let (text, well) = summary?;
    say(text.trim_end());
    drawn(drawing, begun);
    Ok(if well { code } else { ExitCode::FAILURE })
}

/// Runs until the time is over, counted from when all modules are on, or a stop is requested; returns the observed
/// routers, or none if not all modules ran.
fn watch(
    nodes: &mut LaunchedNodes<'_>,
    installation: &Arc<Installation>,
    long: Option<Duration>,
    victims: Vec<Victim>,
) -> Option<Result<TakeoverRecord, Failure>> {
    while !nodes.all_run() {
        if !nodes.watch(Duration::MAX) {
            return None;
        }
    }
    let watch = nodes.capture().and_then(|capture| Watch::begin(installation, capture));
    let watch = match watch {
        Ok(watch) => watch,
        Err(error) => return Some(Err(error)),
    };
    let after = |time: Option<Duration>| time.map(|time| Instant::now() + time);
    let (deadline, mut kill_at) = (after(long), after(long.map(|long| long / 2).filter(|_| !victims.is_empty())));
    let is_over = |at: Option<Instant>| at.is_some_and(|at| Instant::now() >= at);
    while !is_over(deadline) {
        let next = kill_at.or(deadline);
        let left = next.map_or(Duration::MAX, |next| next.saturating_duration_since(Instant::now()));
        if !nodes.watch(left) {
            break;
        }
        if is_over(kill_at) {
            kill_at = None;
            victims.iter().for_each(|victim| watch.kill(*victim));
        }
    }
    Some(watch.end())
}

/// The summary, its verdict first, and whether all is well.
fn summary(installation: &Arc<Installation>, seen: &TakeoverRecord, verbose: bool) -> Result<(String, bool), Failure> {
    let open = |node: &rohrpost_config::Node| Node::open(&node_directory(&installation.name, &node.name));
    let nodes = installation.nodes.iter().map(open).collect::<Result<Vec<_>, _>>()?;
    let (first, name) = (&nodes[0], &installation.nodes[0].name);
    let mut tool = ToolLink::join(installation, first, name, PATIENCE)?;
    let map = map(installation, &mut tool);
    let errors = in_error(installation, &mut tool);
    let (clocks, clocks_hold) = clocks(installation, &nodes);
    let survey = |(node, config): (&Arc<Node>, &rohrpost_config::Node)| Survey::new(node, installation, &config.name);
    let surveys = nodes.iter().zip(&installation.nodes).map(survey).collect::<Result<Vec<_>, _>>()?;
    let died = seen.died();
    let (links, records) = settled(installation, &mut tool, &died)?;
    let losses = ExchangeLosses::ask(installation, &mut tool);
    let kept: Option<Vec<SlotState>> =
        installation.tdma.as_ref().map(|_| of_routers(installation, &mut tool, RouterInterface::SLOTS)).transpose()?;
    let late: Vec<FlowStates> = of_routers(installation, &mut tool, RouterInterface::FLOWS)?;
    let beyond = beyond::ask(installation, &mut tool)?;
    let mut vocabulary = Vocabulary::default();
    let late = tables::measured(installation, &late, &links.iter().collect::<Vec<_>>(), &mut vocabulary, |module| {
        tool.describe(module).ok()
    });
    let losses = losses.table(installation, &mut vocabulary, |module| tool.describe(module).ok());
    tool.close();
    let balance = Balance::of(&links, installation.classes.tool().0, &died);
    let well = errors.is_empty()
        && clocks_hold
        && balance.holds()
        && records.holds()
        && seen.is_well()
        && beyond::is_well(&beyond);
    let verdict = if well { "The demo went well." } else { "The demo did not go well." };
    let mut text = format!("{verdict}\n\n{balance}{records}\n{clocks}");
    let deaths = seen.text();
    if !deaths.is_empty() {
        text += &format!("\n{deaths}\n");
    }
    text += &map;
    text.extend(errors.iter().map(|error| format!("{error}\n")));
    let carried = tables::by_class(installation, &links, |_| true);
    text += &part("Over the network; age: from the stamp of data to the mailbox on the other node", &carried);
    text += &part("Streams by replicas; delay: from writing to the arrival of the whole record", &records.table());
    text += &beyond::text(installation, &beyond, seen.tcp_router_died());
    if !verbose {
        return Ok((text, well));
    }
    text += &part("On the wire", &account::by_link(&links));
    let mailboxes: Vec<MailboxInfo> = surveys.into_iter().flat_map(|survey| survey.mailboxes).collect();
    let classes = print_classes(installation, &sum(&mailboxes));
    text += &part("In the mailboxes of all nodes, and how long packages waited there", &classes);
    text += "(data and replies carry the class of the module that asked for them)\n";
    text += &part(
        "In time slots; off: how far the last frames were from the beginnings of their slots",
        &tables::kept(&kept.unwrap_or_default()),
    );
    text += &part("Declared flows; a slot that was late or skipped costs a cycle", &late);
    if !late.is_empty() {
        text += &tables::flows_legend();
    }
    if !installation.flows.is_empty() {
        text += &part(
            "Declared flows from end to end, as modules count them; too late: answered after the caller's time",
            &losses,
        );
    }
    Ok((text, well))
}

/// A part of the summary below its head; empty without content.
fn part(head: &str, content: &str) -> String {
    if content.is_empty() { String::new() } else { format!("\n{head}:\n\n{content}") }
}

fn map(installation: &Installation, tool: &mut ToolLink) -> String {
    let read = |bytes: &[u8]| from_bytes::<MapCounts>(bytes);
    let mapper = running(installation, CartographerInterface::CLASS);
    let counts = mapper.map(|name| tool.call(name, FIRST_FUNCTION, CartographerInterface::hash(), |_| Ok(()), read));
    match counts {
        Some(Ok(counts)) => map_line(&counts),
        Some(Err(error)) => format!("map: {error}\n"),
        None => String::new(),
    }
}

/// Modules that are in error, or do not answer.
fn in_error(installation: &Installation, tool: &mut ToolLink) -> Vec<String> {
    let told = |module: &rohrpost_config::Module| {
        let name = installation.classes.format(module.name);
        match tool.status(module.name) {
            Ok(status) if status.state == State::Error => Some(format!("{name} is in error: {}", status.error)),
            Err(error) if !module.optional => Some(format!("{name} does not report its state: {error}")),
            _ => None,
        }
    };
    installation.modules.iter().filter_map(told).collect()
}

/// The differences between the nodes' clocks. All run on one computer, so the true difference is known: their pages are
/// read at one moment of the one monotonic clock. False if a node claims a better bound than is true.
fn clocks(installation: &Installation, nodes: &[Arc<Node>]) -> (String, bool) {
    let clocks: Vec<SystemClock> = nodes.iter().map(|node| SystemClock::open(node)).collect();
    let moment = monotonic_ns();
    let times: Vec<_> = clocks.iter().map(|clock| clock.at(moment)).collect();
    // The master is sure of its time, since its time is the common time.
    let master = (0..times.len()).min_by_key(|index| times[*index].error).unwrap_or(0);
    let (mut text, mut holds) = (String::new(), true);
    for (index, node) in installation.nodes.iter().enumerate() {
        let by_master = clocks[index].record().is_some_and(|record| record.source == TimeSource::Master);
        let off_ns = i128::from(times[index].ns) - i128::from(times[master].ns);
        let stated_ns = (times[index].error + times[master].error).as_nanos();
        let name = &node.name;
        text += &match (by_master, index == master) {
            (false, _) => format!("clock of {name}: its own, no master was heard\n"),
            (true, true) => format!("clock of {name}: the master's\n"),
            (true, false) => {
                holds &= off_ns.unsigned_abs() <= stated_ns;
                let (off_us, stated_us) = (off_ns as f64 / 1e3, stated_ns as f64 / 1e3);
                format!("clock of {name}: {off_us:+.2} µs off the master's, at most {stated_us:.1} µs as it says\n")
            }
        };
    }
    if !holds {
        text += "a clock's error exceeds its own bound\n";
    }
    (text, holds)
}

/// The routers' counters when nothing is under way: the sending modules are switched off first.
fn settled(
    installation: &Installation,
    tool: &mut ToolLink,
    died: &[&str],
) -> Result<(Vec<Links>, RecordBalance), Failure> {
    for module in installation.modules.iter().filter(|module| module.is_in_file()) {
        // A module that does not answer is reported above.
        let _ = tool.switch(module.name, false);
    }
    let (deadline, mut before) = (Instant::now() + SETTLE, None);
    loop {
        let links: Vec<Links> = of_routers(installation, tool, RouterInterface::LINKS)?;
        let balance = Balance::of(&links, installation.classes.tool().0, died);
        let records = RecordBalance::of(&replicas(installation, tool)?, balance.datagrams(), died);
        let is_settled = balance.holds() && records.holds() && records.is_settled(before.as_ref());
        if is_settled || Instant::now() >= deadline {
            return Ok((links, records));
        }
        before = Some(records);
        std::thread::sleep(LOOK);
    }
}

/// What the routers on both ends of replicas report; others report nothing of them.
fn replicas(installation: &Installation, tool: &mut ToolLink) -> Result<Vec<ReplicaStates>, Failure> {
    let is_end = |node: &&rohrpost_config::Node| {
        let mut all = installation.replicas.iter();
        all.any(|of| of.to.contains(&node.name) || installation.node_of(of.from) == Some(&node.name))
    };
    let ends = installation.lan_nodes().iter().filter(is_end);
    ends.map(|node| of_router(installation, tool, &node.name, RouterInterface::REPLICAS)).collect()
}

fn of_routers<T: DeserializeOwned>(
    installation: &Installation,
    tool: &mut ToolLink,
    data: DataPort<T>,
) -> Result<Vec<T>, Failure> {
    let nodes = installation.lan_nodes().iter();
    nodes.map(|node| of_router(installation, tool, &node.name, data)).collect()
}

fn of_router<T: DeserializeOwned>(
    installation: &Installation,
    tool: &mut ToolLink,
    node: &str,
    data: DataPort<T>,
) -> Result<T, Failure> {
    let router = installation.router_of(node).ok_or("no router")?;
    let (_, told) = newest(tool, router, data).map_err(|error| format!("router of {node}: {error}"))?;
    Ok(told)
}
