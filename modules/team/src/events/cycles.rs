//! Chains of events that come back to where they began, found before anything runs.
//!
//! A *seat* is a leaf below one of its parents: what it produces there starts at this parent. An edge leads from a seat
//! to each seat that this reaches and that consumes it; on teammates the tree is the same, so their seats are, too.
//! Groups that are off are taken for on: the tree stays without cycles whatever is switched.

use super::names::{EventType, GROUPS_MAX, GroupId, LeafId, TypeSet};
use super::shape::{Node, Shape};
use std::collections::{BTreeSet, VecDeque};
use std::fmt;

/// One event of a cycle.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct CycleLink {
    /// The leaf that produces it.
    pub leaf: &'static str,
    /// Type of the event.
    pub event: &'static str,
    /// Whether it goes to teammates.
    pub is_sent: bool,
}

/// Leaves of which each causes the next one to run, and the last the first.
///
/// Begins with the least link, so that equal cycles are equal.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct Cycle(pub Vec<CycleLink>);

impl Cycle {
    fn new(mut links: Vec<CycleLink>) -> Self {
        let least = (0..links.len()).min_by_key(|at| [&links[*at..], &links[..*at]].concat()).unwrap_or(0);
        links.rotate_left(least);
        Self(links)
    }
}

impl fmt::Display for Cycle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for CycleLink { leaf, event, is_sent } in &self.0 {
            let way = if *is_sent { " to teammates" } else { "" };
            write!(f, "`{leaf}` -- {event}{way} --> ")?;
        }
        write!(f, "`{}`", self.0.first().map_or("", |link| link.leaf))
    }
}

struct Edge {
    from: usize,
    to: usize,
    event_type: EventType,
    is_sent: bool,
}

/// A shortest cycle through each edge that is on any: so each mistake is in one of them. Exceptions are no edges.
pub(super) fn find(shape: &Shape) -> Vec<Cycle> {
    let seats = seats(shape);
    let edges = edges(shape, &seats);
    let mut from_seat = vec![Vec::new(); seats.len()];
    edges.iter().enumerate().for_each(|(at, edge)| from_seat[edge.from].push(at));
    let link = |at: usize| CycleLink {
        leaf: shape.leaf(seats[edges[at].from].1).name,
        event: shape.types[usize::from(edges[at].event_type.0)].name,
        is_sent: edges[at].is_sent,
    };
    let mut cycles = BTreeSet::new();
    for start in 0..seats.len() {
        let ways = ways_from(start, &edges, &from_seat);
        for (at, last) in edges.iter().enumerate().filter(|(_, edge)| edge.to == start) {
            let mut links = vec![link(at)];
            let mut seat = last.from;
            while let Some(way) = ways[seat] {
                links.push(link(way));
                seat = edges[way].from;
            }
            if seat == start {
                links.reverse();
                cycles.insert(Cycle::new(links));
            }
        }
    }
    cycles.into_iter().collect()
}

/// The edge by which each seat is reached first from this one; none to this one itself.
fn ways_from(start: usize, edges: &[Edge], from_seat: &[Vec<usize>]) -> Vec<Option<usize>> {
    let mut ways = vec![None; from_seat.len()];
    let mut todo = VecDeque::from([start]);
    while let Some(seat) = todo.pop_front() {
        for at in &from_seat[seat] {
            let to = edges[*at].to;
            if to != start && ways[to].is_none() {
                ways[to] = Some(*at);
                todo.push_back(to);
            }
        }
    }
    ways
}

fn seats(shape: &Shape) -> Vec<(GroupId, LeafId)> {
    let groups = (0..shape.groups.len() as u8).map(GroupId);
    let leaf = |node: &Node| if let Node::Leaf(leaf) = node { Some(*leaf) } else { None };
    groups.flat_map(|group| shape.children(group).iter().filter_map(leaf).map(move |it| (group, it))).collect()
}

fn edges(shape: &Shape, seats: &[(GroupId, LeafId)]) -> Vec<Edge> {
    let below: Vec<u64> = (0..shape.groups.len() as u8).map(|it| groups_below(shape, GroupId(it))).collect();
    let mut edges = Vec::new();
    for (from, (parent, leaf)) in seats.iter().enumerate() {
        let leaf = shape.leaf(*leaf);
        let exempt: TypeSet = leaf.cycles.iter().map(|(it, _)| *it).collect();
        for (to, (group, consumer)) in seats.iter().enumerate() {
            if below[usize::from(parent.0)] >> group.0 & 1 == 0 {
                continue;
            }
            for (types, is_sent) in [(leaf.emits, false), (leaf.sends, true)] {
                let takes = shape.leaf(*consumer).consumes;
                let passed = types.iter().filter(|it| takes.contains(*it) && !exempt.contains(*it));
                edges.extend(passed.map(|event_type| Edge { from, to, event_type, is_sent }));
            }
        }
    }
    edges
}

/// The group and all below it, a bit for each.
fn groups_below(shape: &Shape, group: GroupId) -> u64 {
    let mut found = 0_u64;
    let mut todo = vec![group];
    while let Some(group) = todo.pop() {
        if found >> group.0 & 1 == 0 {
            found |= 1 << group.0;
            let below = shape.children(group).iter();
            todo.extend(below.filter_map(|node| if let Node::Group(it) = node { Some(*it) } else { None }));
        }
    }
    found
}

const _: () = assert!(GROUPS_MAX <= 64, "a bit for each group");
