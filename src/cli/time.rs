//! `rohrpost time`: which node is the master of time, and how well each of the others knows it.

use super::round::{Round, Rounds};
use super::table::{table, time};
use super::{Failure, say};
use rohrpost::interfaces::{ClockRole, ClockState, RouterInterface};
use rohrpost::mailbox::SystemClock;
use serde::Serialize;
use std::process::ExitCode;
use std::time::Duration;

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
    rounds: Rounds,
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

pub(super) fn run(Arguments { rounds }: &Arguments) -> Result<ExitCode, Failure> {
    let alone = "this installation has one node, whose time is its own; `rohrpost top` shows it";
    let mut round = rounds.begin(alone, |installation| installation.network.is_some())?;
    let clock = SystemClock::open(&round.running.node);
    let agree = loop {
        let told = round.nodes().into_iter().map(|node| ask(&mut round, &clock, node)).collect();
        let nodes = Nodes::new(told);
        let text = if rounds.json { serde_json::to_string(&nodes)? } else { nodes.text() };
        if !say(text.trim_end()) || !rounds.watch || round.stop.within(round.interval) {
            break nodes.agree;
        }
    };
    round.close();
    Ok(if agree || rounds.watch { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn ask(round: &mut Round, clock: &SystemClock, node: String) -> Told {
    match round.newest(&node, RouterInterface::CLOCK) {
        Ok((_, told)) => {
            let ago_ns = clock.now().ns.wrapping_sub(told.now_ns).cast_signed();
            Told { node, clock: Some(told), ago_ns: Some(ago_ns), failure: None }
        }
        Err(failure) => Told { node, clock: None, ago_ns: None, failure: Some(failure) },
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
