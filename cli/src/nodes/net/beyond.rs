//! The TCP router's part of `rohrpost net`: the clients of all nodes as they report themselves, and the server's own
//! view.

use super::node_report::NodeReport;
use crate::look::summary::class_name;
use crate::look::target::Running;
use crate::nodes::quantities::{cells, counted, heads};
use crate::nodes::tables::lost;
use crate::terminal::table::{table_of, time};
use rohrpost::Class;
use rohrpost::interfaces::{BeyondClient, BeyondClients, BeyondLink, BeyondState, ClassPassed};
use rohrpost::output::plain;

/// Tables of clients, of the server's connections and of lost or replaced packages, and why a client is not connected;
/// empty without a TCP router.
pub(super) fn text(running: &Running, all: &[NodeReport]) -> [String; 4] {
    let links: Vec<&BeyondLink> = all.iter().filter_map(|told| told.beyond.as_ref()).collect();
    let servers: Vec<&BeyondClients> = all.iter().filter_map(|told| told.clients.as_ref()).collect();
    [self::links(&links), whys(&links), clients(&servers), losses(running, &links, &servers)]
}

/// A row for each client; empty if there are none.
pub(crate) fn links(links: &[&BeyondLink]) -> String {
    let sum = |classes: &[ClassPassed]| classes.iter().map(|class| class.passed).sum::<u64>().to_string();
    let row = |link: &&BeyondLink| {
        let state = match link.state {
            BeyondState::Away => "away",
            BeyondState::Joining => "joining",
            BeyondState::Up => "up",
        };
        let before = [link.node.clone(), link.server.clone(), state.into()];
        cells(before, *link, [outage(link), sum(&link.sent), sum(&link.received)])
    };
    let heads = heads::<BeyondLink>(&["node", "TCP router", "state"], &["last outage", ">sent", ">received"]);
    if links.is_empty() { String::new() } else { table_of(&heads, links.iter().map(row)) }
}

/// How long it was disconnected.
fn outage(link: &BeyondLink) -> String {
    let Some(last) = link.outage else { return "none".into() };
    last.ended_ns.map_or("it is disconnected".into(), |ended_ns| format!("took {}", time(last.duration(ended_ns))))
}

fn whys(links: &[&BeyondLink]) -> String {
    let told = links.iter().filter(|link| !link.why.is_empty());
    told.map(|link| format!("node {}: {}\n", link.node, plain::line(&link.why))).collect()
}

fn clients(servers: &[&BeyondClients]) -> String {
    let mut text = String::new();
    for server in servers {
        let rows = server.clients.iter().map(|client| {
            let state = if client.takes_part { "takes part" } else { "-" };
            let before = [client.name.clone(), client.address.clone(), client.system.to_string(), state.into()];
            cells(before, client, [])
        });
        text += &table_of(&heads::<BeyondClient>(&["client", "from", ">system", "state"], &[]), rows);
        if server.more > 0 {
            text += &format!("… and {} more\n", server.more);
        }
        text += &format!(
            "(TCP router at {}: counted {}; beyond the share of one certificate or address {})\n",
            server.address,
            counted(*server),
            counted(&server.crowded)
        );
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
            let name = class_name(&running.installation, Some(Class(class.class)));
            rows.push(cells([at.clone(), name], class, [lost(&class.lost)]));
        }
    }
    let heads = heads::<ClassPassed>(&["at", "class"], &["lost"]);
    if rows.is_empty() { String::new() } else { table_of(&heads, rows) }
}
