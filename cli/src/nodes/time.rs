//! `rohrpost time`: which node is the master of time, the error bound of each other node, and a new epoch at the
//! computer's clock.

use crate::nodes::round::{Round, Rounds};
use crate::terminal::table::{table, time};
use crate::terminal::units::date;
use crate::terminal::{Failure, say};
use rohrpost::interfaces::{BeyondTime, ClockRole, ClockState, NewEpochError, RouterInterface, TcpInterface};
use rohrpost::wire::from_bytes;
use rohrpost_config::{Reach, TimeSource};
use rohrpost_launch::launcher::{AskLaunch, launcher_of};
use rohrpost_mailbox::{SystemClock, TimeRecord, monotonic_ns, realtime_ns};
use rohrpost_modules::runtime::clock_was_set;
use serde::Serialize;
use std::process::ExitCode;
use std::time::{Duration, Instant};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost time              all nodes, once
  rohrpost time --watch      repeatedly; Ctrl-C ends it
  rohrpost time --new-epoch  system time goes on from the computer's clock, which was set
`bound`: largest possible error against the master's time. `off`: error measured at the last exchange with the \
    master. `way`: shortest recent round trip; a bound cannot be much less than half of it. `ago`: age of the report. \
    Two nodes of the same term and epoch differ by at most the sum of their bounds. Exit code 1: a node does not \
    answer or does not know the time, or there are two masters.")]
pub(crate) struct Arguments {
    #[command(flatten)]
    rounds: Rounds,
    /// Begin a new epoch at the clock of the master's computer; with one node, at this computer's clock.
    #[arg(long, conflicts_with_all = ["watch", "json"])]
    new_epoch: bool,
}

/// The function of a router that begins one.
const NEW_EPOCH: u16 = 16;
/// A new epoch begins within this time.
const BEGINS_WITHIN: Duration = Duration::from_secs(5);
/// How often it is asked whether the new epoch has begun.
const BEGINS_LOOK: Duration = Duration::from_millis(100);

#[derive(Clone, Debug, Default, Serialize)]
struct NodeTime {
    node: String,
    clock: Option<ClockState>,
    /// For a node that gets its time from the TCP router.
    #[serde(skip_serializing_if = "Option::is_none")]
    beyond: Option<BeyondTime>,
    /// Shortest round trip to the TCP router, ns.
    #[serde(skip_serializing_if = "Option::is_none")]
    round_trip_ns: Option<u64>,
    /// Age of the report, by this node's system time, ns; negative if this node's time is behind.
    ago_ns: Option<i64>,
    /// How far the computer's clock was set away from system time, ns; positive: it is ahead.
    #[serde(skip_serializing_if = "Option::is_none")]
    clock_set_by_ns: Option<i64>,
    /// Where the time of a node without a router comes from.
    #[serde(skip_serializing_if = "Option::is_none")]
    source: Option<&'static str>,
    /// The epoch of a node without a router.
    #[serde(skip_serializing_if = "Option::is_none")]
    epoch: Option<u64>,
    /// Why there is no report.
    failure: Option<String>,
}

/// All nodes.
#[derive(Debug, Serialize)]
struct NodeTimes {
    /// Whether all answer, know the time, and follow one master.
    agree: bool,
    nodes: Vec<NodeTime>,
}

pub(crate) fn run(Arguments { rounds, new_epoch }: &Arguments) -> Result<ExitCode, Failure> {
    let mut round = rounds.begin(|_| None)?;
    if *new_epoch {
        say(begin_epoch(&mut round)?);
        return Ok(ExitCode::SUCCESS);
    }
    let clock = SystemClock::open(&round.running.node);
    let agree = loop {
        let told = round.nodes().into_iter().map(|node| ask(&mut round, &clock, node)).collect();
        let nodes = NodeTimes::new(told);
        let text = if rounds.json { serde_json::to_string(&nodes)? } else { nodes.text() };
        if !say(text.trim_end()) || !rounds.watch || round.stop.within(round.interval) {
            break nodes.agree;
        }
    };
    Ok(if agree || rounds.watch { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Has the teller of system time begin a new epoch at its computer's clock, and waits until it is there.
fn begin_epoch(round: &mut Round) -> Result<String, Failure> {
    let installation = &round.running.installation;
    let ended = match &installation.time {
        TimeSource::Simulation { .. } | TimeSource::Log => {
            return Err("system time is that of a simulation or a log, which no clock of a computer sets".into());
        }
        TimeSource::Local => {
            let on_lan = installation.nodes.iter().find(|node| node.reach != Reach::Tcp);
            let node = on_lan.map_or(round.running.node_name.clone(), |node| node.name.clone());
            let launcher = launcher_of(installation, &node).ok_or_else(|| format!("no node `{node}`"))?;
            let begun = round.tool.new_epoch(launcher);
            begun.map_err(|error| format!("launch of node {node}: {error}"))?.saturating_sub(1)
        }
        TimeSource::Master { masters, .. } => {
            let names = masters.iter().filter_map(|index| installation.nodes.get(usize::from(*index)));
            let names: Vec<String> = names.map(|node| node.name.clone()).collect();
            let is_master = |name: &&String| {
                round.newest(name, RouterInterface::CLOCK).is_ok_and(|(_, clock)| clock.role == ClockRole::Master)
            };
            let master = names.iter().find(is_master).ok_or("no node is master of time: see `rohrpost time`")?;
            let router = round.running.installation.router_of(master).ok_or("the master has no router")?;
            let begun: Result<u64, NewEpochError> = round
                .tool
                .call(router, NEW_EPOCH, RouterInterface::hash(), |_| Ok(()), |bytes| from_bytes(bytes))
                .map_err(|error| round.running.told(router, &error))?;
            begun.map_err(|error| format!("router of node {master}: {error}"))?
        }
    };
    let clock = SystemClock::open(&round.running.node);
    let deadline = Instant::now() + BEGINS_WITHIN;
    loop {
        let now = clock.now();
        if now.epoch > ended {
            return Ok(format!("epoch {} of time: {}", now.epoch, date(now.ns)));
        }
        if Instant::now() > deadline {
            return Err(format!("epoch {ended} goes on here; `rohrpost time` shows how the nodes stand").into());
        }
        std::thread::sleep(BEGINS_LOOK);
    }
}

fn ask(round: &mut Round, clock: &SystemClock, node: String) -> NodeTime {
    let mut told = NodeTime { node, ..NodeTime::default() };
    let installation = &round.running.installation;
    let is_beyond = installation.node(&told.node).is_some_and(|node| node.reach == Reach::Tcp);
    let client = installation.tcp_client_of(&told.node).filter(|_| is_beyond);
    let asked = match client {
        Some(client) => round.newest_of(client, TcpInterface::LINK).map(|(_, link)| {
            (told.beyond, told.round_trip_ns) = (link.time, link.round_trip_ns);
            told.beyond.as_ref().map(|time| time.now_ns)
        }),
        // A node alone on its LAN has no router: its time is the common one.
        None if installation.network.is_none() => {
            told.by_page(clock.record().filter(|_| told.node == round.running.node_name))
        }
        None => round.newest(&told.node, RouterInterface::CLOCK).map(|(_, clock)| {
            let now_ns = clock.now_ns;
            told.clock_set_by_ns = clock.clock_set_by_ns;
            told.clock = Some(clock);
            Some(now_ns)
        }),
    };
    match asked {
        Ok(said_ns) => told.ago_ns = said_ns.map(|said_ns| clock.now().ns.wrapping_sub(said_ns).cast_signed()),
        Err(failure) => told.failure = Some(failure),
    }
    told
}

impl NodeTime {
    /// Takes what the page of this node says.
    fn by_page(&mut self, page: Option<TimeRecord>) -> Result<Option<u64>, String> {
        let Some(record) = page else { return Ok(None) };
        if !record.is_known() {
            return Err(format!("it has no time yet: that of the {} has not begun", record.source.name()));
        }
        (self.source, self.epoch) = (Some(record.source.name()), Some(record.epoch));
        self.clock_set_by_ns = record.clock_set_by(monotonic_ns(), realtime_ns());
        Ok(None)
    }

    fn row(&self) -> [String; 11] {
        let ago = self.ago_ns.map_or_else(String::new, |ns| time(Duration::from_nanos(ns.max(0).unsigned_abs())));
        let bound = |error_ns: Option<u64>| error_ns.map_or_else(|| "unknown".into(), |ns| us(ns as f64));
        let way = |ns: Option<u64>| ns.map_or_else(|| "-".into(), |ns| us(ns as f64));
        let none = || String::from("-");
        let node = self.node.clone();
        match (&self.clock, &self.beyond) {
            (Some(clock), _) => [
                node,
                role(clock.role).into(),
                if clock.master.is_empty() { "none".into() } else { clock.master.clone() },
                clock.term.to_string(),
                clock.epoch.to_string(),
                bound(clock.error_ns),
                us(clock.offset_ns as f64),
                format!("{:.3} ppm", clock.rate_ppb as f64 / 1000.0),
                way(clock.round_trip_ns),
                stamps(clock).into(),
                ago,
            ],
            (None, Some(told)) => {
                let (epoch, way) = (told.epoch.to_string(), way(self.round_trip_ns));
                let master = "TCP router".into();
                [node, "by TCP".into(), master, none(), epoch, bound(told.error_ns), none(), none(), way, none(), ago]
            }
            (None, None) => {
                let epoch = self.epoch.map_or_else(none, |epoch| epoch.to_string());
                let role = self.source.filter(|source| *source != "local").unwrap_or("own").into();
                [node, role, none(), none(), epoch, us(0.0), none(), none(), none(), none(), ago]
            }
        }
    }
}

impl NodeTimes {
    fn new(nodes: Vec<NodeTime>) -> Self {
        let follows = |told: &NodeTime| {
            let clock = told.clock.as_ref().filter(|clock| clock.error_ns.is_some())?;
            Some((clock.master.clone(), clock.term, clock.epoch)).filter(|(master, ..)| !master.is_empty())
        };
        // Nodes that get the time from the TCP router know only its epoch, not the master.
        let first = nodes.iter().find(|told| told.clock.is_some()).and_then(follows);
        let agrees = |told: &NodeTime| match (&told.clock, &told.beyond) {
            (Some(_), _) => first.is_some() && follows(told) == first,
            (None, Some(time)) => {
                let epoch = first.as_ref().map_or(time.epoch, |(.., epoch)| *epoch);
                time.error_ns.is_some() && time.epoch == epoch
            }
            (None, None) => told.failure.is_none(),
        };
        let agree = nodes.iter().all(agrees);
        Self { agree, nodes }
    }

    fn text(&self) -> String {
        let heads = ["node", "role", "master", ">term", ">epoch", ">bound", ">off", ">rate", ">way", "stamps", ">ago"];
        let rows = self.nodes.iter().filter(|told| told.failure.is_none()).map(NodeTime::row);
        let mut text = table(heads, rows);
        for told in &self.nodes {
            if let Some(failure) = &told.failure {
                text += &format!("{}: {failure}\n", told.node);
            }
            if let Some(by_ns) = told.clock_set_by_ns {
                let is_slave = told.clock.as_ref().is_some_and(|clock| clock.role != ClockRole::Master);
                let advice = if is_slave { "" } else { "; `rohrpost time --new-epoch` begins a new epoch at it" };
                text += &format!("{}: {}{advice}\n", told.node, clock_was_set(by_ns));
            }
        }
        text
    }
}

/// Where the time stamps of its measurements come from.
fn stamps(clock: &ClockState) -> &'static str {
    match (clock.role, clock.exchanges) {
        (ClockRole::Master, _) | (_, 0) => "-",
        _ if clock.by_kernel => "kernel",
        _ => "own",
    }
}

fn role(role: ClockRole) -> &'static str {
    match role {
        ClockRole::Listening => "listening",
        ClockRole::Slave => "slave",
        ClockRole::Master => "master",
    }
}

/// Microseconds, with as many decimals as clocks resolve.
fn us(ns: f64) -> String {
    let us = ns / 1000.0;
    if us.abs() < 1000.0 { format!("{us:.1} µs") } else { format!("{:.2} ms", us / 1000.0) }
}
