//! `rohrpost net`: the state of all nodes' routers: links, queues, losses with their causes, and the quality of each
//! clock.

pub(crate) mod beyond;
mod node_report;
mod show;
mod team;

use crate::nodes::quantities::legend;
use crate::nodes::round::{Round, Rounds};
use crate::nodes::vocabulary::Vocabulary;
use crate::terminal::{Failure, say};
use node_report::{NodeReport, rates};
use rohrpost::interface::DataPort;
use rohrpost::interfaces::{
    BeyondClient, BeyondClients, BeyondCrowded, BeyondLink, ClassPassed, LinkCounters, RouterInterface, SlotState,
    TcpInterface, TeamLinks, TeamNode, TeamRouterInterface, TunnelState,
};
use rohrpost::serde::de::DeserializeOwned;
use std::process::ExitCode;
use std::time::Duration;

/// Time between the two observations of a rate: routers publish their state twice a second.
const LOOK_AGAIN: Duration = Duration::from_millis(600);

const EXAMPLES: &str = "Examples:
  rohrpost net                all nodes, once
  rohrpost net --watch        repeatedly; Ctrl-C ends it
  rohrpost net --node arm --json
Exit code 1: a router or a client of the TCP router does not answer, a peer is not alive, a client is not \
    connected, or the network of [team] is not there.
";

/// Examples, and what each counter means.
fn help() -> String {
    let parts = [
        ("Of a link between two routers", legend::<LinkCounters>()),
        ("Of time slots", legend::<SlotState>()),
        ("Of the tunnel", legend::<TunnelState>()),
        ("Of a client of the TCP router", legend::<BeyondLink>()),
        ("Of a connection with the TCP router", legend::<BeyondClient>()),
        ("Of the TCP router", legend::<BeyondClients>()),
        ("Of what went beyond the share of a certificate or address there", legend::<BeyondCrowded>()),
        ("Of a class there, and at its clients", legend::<ClassPassed>()),
        ("Of a node of another system, by [team]", legend::<TeamNode>()),
        ("Of a router of [team]", legend::<TeamLinks>()),
    ];
    parts.into_iter().fold(EXAMPLES.to_owned(), |text, (of, lines)| format!("{text}{of}:\n{lines}"))
}

#[derive(clap::Args)]
#[command(after_help = help())]
pub(crate) struct Arguments {
    #[command(flatten)]
    rounds: Rounds,
}

pub(crate) fn run(Arguments { rounds }: &Arguments) -> Result<ExitCode, Failure> {
    let mut round = rounds.begin(|installation| {
        let alone = "this installation has one node, and so no routers; `rohrpost list` shows what runs";
        let has_none = installation.network.is_none() && installation.tcp.is_none() && installation.team.is_none();
        has_none.then(|| alone.into())
    })?;
    let mut before = look(&mut round);
    let mut vocabulary = Vocabulary::default();
    let mut wait = LOOK_AGAIN;
    let mut stopped = round.stop.within(wait);
    let mut well = false;
    while !stopped {
        let mut now = look(&mut round);
        for (told, before) in now.iter_mut().zip(&before) {
            told.rates = rates(before, told);
        }
        well = now.iter().all(NodeReport::is_well);
        let text =
            if rounds.json { serde_json::to_string(&now)? } else { show::text(&round.running, &now, &mut vocabulary) };
        if !say(text.trim_end()) || !rounds.watch {
            break;
        }
        before = now;
        wait = round.interval;
        stopped = round.stop.within(wait);
    }
    Ok(if well || (stopped && rounds.watch) { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Asks the routers of all selected nodes.
fn look(round: &mut Round) -> Vec<NodeReport> {
    round.nodes().into_iter().map(|node| ask(round, node)).collect()
}

fn ask(round: &mut Round, node: String) -> NodeReport {
    let mut told = if round.running.installation.router_of(&node).is_some() {
        ask_router(round, node)
    } else {
        NodeReport { node, ..NodeReport::default() }
    };
    let installation = &round.running.installation;
    let client = installation.tcp_client_of(&told.node);
    let server = installation.tcp_router().filter(|router| installation.node_of(*router) == Some(&told.node));
    if let Some(client) = client {
        match round.newest_of(client, TcpInterface::LINK) {
            Ok((_, link)) => told.beyond = Some(link),
            Err(failure) => told.failure = told.failure.or(Some(failure)),
        }
    }
    if let Some(router) = round.running.installation.team_router_of(&told.node) {
        match round.newest_of(router, TeamRouterInterface::LINKS) {
            Ok((_, links)) => told.team = Some(links),
            Err(failure) => told.failure = told.failure.or(Some(failure)),
        }
    }
    let has_replicas = !round.running.installation.replicas.is_empty();
    for end in client.into_iter().chain(server).filter(|_| has_replicas) {
        // An end without any publishes none.
        let states = round.newest_of(end, TcpInterface::REPLICAS);
        states.into_iter().for_each(|(_, states)| told.add_replicas(states));
    }
    told.clients =
        server.and_then(|server| round.newest_of(server, TcpInterface::CLIENTS).ok()).map(|(_, clients)| clients);
    told
}

fn ask_router(round: &mut Round, node: String) -> NodeReport {
    let (time_ns, links) = match round.newest(&node, RouterInterface::LINKS) {
        Ok(told) => told,
        Err(failure) => return NodeReport { node, failure: Some(failure), ..NodeReport::default() },
    };
    let installation = &round.running.installation;
    let in_slots = installation.tdma.is_some();
    let (declares, replicates) = (!installation.flows.is_empty(), !installation.replicas.is_empty());
    // A router without a clock publishes none, and one without slots publishes none.
    let clock = newest_if(true, round, &node, RouterInterface::CLOCK);
    let slots = newest_if(in_slots, round, &node, RouterInterface::SLOTS);
    let flows = newest_if(declares, round, &node, RouterInterface::FLOWS);
    let replicas = newest_if(replicates, round, &node, RouterInterface::REPLICAS);
    NodeReport { node, time_ns, links: Some(links), clock, slots, flows, replicas, ..NodeReport::default() }
}

fn newest_if<T: DeserializeOwned>(there: bool, round: &mut Round, node: &str, port: DataPort<T>) -> Option<T> {
    there.then(|| round.newest(node, port).ok()).flatten().map(|(_, value)| value)
}
