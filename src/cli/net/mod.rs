//! `rohrpost net`: how the routers of all nodes are: who hears whom, what waits, what was lost and why, and whose time is how good.

mod show;

use super::target::{Running, Target};
use super::units::{Stop, seconds};
use super::{Failure, say};
use rohrpost::common::GET_DATA;
use rohrpost::interfaces::{ClockState, Links, RouterInterface};
use rohrpost::macro_support::{DataPort, append, from_bytes};
use rohrpost::serde::de::DeserializeOwned;
use rohrpost::{CallError, Fault, Name, ToolLink};
use serde::Serialize;
use std::process::ExitCode;
use std::time::Duration;

/// A router that does not answer for so long is silent.
const PATIENCE: Duration = Duration::from_secs(1);
/// Between the two looks that a rate is made of: routers tell how they are twice a second.
const LOOK_AGAIN: Duration = Duration::from_millis(600);

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost net                all nodes, once
  rohrpost net --watch        again and again; Ctrl-C ends it
  rohrpost net --node arm --json
`lost` are datagrams from the peer that never came, `missed` those to it that it misses; both are losses on the wire. Packages lost in \
routers stand below, by class and cause. The exit code is 1 if a router does not answer or a peer is not alive.")]
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

/// What a node's router says.
#[derive(Clone, Debug, Serialize)]
struct Told {
    node: String,
    /// When it said so, system time.
    time_ns: u64,
    links: Option<Links>,
    clock: Option<ClockState>,
    /// Bytes and packages a second, by peer; empty at the first look.
    rates: Vec<Rates>,
    /// Why there is nothing.
    failure: Option<String>,
}

/// What goes to and comes from a peer, a second.
#[derive(Clone, Debug, Serialize)]
struct Rates {
    node: String,
    sent_packages_s: f64,
    sent_bytes_s: f64,
    received_packages_s: f64,
    received_bytes_s: f64,
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let running = arguments.target.find()?;
    if running.installation.network.is_none() {
        return Err("this installation has one node, and so no routers; `rohrpost list` shows what runs".into());
    }
    let interval = seconds(arguments.interval)?;
    let stop = Stop::new()?;
    let mut tool = running.join(PATIENCE)?;
    let mut before = look(&running, &mut tool);
    let mut wait = LOOK_AGAIN;
    let mut stopped = stop.within(wait);
    let mut well = false;
    while !stopped {
        let mut now = look(&running, &mut tool);
        for (told, before) in now.iter_mut().zip(&before) {
            told.rates = rates(before, told);
        }
        well = now.iter().all(Told::is_well);
        let text = if arguments.json { serde_json::to_string(&now)? } else { show::text(&running, &now) };
        if !say(text.trim_end()) || !arguments.watch {
            break;
        }
        before = now;
        wait = interval;
        stopped = stop.within(wait);
    }
    tool.close();
    Ok(if well || stopped { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Asks the routers of all nodes that are meant.
fn look(running: &Running, tool: &mut ToolLink) -> Vec<Told> {
    running.shown().into_iter().map(|node| ask(running, tool, node)).collect()
}

fn ask(running: &Running, tool: &mut ToolLink, node: &str) -> Told {
    let mut told = Told { node: node.into(), time_ns: 0, links: None, clock: None, rates: Vec::new(), failure: None };
    let Some(router) = running.installation.router_of(node) else { return told };
    match newest(tool, router, RouterInterface::LINKS) {
        Ok((time_ns, links)) => {
            told.links = Some(links);
            told.time_ns = time_ns;
            // A router that has no clock publishes none.
            told.clock = newest(tool, router, RouterInterface::CLOCK).ok().map(|(_, clock)| clock);
        }
        Err(CallError::Fault(_, Fault::NothingYet)) => told.failure = Some("it has just begun; ask again".into()),
        Err(error) => told.failure = Some(running.told(router, &error).to_string()),
    }
    told
}

/// The newest value that a router has published, and of when it is.
fn newest<T: DeserializeOwned>(tool: &mut ToolLink, router: Name, port: DataPort<T>) -> Result<(u64, T), CallError> {
    let write = |body: &mut Vec<u8>| append(body, &(port.number,));
    tool.call(router, GET_DATA, (port.hash)(), write, |bytes| from_bytes(bytes))
}

/// What went by between two looks; nothing if the router was started anew in between, or has not told anything new.
fn rates(before: &Told, now: &Told) -> Vec<Rates> {
    let (Some(old), Some(new)) = (&before.links, &now.links) else { return Vec::new() };
    let elapsed_s = now.time_ns.saturating_sub(before.time_ns) as f64 * 1e-9;
    if elapsed_s <= 0.0 || new.uptime_ms < old.uptime_ms {
        return before.rates.clone();
    }
    let rate = |new: u64, old: u64| new.saturating_sub(old) as f64 / elapsed_s;
    let peers = new.peers.iter().zip(&old.peers).map(|(new, old)| Rates {
        node: new.node.clone(),
        sent_packages_s: rate(new.sent.packages, old.sent.packages),
        sent_bytes_s: rate(new.sent.bytes, old.sent.bytes),
        received_packages_s: rate(new.received.packages, old.received.packages),
        received_bytes_s: rate(new.received.bytes, old.received.bytes),
    });
    peers.collect()
}

impl Told {
    /// Whether its router answers, and all its peers are there.
    fn is_well(&self) -> bool {
        use rohrpost::interfaces::LinkState;
        self.links.as_ref().is_some_and(|links| links.peers.iter().all(|peer| peer.state == LinkState::Alive))
    }
}
