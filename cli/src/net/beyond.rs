//! The TCP router's part of `rohrpost net`: the clients of all nodes as they report themselves, and the server's own
//! view.

use super::node_report::NodeReport;
use crate::table::{table, time};
use crate::target::Running;
use crate::units::{bytes, fine};
use rohrpost::Class;
use rohrpost::interfaces::{BeyondClients, BeyondCrowded, BeyondLink, BeyondState, ClassPassed};
use rohrpost::output::plain;
use std::time::Duration;

/// Tables of clients, of the server's connections and of lost or replaced packages, and why a client is not connected;
/// empty without a TCP router.
pub(super) fn text(running: &Running, all: &[NodeReport]) -> [String; 4] {
    let links: Vec<&BeyondLink> = all.iter().filter_map(|told| told.beyond.as_ref()).collect();
    let servers: Vec<&BeyondClients> = all.iter().filter_map(|told| told.clients.as_ref()).collect();
    [self::links(&links), whys(&links), clients(&servers), losses(running, &links, &servers)]
}

fn links(links: &[&BeyondLink]) -> String {
    let ns = |ns: Option<u64>| ns.map_or("-".into(), |ns| fine(ns as f64 * 1e-9));
    let sum = |classes: &[ClassPassed]| classes.iter().map(|class| class.passed).sum::<u64>().to_string();
    let row = |link: &&BeyondLink| {
        let state = match link.state {
            BeyondState::Away => "away",
            BeyondState::Joining => "joining",
            BeyondState::Up => "up",
        };
        [
            link.node.clone(),
            link.server.clone(),
            state.into(),
            link.reconnects.to_string(),
            outages(link),
            ns(link.round_trip_ns),
            link.time_error_ns.map_or("-".into(), |error_ns| format!("±{}", fine(error_ns as f64 * 1e-9))),
            sum(&link.sent),
            sum(&link.received),
            bytes(link.waiting_bytes as f64),
        ]
    };
    let heads = [
        "node",
        "TCP router",
        "state",
        ">reconnects",
        "outages",
        ">there and back",
        ">time",
        ">sent",
        ">received",
        ">memory",
    ];
    if links.is_empty() { String::new() } else { table(heads, links.iter().map(row)) }
}

/// How often it was disconnected, and for how long.
fn outages(link: &BeyondLink) -> String {
    let Some(last) = link.outage else { return "none".into() };
    let took = match last.ended_ns {
        Some(ended_ns) => format!("the last took {}", time(last.duration(ended_ns))),
        None => "it is disconnected".into(),
    };
    format!("{}, {took}", link.outages)
}

fn whys(links: &[&BeyondLink]) -> String {
    let told = links.iter().filter(|link| !link.why.is_empty());
    told.map(|link| format!("node {}: {}\n", link.node, plain::line(&link.why))).collect()
}

fn clients(servers: &[&BeyondClients]) -> String {
    let mut text = String::new();
    for server in servers {
        let ms = |ms: u64| time(Duration::from_millis(ms));
        let rows = server.clients.iter().map(|client| {
            [
                client.name.clone(),
                client.address.clone(),
                client.system.to_string(),
                if client.takes_part { "takes part".into() } else { "-".into() },
                client.ranges.to_string(),
                ms(client.age_ms),
                ms(client.heard_ms),
                client.lost.to_string(),
                bytes(client.bytes as f64),
            ]
        });
        let heads = ["client", "from", ">system", "state", ">ranges", ">since", ">heard", ">lost", ">memory"];
        text += &table(heads, rows);
        if server.more > 0 {
            text += &format!("… and {} more\n", server.more);
        }
        text += &format!("(TCP router at {}: {} left, {} refused)\n", server.address, server.left, server.refused);
        let BeyondCrowded { greetings, clients, ranges, packages } = server.crowded;
        if greetings + clients + ranges + packages > 0 {
            text += &format!(
                "(beyond the part of one certificate or address: {packages} packages lost, {clients} clients and \
                 {greetings} connections before their hello gave way, {ranges} registrations of too many ranges)\n"
            );
        }
        if server.overtaken > 0 {
            text += &format!("({} registrations were replaced by later ones of the same client)\n", server.overtaken);
        }
        if !server.refusal.is_empty() {
            text += &format!("the last that was refused: {}\n", plain::line(&server.refusal));
        }
    }
    text
}

/// Classes with lost or replaced packages; the others are in the JSON.
fn losses(running: &Running, links: &[&BeyondLink], servers: &[&BeyondClients]) -> String {
    let ends = links.iter().flat_map(|link| {
        [(format!("{}, to the TCP router", link.node), &link.sent), (format!("{}, from it", link.node), &link.received)]
    });
    let ends = ends.chain(servers.iter().map(|server| ("TCP router".into(), &server.classes)));
    let mut rows = Vec::new();
    for (at, classes) in ends {
        for class in classes.iter().filter(|class| class.replaced > 0 || !class.lost.is_empty()) {
            let name = running.installation.classes.name(Class(class.class)).map(str::to_owned);
            let lost: Vec<String> = class.lost.iter().map(|lost| format!("{} {}", lost.packages, lost.cause)).collect();
            let name = name.unwrap_or_else(|| class.class.to_string());
            let [came, passed, replaced] =
                [class.packages, class.passed, class.replaced].map(|count| count.to_string());
            let lost = if lost.is_empty() { "none".into() } else { lost.join(", ") };
            rows.push([at.clone(), name, came, passed, replaced, lost]);
        }
    }
    if rows.is_empty() { String::new() } else { table(["at", "class", ">came", ">passed", ">replaced", "lost"], rows) }
}
