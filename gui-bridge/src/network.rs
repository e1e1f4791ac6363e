//! Nodes, the links between them, and their clocks: what routers tell, drawn as a graph and as charts.
//!
//! ```text
//!   network/graph            nodes on a circle; on each link, in each direction: state, packages a second, lost
//!   network/packages/A → B   packages a second        network/counters/…    what each node counts of its peers
//!   network/clock/NODE       error bound, µs          network/offset/NODE   offset at the last exchange, µs
//!   network/latency/…        by class and hop, µs: until the router has it, until it is delivered, until it is taken
//! ```

use crate::blueprint::Tab;
use crate::error::DrawError;
use crate::nodes::RATE_INTERVAL_MIN;
use crate::palette;
use crate::scene::{Scene, entity};
use crate::view::{Datum, View, is};
use rerun::blueprint::{ContainerLike, GraphView, Horizontal, TimeSeriesView, Vertical};
use rerun::{AsComponents, GraphEdges, GraphNodes, Scalars, SerializedComponentBatch};
use rohrpost::Class;
use rohrpost::interfaces::{ClockState, LinkState, Links, PeerLink};
use rohrpost::schema::{DataItem, Description, counters};
use rohrpost_config::Installation;
use std::collections::{BTreeMap, HashMap};
use std::f32::consts::TAU;
use std::time::{Duration, Instant};

/// Radius of the circle of nodes, and distance of a link's words from the straight line, points of the view.
const RADIUS: f32 = 260.0;
const ASIDE: f32 = 34.0;
const NODE: palette::Rgb = [86, 180, 233];

/// A router tells how it is twice a second; what it told so long ago is no news.
const OLD: Duration = Duration::from_secs(3);

/// Charts of packages, links and clocks: name and entity of each.
const PACKAGES: [(&str, &str); 4] = [
    ("Packages per second, by link", "network/packages"),
    ("Counted of links since start", "network/counters"),
    ("Clock error bound, µs", "network/clock"),
    ("Waits by class and hop, µs: 99 of 100", "network/latency"),
];
/// Charts of replicas.
const RECORDS: [(&str, &str); 3] = [
    ("Records per second, by replica", "network/records"),
    ("Not in replicas since start, by cause", "network/records lost"),
    ("Delay of records, ms", "network/delay"),
];

/// The tab of links and clocks.
pub(crate) fn tab() -> Tab {
    Tab::own("Network", || Horizontal::new([graph(), charts(&PACKAGES)]).with_name("Network"))
}

/// The same where there are replicas, too.
pub(crate) fn tab_with_replicas() -> Tab {
    Tab::own("Network", || {
        let charts = Horizontal::new([charts(&PACKAGES), charts(&RECORDS)]);
        Horizontal::new([graph(), charts.into()]).with_column_shares([2.0, 3.0]).with_name("Network")
    })
}

fn graph() -> ContainerLike {
    GraphView::new("Nodes and links").with_origin("network/graph").into()
}

fn charts(charts: &[(&str, &str)]) -> ContainerLike {
    let chart = |(name, origin): &(&str, &str)| -> ContainerLike {
        let parts: Vec<&str> = origin.split('/').collect();
        TimeSeriesView::new(*name).with_origin(entity(&parts)).into()
    };
    Vertical::new(charts.iter().map(chart).collect::<Vec<_>>()).into()
}

/// Links, as all routers see theirs.
#[derive(Default)]
pub(crate) struct Network {
    /// By the node that tells, and when it did.
    last: BTreeMap<String, (Links, Instant)>,
    /// Packages a second, by the node that sends and the one that receives.
    rates: HashMap<(String, String), f64>,
    /// System time of the graph that was drawn last, ns.
    drawn_ns: u64,
}

impl View for Network {
    fn wants(&self, _: &Description, item: &DataItem) -> bool {
        is::<Links>(item)
    }

    fn draw(&mut self, scene: &mut Scene, datum: &Datum<'_>) -> Result<(), DrawError> {
        let links: Links = datum.read()?;
        let before = self.last.get(&links.node).map(|(before, _)| before);
        for peer in &links.peers {
            let from_to = (links.node.clone(), peer.node.clone());
            if let Some(per_s) = before.and_then(|before| sent_per_s(before, &links, peer)) {
                self.rates.insert(from_to, per_s);
            }
            let name = format!("{} → {}", links.node, peer.node);
            let per_s = self.rates.get(&(links.node.clone(), peer.node.clone())).copied().unwrap_or(0.0);
            scene.curve(&["network", "packages", &name], per_s);
            for (counter, count) in counters(&peer.counters) {
                let name = format!("{}, of {}", links.node, peer.node);
                scene.curve(&["network", "counters", &counter.name, &name], count as f64);
            }
        }
        for class in &links.classes {
            let Some(age) = class.age else { continue };
            let name = datum.installation.classes.name(Class(class.class)).unwrap_or("others");
            let name = format!("{name} delivered to {}", links.node);
            scene.curve(&["network", "latency", &name], age.p99_ns as f64 / 1e3);
        }
        self.last.insert(links.node.clone(), (links, Instant::now()));
        self.drawn_ns = onward(self.drawn_ns, scene.time_ns);
        scene.set_time(self.drawn_ns);
        scene.log(entity(&["network", "graph"]), &self.graph(datum.installation));
        Ok(())
    }

    fn tabs(&self) -> Vec<Tab> {
        vec![tab()]
    }
}

/// When the graph is drawn that this report of a router changes. Several routers report it, and a report may come after
/// a later one of another router; an entity's rows go on in time, unless time itself went back.
fn onward(drawn_ns: u64, told_ns: u64) -> u64 {
    let went_back = u128::from(drawn_ns.saturating_sub(told_ns)) > OLD.as_nanos();
    if went_back { told_ns } else { told_ns.max(drawn_ns) }
}

/// None when the router began anew in between, or told both at nearly the same time.
fn sent_per_s(before: &Links, now: &Links, peer: &PeerLink) -> Option<f64> {
    let apart_ms = RATE_INTERVAL_MIN.as_millis() as u64;
    let seconds = now.uptime_ms.checked_sub(before.uptime_ms).filter(|ms| *ms >= apart_ms)? as f64 / 1e3;
    let known = before.peers.iter().find(|known| known.node == peer.node)?;
    Some(peer.sent.packages.checked_sub(known.sent.packages)? as f64 / seconds)
}

/// Nodes and edges in one row: a row of an entity replaces the one before.
#[derive(Debug)]
struct Graph {
    nodes: GraphNodes,
    edges: GraphEdges,
}

impl AsComponents for Graph {
    fn as_serialized_batches(&self) -> Vec<SerializedComponentBatch> {
        [self.nodes.as_serialized_batches(), self.edges.as_serialized_batches()].concat()
    }
}

/// What stands at one place of the graph.
struct Point {
    id: String,
    at: [f32; 2],
    label: String,
    colour: palette::Rgb,
    radius: f32,
}

impl Network {
    fn graph(&self, installation: &Installation) -> Graph {
        let names: Vec<&str> = installation.nodes.iter().map(|node| node.name.as_str()).collect();
        let place = |name: &str| names.iter().position(|known| *known == name).map(|index| place(index, names.len()));
        let node = |name: &&str| Point {
            id: (*name).into(),
            at: place(name).unwrap_or_default(),
            label: (*name).into(),
            colour: NODE,
            radius: 10.0,
        };
        let mut points: Vec<Point> = names.iter().map(node).collect();
        let mut edges: Vec<(String, String)> = Vec::new();
        for (links, told) in self.last.values() {
            let is_old = told.elapsed() > OLD;
            for peer in &links.peers {
                let (Some(from), Some(to)) = (place(&links.node), place(&peer.node)) else { continue };
                let per_s = self.rates.get(&(links.node.clone(), peer.node.clone())).copied().unwrap_or(0.0);
                let id = format!("{} → {}", links.node, peer.node);
                edges.extend([(links.node.clone(), id.clone()), (id.clone(), peer.node.clone())]);
                let (label, colour) = match is_old {
                    true => (format!("{} tells no more", links.node), colour(LinkState::Unknown)),
                    false => (words(peer, per_s), colour(peer.state)),
                };
                points.push(Point { id, at: beside(from, to), label, colour, radius: 4.0 });
            }
        }
        let nodes = GraphNodes::new(points.iter().map(|point| point.id.as_str()))
            .with_positions(points.iter().map(|point| point.at))
            .with_labels(points.iter().map(|point| point.label.as_str()))
            .with_colors(points.iter().map(|point| point.colour))
            .with_radii(points.iter().map(|point| point.radius))
            .with_show_labels(true);
        Graph { nodes, edges: GraphEdges::new(edges).with_directed_edges() }
    }
}

/// The place of a node: the first on top, the others clockwise. Two stand side by side.
fn place(index: usize, count: usize) -> [f32; 2] {
    let first = if count == 2 { -TAU / 2.0 } else { -TAU / 4.0 };
    let (sin, cos) = (first + TAU * index as f32 / count.max(1) as f32).sin_cos();
    [RADIUS * cos, RADIUS * sin]
}

/// On the way from one place to another, nearer to the first, and to its left: so that both directions have room.
fn beside(from: [f32; 2], to: [f32; 2]) -> [f32; 2] {
    let way = [to[0] - from[0], to[1] - from[1]];
    let long = way[0].hypot(way[1]).max(1.0);
    let aside = [way[1] / long * ASIDE, -way[0] / long * ASIDE];
    [from[0] + way[0] * 0.42 + aside[0], from[1] + way[1] * 0.42 + aside[1]]
}

fn words(peer: &PeerLink, per_s: f64) -> String {
    let state = match peer.state {
        LinkState::Alive => "",
        LinkState::Unknown => "not heard yet, ",
        LinkState::Silent => "silent, ",
        LinkState::Unheard => "does not hear, ",
        LinkState::Refused => "refused, ",
    };
    format!("{state}{per_s:.0}/s, {} lost", peer.counters.missed)
}

fn colour(state: LinkState) -> palette::Rgb {
    match state {
        LinkState::Alive => [63, 167, 96],
        LinkState::Unknown => [107, 116, 128],
        LinkState::Silent => [214, 67, 78],
        LinkState::Unheard => [230, 160, 31],
        LinkState::Refused => [200, 120, 220],
    }
}

/// Clocks of nodes.
pub(crate) struct Clocks;

impl View for Clocks {
    fn wants(&self, _: &Description, item: &DataItem) -> bool {
        is::<ClockState>(item)
    }

    fn draw(&mut self, scene: &mut Scene, datum: &Datum<'_>) -> Result<(), DrawError> {
        let clock: ClockState = datum.read()?;
        let us = |ns: f64| ns / 1e3;
        if let Some(error_ns) = clock.error_ns {
            scene.curve(&["network", "clock", &clock.node], us(error_ns as f64));
        }
        scene.curve(&["network", "offset", &clock.node], us(clock.offset_ns as f64));
        if let Some(round_ns) = clock.round_trip_ns {
            scene.curve(&["network", "latency", &format!("wire, {}", clock.node)], us(round_ns as f64 / 2.0));
        }
        Ok(())
    }

    fn tabs(&self) -> Vec<Tab> {
        vec![tab()]
    }
}

impl Scene {
    /// A number of the chart that lies above it, named by its last part.
    pub(crate) fn curve(&mut self, parts: &[&str], number: f64) {
        self.log(entity(parts), &Scalars::single(number));
    }

    /// How long packages of a class waited, µs, 99th percentile: until their router took them, and until their
    /// receivers took them.
    pub(crate) fn hops(&mut self, class: &str, transit_us: Option<f64>, end_us: Option<f64>) {
        for (hop, us) in [("to router", transit_us), ("at its end", end_us)] {
            if let Some(us) = us {
                self.curve(&["network", "latency", &format!("{class} {hop}")], us);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost::interfaces::{Carried, LinkCounters};

    fn links(node: &str, peer: &str, uptime_ms: u64, packages: u64) -> Links {
        let sent = Carried { packages, datagrams: packages, bytes: 0, fragments: 0 };
        let received = Carried { packages: 0, datagrams: 0, bytes: 0, fragments: 0 };
        let peer = PeerLink {
            node: peer.into(),
            address: "127.0.0.1".into(),
            state: LinkState::Alive,
            why: String::new(),
            heard_ms: Some(1),
            sent,
            received,
            counters: LinkCounters { lost: 3, missed: 4, ..LinkCounters::default() },
        };
        Links {
            node: node.into(),
            digest: 0,
            uptime_ms,
            peers: vec![peer],
            waiting: Vec::new(),
            waiting_bytes: 0,
            classes: Vec::new(),
            foreign: 0,
            failures: Vec::new(),
            rejections: Vec::new(),
        }
    }

    #[test]
    fn rates_are_by_the_routers_own_time_and_begin_anew_with_it() {
        let (before, now) = (links("base", "arm", 1000, 10), links("base", "arm", 1500, 60));
        assert_eq!(sent_per_s(&before, &now, &now.peers[0]), Some(100.0));
        let soon = links("base", "arm", 1003, 60);
        assert_eq!(sent_per_s(&before, &soon, &soon.peers[0]), None, "in 3 ms these would be thousands a second");
        let anew = links("base", "arm", 200, 4);
        assert_eq!(sent_per_s(&now, &anew, &anew.peers[0]), None);
        assert_eq!(words(&now.peers[0], 100.0), "100/s, 4 lost", "as the receiver says");
    }

    #[test]
    fn a_late_report_is_drawn_when_the_other_was_and_a_new_time_is_followed() {
        const SECOND: u64 = 1_000_000_000;
        for (drawn_s, told_s, at_s, why) in [
            (10, 11, 11, "it goes on"),
            (10, 9, 10, "it came late"),
            (10, 6, 6, "no report is so late: time was set back"),
        ] {
            assert_eq!(onward(drawn_s * SECOND, told_s * SECOND), at_s * SECOND, "{why}");
        }
    }

    #[test]
    fn nodes_do_not_stand_on_each_other_and_directions_have_room() {
        for count in 2..=8 {
            let places: Vec<[f32; 2]> = (0..count).map(|index| place(index, count)).collect();
            for (a, from) in places.iter().enumerate() {
                for to in &places[..a] {
                    let apart = |a: [f32; 2], b: [f32; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
                    assert!(apart(*from, *to) > ASIDE, "{count}: {places:?}");
                    assert!(apart(beside(*from, *to), beside(*to, *from)) > ASIDE, "{count}: {places:?}");
                }
            }
        }
    }
}
