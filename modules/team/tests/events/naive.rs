//! An interpreter of trees that is obviously right, and slow: one list of events, paths as lists of groups, recursion.

use crate::spec::{NodeSpec, Spec, Wish, wishes};
use rohrpost_team::events::{LossCause, Priority};
use std::collections::BTreeMap;

/// A run of a leaf: leaf, type, depth, whether a teammate's, payload.
pub(crate) type Run = (usize, usize, u8, bool, u64);

#[derive(Clone)]
struct Event {
    event_type: usize,
    path: Vec<usize>,
    depth: u8,
    is_heard: bool,
    payload: u64,
}

pub(crate) struct Naive<'a> {
    spec: &'a Spec,
    pub(crate) is_on: Vec<bool>,
    waiting: Vec<Event>,
    outbox: Vec<Event>,
    turns: u32,
    pub(crate) runs: Vec<Run>,
    pub(crate) losses: BTreeMap<(usize, LossCauseKey), u64>,
}

pub(crate) type LossCauseKey = usize;

impl<'a> Naive<'a> {
    pub(crate) fn new(spec: &'a Spec) -> Self {
        let is_on = vec![true; spec.groups()];
        let (waiting, outbox, runs, losses) = (Vec::new(), Vec::new(), Vec::new(), BTreeMap::new());
        Self { spec, is_on, waiting, outbox, turns: 0, runs, losses }
    }

    /// Children of a group, by number: groups and leaves.
    fn children(&self, group: usize) -> Vec<(usize, &'a NodeSpec)> {
        let (mut groups, mut leaves, mut children) = (0, 0, Vec::new());
        for node in &self.spec.nodes {
            let number = if node.is_leaf { &mut leaves } else { &mut groups };
            *number += 1;
            if node.parents.contains(&group) {
                children.push((if node.is_leaf { *number - 1 } else { *number }, node));
            }
        }
        children
    }

    /// Ways to all groups and leaves, in the order of the walk; a leaf's has no name.
    pub(crate) fn walk(&self) -> Vec<Option<Vec<usize>>> {
        let mut walk = Vec::new();
        self.walk_from(vec![0], &mut walk);
        walk
    }

    fn walk_from(&self, path: Vec<usize>, walk: &mut Vec<Option<Vec<usize>>>) {
        walk.push(Some(path.clone()));
        for (number, node) in self.children(*path.last().unwrap()) {
            if node.is_leaf {
                walk.push(None);
            } else {
                self.walk_from([&path[..], &[number]].concat(), walk);
            }
        }
    }

    fn step_of(&self, path: &[usize]) -> u16 {
        self.walk().iter().position(|it| it.as_deref() == Some(path)).unwrap() as u16
    }

    /// Steps at which a teammate's leaf sends a type.
    pub(crate) fn senders(&self) -> Vec<(u16, usize)> {
        let paths = self.walk().into_iter().flatten();
        let of = |path: Vec<usize>| {
            let leaves = self.children(*path.last().unwrap()).into_iter().filter(|(_, node)| node.is_leaf);
            let types: Vec<usize> = leaves.flat_map(|(_, node)| node.sends.clone()).collect();
            let step = self.step_of(&path);
            types.into_iter().map(move |it| (step, it)).collect::<Vec<_>>()
        };
        paths.flat_map(of).collect()
    }

    fn lose(&mut self, event_type: usize, cause: LossCause) -> bool {
        *self.losses.entry((event_type, cause as usize)).or_default() += 1;
        false
    }

    fn push(&mut self, event: Event) -> bool {
        let is_alike = |it: &&Event| it.event_type == event.event_type && it.is_heard == event.is_heard;
        if self.waiting.iter().filter(is_alike).count() >= self.spec.types[event.event_type].1.into() {
            return self.lose(event.event_type, LossCause::QueueFull);
        }
        self.waiting.push(event);
        true
    }

    pub(crate) fn hard(&mut self, event_type: usize, payload: u64) -> bool {
        self.push(Event { event_type, path: vec![0], depth: 0, is_heard: false, payload })
    }

    pub(crate) fn hear(&mut self, step: u16, event_type: usize, depth: u8, payload: u64) -> bool {
        let path = self.walk()[usize::from(step)].clone().unwrap();
        self.push(Event { event_type, path, depth, is_heard: true, payload })
    }

    pub(crate) fn take_sent(&mut self) -> Option<(u16, usize, u8, u64)> {
        if self.outbox.is_empty() {
            return None;
        }
        let event = self.outbox.remove(0);
        Some((self.step_of(&event.path), event.event_type, event.depth, event.payload))
    }

    pub(crate) fn dispatch(&mut self) -> bool {
        let order = match self.turns % 8 {
            3 => [Priority::Normal, Priority::High, Priority::Low],
            7 => [Priority::Low, Priority::High, Priority::Normal],
            _ => [Priority::High, Priority::Normal, Priority::Low],
        };
        let of = |event: &Event| if event.is_heard { Priority::Low } else { self.spec.types[event.event_type].0 };
        let next = order.into_iter().find_map(|class| self.waiting.iter().position(|event| of(event) == class));
        let Some(next) = next else { return false };
        self.turns += 1;
        let event = self.waiting.remove(next);
        if event.path.iter().any(|group| !self.is_on[*group]) {
            self.lose(event.event_type, LossCause::BranchOff);
        } else {
            self.visit(event.path.clone(), &event, &mut Vec::new());
        }
        true
    }

    fn visit(&mut self, path: Vec<usize>, event: &Event, visited: &mut Vec<usize>) {
        if !self.is_on[*path.last().unwrap()] {
            return;
        }
        for (number, node) in self.children(*path.last().unwrap()) {
            if !node.is_leaf {
                self.visit([&path[..], &[number]].concat(), event, visited);
            } else if node.consumes.contains(&event.event_type) && !visited.contains(&number) {
                visited.push(number);
                self.run(number, node, &path, event);
            }
        }
    }

    fn run(&mut self, leaf: usize, node: &NodeSpec, path: &[usize], event: &Event) {
        self.runs.push((leaf, event.event_type, event.depth, event.is_heard, event.payload));
        for wish in wishes(self.spec, leaf, event.payload) {
            let (event_type, payload, is_sent) = match wish {
                Wish::Switch(group, is_on) => {
                    self.is_on[group] = is_on;
                    continue;
                }
                Wish::Emit(event_type, payload) => (event_type, payload, false),
                Wish::Send(event_type, payload) => (event_type, payload, true),
            };
            let declared = if is_sent { &node.sends } else { &node.emits };
            let limit =
                node.cycles.iter().find(|(it, _)| *it == event_type).map_or(255, |(_, limit)| u32::from(*limit));
            let new =
                Event { event_type, path: path.to_vec(), depth: event.depth.wrapping_add(1), is_heard: false, payload };
            if !declared.contains(&event_type) {
                self.lose(event_type, LossCause::Undeclared);
            } else if u32::from(event.depth) + 1 > limit {
                self.lose(event_type, LossCause::TooDeep);
            } else if !is_sent {
                self.push(new);
            } else if self.outbox.iter().filter(|it| it.event_type == event_type).count()
                >= self.spec.types[event_type].1.into()
            {
                self.lose(event_type, LossCause::OutboxFull);
            } else {
                self.outbox.push(new);
            }
        }
    }
}
