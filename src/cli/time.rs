//! `rohrpost time`: which node is the master of time, and how well each of the others knows it.

use super::table::{table, time};
use super::target::{Running, Target};
use super::units::{Stop, seconds};
use super::{Failure, say};
use rohrpost::common::GET_DATA;
use rohrpost::interfaces::{ClockRole, ClockState, RouterInterface};
use rohrpost::macro_support::{append, from_bytes};
use rohrpost::mailbox::SystemClock;
use rohrpost::{CallError, Fault, ToolLink};
use serde::Serialize;
use std::process::ExitCode;
use std::time::Duration;

/// A router that does not answer for so long is silent.
const PATIENCE: Duration = Duration::from_secs(1);

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost time              all nodes, once
  rohrpost time --watch      again and again; Ctrl-C ends it
`bound`: the node's time is not further off the master's. `off`: what it found itself off by at its last exchange with the master. \
`way`: the shortest way there and back of late; a bound cannot be much less than half of it. `ago`: when the node said so. Two nodes \
of the same term and epoch differ by at most the sum of their bounds. The exit code is 1 if a node does not answer or does not know the \
time, or if there are two masters.")]
pub(super) struct Arguments {
    #[command(flatten)]
    target: Target,
    /// Show it again and again.
    #[arg(long)]
    watch: bool,
    /// From one to the next, seconds.
    #[arg(long, default_value_t = 1.0, value_name = "SECONDS", requires = "watch")]
    interval: f64,
    /// One JSON object a line.
    #[arg(long)]
    json: bool,
}

/// What a node says of its time.
#[derive(Clone, Debug, Serialize)]
struct Told {
    node: String,
    clock: Option<ClockState>,
    /// How long ago it said so, by this node's system time, ns; less than nothing if this node's time is behind.
    ago_ns: Option<i64>,
    /// Why there is nothing.
    failure: Option<String>,
}

/// All nodes.
#[derive(Debug, Serialize)]
struct Nodes {
    /// Whether all answer, know the time, and follow one master.
    agree: bool,
    nodes: Vec<Told>,
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let running = arguments.target.find()?;
    if running.installation.network.is_none() {
        return Err("this installation has one node, whose time is its own; `rohrpost top` shows it".into());
    }
    let interval = seconds(arguments.interval)?;
    let stop = Stop::new()?;
    let mut tool = running.join(PATIENCE)?;
    let clock = SystemClock::open(&running.node);
    let agree = loop {
        let told = running.shown().into_iter().map(|node| ask(&running, &mut tool, &clock, node)).collect();
        let nodes = Nodes::new(told);
        let text = if arguments.json { serde_json::to_string(&nodes)? } else { nodes.text() };
        if !say(text.trim_end()) || !arguments.watch || stop.within(interval) {
            break nodes.agree;
        }
    };
    tool.close();
    Ok(if agree || arguments.watch { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn ask(running: &Running, tool: &mut ToolLink, clock: &SystemClock, node: &str) -> Told {
    let none = Told { node: node.into(), clock: None, ago_ns: None, failure: None };
    let Some(router) = running.installation.router_of(node) else { return none };
    let port = RouterInterface::CLOCK;
    let write = |body: &mut Vec<u8>| append(body, &(port.number,));
    let told: Result<(u64, ClockState), _> =
        tool.call(router, GET_DATA, (port.hash)(), write, |bytes| from_bytes(bytes));
    match told {
        Ok((_, told)) => {
            let ago_ns = clock.now().ns.wrapping_sub(told.now_ns).cast_signed();
            Told { clock: Some(told), ago_ns: Some(ago_ns), ..none }
        }
        Err(CallError::Fault(_, Fault::NothingYet)) => {
            Told { failure: Some("it has just begun; ask again".into()), ..none }
        }
        Err(error) => Told { failure: Some(running.told(router, &error).to_string()), ..none },
    }
}

impl Nodes {
    fn new(nodes: Vec<Told>) -> Self {
        let follows = |told: &Told| {
            let clock = told.clock.as_ref().filter(|clock| clock.error_ns.is_some())?;
            Some((clock.master.clone(), clock.term, clock.epoch)).filter(|(master, ..)| !master.is_empty())
        };
        let first = nodes.first().and_then(follows);
        let agree = first.is_some() && nodes.iter().all(|told| follows(told) == first);
        Self { agree, nodes }
    }

    fn text(&self) -> String {
        let heads = ["node", "role", "master", ">term", ">epoch", ">bound", ">off", ">rate", ">way", "stamps", ">ago"];
        let known = self.nodes.iter().filter_map(|told| Some((told, told.clock.as_ref()?)));
        let rows = known.map(|(told, clock)| {
            [
                told.node.clone(),
                role(clock.role).into(),
                if clock.master.is_empty() { "none".into() } else { clock.master.clone() },
                clock.term.to_string(),
                clock.epoch.to_string(),
                clock.error_ns.map_or_else(|| "unknown".into(), |ns| us(ns as f64)),
                us(clock.offset_ns as f64),
                format!("{:.3} ppm", clock.rate_ppb as f64 / 1000.0),
                clock.round_trip_ns.map_or_else(|| "-".into(), |ns| us(ns as f64)),
                stamps(clock).into(),
                told.ago_ns.map_or_else(String::new, |ns| time(Duration::from_nanos(ns.max(0).unsigned_abs()))),
            ]
        });
        let mut text = table(heads, rows);
        for told in &self.nodes {
            if let Some(failure) = &told.failure {
                text += &format!("{}: {failure}\n", told.node);
            }
        }
        text
    }
}

/// Who stamps the frames that it measures by.
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

/// Microseconds, with as many places as clocks have.
fn us(ns: f64) -> String {
    let us = ns / 1000.0;
    if us.abs() < 1000.0 { format!("{us:.1} µs") } else { format!("{:.2} ms", us / 1000.0) }
}
