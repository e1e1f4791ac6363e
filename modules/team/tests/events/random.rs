//! Random trees beside the naive interpreter, and cycles beside a search that is obviously right.

use crate::naive::{Naive, Run};
use crate::spec::{NodeSpec, Spec, Wish, wishes};
use proptest::collection::vec;
use proptest::prelude::*;
use rohrpost_team::RobotId;
use rohrpost_team::events::{
    Cycle, EventHead, EventType, Flow, GroupId, LossCause, Plan, PlanError, Priority, ROOT, Refused, Tree, Turn,
};
use std::collections::BTreeSet;
use std::rc::Rc;

fn cases() -> ProptestConfig {
    let cases = std::env::var("ROHRPOST_EVENT_CASES").ok().map_or(500, |text| text.parse().unwrap());
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

const TYPES: usize = 5;

fn bits(bits: u8) -> Vec<usize> {
    (0..TYPES).filter(|it| bits >> it & 1 == 1).collect()
}

/// Without cycles, types rise from what a leaf consumes to what it produces.
fn spec() -> impl Strategy<Value = Spec> {
    let priority = prop::sample::select(Priority::ALL.to_vec());
    let node = (any::<bool>(), any::<u16>(), 0..32_u8, 0..32_u8, 0..32_u8, 0..32_u8, 1..6_u8);
    (vec((priority, 1..5_u16), TYPES), vec(node, 1..12), 0..4_u8).prop_map(|(types, raw, kind)| {
        let mut groups = 1;
        let node = |(is_leaf, parents, consumes, emits, sends, cycles, depth): (bool, u16, _, _, _, _, _)| {
            let mut below: Vec<usize> = (0..groups).filter(|it| parents >> it & 1 == 1).collect();
            if below.is_empty() {
                below.push(usize::from(parents) % groups);
            }
            groups += usize::from(!is_leaf);
            let consumes = bits(consumes);
            let above = consumes.last().copied().filter(|_| kind > 0);
            let rising = |it: &usize| above.is_none_or(|above| *it > above);
            let emits: Vec<usize> = bits(emits).into_iter().filter(rising).collect();
            let sends: Vec<usize> = bits(sends).into_iter().filter(rising).collect();
            let may = |it: &usize| (emits.contains(it) || sends.contains(it)) && kind % 2 == 0;
            let cycles = bits(cycles).into_iter().filter(may).map(|it| (it, depth)).collect();
            NodeSpec { is_leaf, parents: below, consumes, emits, sends, cycles }
        };
        Spec { types, nodes: raw.into_iter().map(node).collect() }
    })
}

fn leaked(text: String) -> &'static str {
    Box::leak(text.into_boxed_str())
}

struct Built {
    tree: Tree<Vec<Run>, u64>,
    types: Vec<EventType>,
    groups: Vec<GroupId>,
}

fn build(spec: &Spec) -> Result<Built, PlanError> {
    let shared = Rc::new(spec.clone());
    let mut plan = Plan::new();
    let types =
        (0..).zip(&spec.types).map(|(at, (priority, room))| plan.event(leaked(format!("t{at}")), *priority, *room));
    let types: Vec<EventType> = types.collect();
    let (mut groups, mut leaves) = (vec![ROOT], 0);
    // A leaf may switch groups that come after it.
    let all: Rc<std::cell::RefCell<Vec<GroupId>>> = Rc::default();
    for node in &spec.nodes {
        let parents: Vec<GroupId> = node.parents.iter().map(|it| groups[*it]).collect();
        if !node.is_leaf {
            groups.push(plan.group(leaked(format!("g{}", groups.len())), &parents));
            continue;
        }
        let set = |numbers: &[usize]| numbers.iter().map(|it| types[*it]).collect::<Vec<_>>();
        let (consumes, emits, sends) = (set(&node.consumes), set(&node.emits), set(&node.sends));
        let cycles: Vec<_> = node.cycles.iter().map(|(it, depth)| (types[*it], *depth)).collect();
        let flow = Flow { consumes: &consumes, emits: &emits, sends: &sends, cycles: &cycles };
        let (spec, number, types, all) = (shared.clone(), leaves, types.clone(), all.clone());
        let action = move |runs: &mut Vec<Run>, payload: &u64, turn: &mut Turn<'_, u64>| {
            runs.push((number, turn.event_type.number().into(), turn.depth, turn.from.is_some(), *payload));
            for wish in wishes(&spec, number, *payload) {
                match wish {
                    Wish::Emit(it, payload) => _ = turn.emit(types[it], payload),
                    Wish::Send(it, payload) => _ = turn.send(types[it], payload),
                    Wish::Switch(group, is_on) => turn.switch(all.borrow()[group], is_on),
                }
            }
        };
        plan.leaf(leaked(format!("l{number}")), &parents, flow, action);
        leaves += 1;
    }
    all.borrow_mut().clone_from(&groups);
    Ok(Built { tree: plan.build()?, types, groups })
}

/// Both do the same with the same events.
fn compare(spec: &Spec, built: &mut Built, script: &[(u8, u16, u64)]) {
    let mut naive = Naive::new(spec);
    let (senders, mut runs) = (naive.senders(), Vec::new());
    let tree = &mut built.tree;
    let from = RobotId::new(9).unwrap();
    for (what, number, payload) in script {
        match what {
            0..3 => {
                let it = usize::from(*number) % TYPES;
                assert_eq!(tree.hard(built.types[it], *payload), naive.hard(it, *payload));
            }
            3..5 if !senders.is_empty() => {
                let (path, it) = senders[usize::from(*number) % senders.len()];
                let (depth, event_type) = (1 + (payload % 5) as u8, it as u8);
                let head = EventHead { from, depth, event_type, path, tree: tree.digest() };
                assert_eq!(tree.hear(&head, *payload), Ok(naive.hear(path, it, depth, *payload)));
            }
            5 => {
                let (group, is_on) = (usize::from(*number) % spec.groups(), payload % 3 > 0);
                tree.switch(built.groups[group], is_on);
                naive.is_on[group] = is_on;
            }
            6 => assert_eq!(sent(tree), naive.take_sent()),
            _ => assert_eq!(tree.dispatch(0, &mut runs), naive.dispatch()),
        }
    }
    for _ in 0..300 {
        assert_eq!(tree.dispatch(0, &mut runs), naive.dispatch());
        assert_eq!(sent(tree), naive.take_sent());
    }
    assert_eq!(runs, naive.runs);
    for (it, event_type) in built.types.iter().enumerate() {
        for cause in LossCause::ALL {
            let lost = naive.losses.get(&(it, cause as usize)).copied().unwrap_or(0);
            assert_eq!(tree.lost(*event_type, cause), lost, "{it} {cause:?}");
        }
    }
    assert!((0..spec.groups()).all(|it| tree.is_on(built.groups[it]) == naive.is_on[it]));
    refused(tree, &senders, naive.walk().len() as u16);
}

fn sent(tree: &mut Tree<Vec<Run>, u64>) -> Option<(u16, usize, u8, u64)> {
    let (head, payload) = tree.take_sent(RobotId::new(1).unwrap())?;
    assert_eq!(EventHead::decode(&head.encode()), Ok((head, &[][..])));
    Some((head.path, head.event_type.into(), head.depth, payload))
}

/// What no leaf sends does not enter.
fn refused(tree: &mut Tree<Vec<Run>, u64>, senders: &[(u16, usize)], steps: u16) {
    let (from, own) = (RobotId::new(9).unwrap(), tree.digest());
    let before = tree.refused();
    let mut count = 0;
    for (path, event_type) in (0..steps + 2).flat_map(|path| (0..=TYPES as u8).map(move |it| (path, it))) {
        let head = EventHead { from, depth: 1, event_type, path, tree: own };
        if !senders.contains(&(path, event_type.into())) {
            assert_eq!(tree.hear(&head, 0), Err(Refused::NotSent { from, path, event_type }));
            let other = EventHead { tree: !own, ..head };
            assert_eq!(tree.hear(&other, 0), Err(Refused::OtherTree { from, theirs: !own, own }));
            count += 2;
        }
    }
    assert_eq!(tree.refused() - before, count);
}

type Link = (&'static str, &'static str, bool);

/// All links that are on a cycle, by the closure of a relation between leaves below parents.
fn links_on_cycles(spec: &Spec) -> BTreeSet<(String, String, bool)> {
    let naive = Naive::new(spec);
    let groups: Vec<&NodeSpec> = spec.nodes.iter().filter(|node| !node.is_leaf).collect();
    let is_below = |group: usize, above: usize| {
        naive.walk().iter().flatten().any(|path| path.last() == Some(&group) && path.contains(&above))
    };
    let leaves = spec.nodes.iter().filter(|node| node.is_leaf).enumerate();
    let seats: Vec<_> = leaves.flat_map(|(at, leaf)| leaf.parents.iter().map(move |it| (at, leaf, *it))).collect();
    let mut links = Vec::new();
    for (from, (_, leaf, parent)) in seats.iter().enumerate() {
        for (to, (_, other, group)) in seats.iter().enumerate().filter(|(_, it)| is_below(it.2, *parent)) {
            assert!(*group <= groups.len());
            for it in other.consumes.iter().filter(|it| leaf.cycles.iter().all(|(exempt, _)| exempt != *it)) {
                links.extend(leaf.emits.contains(it).then_some((from, to, *it, false)));
                links.extend(leaf.sends.contains(it).then_some((from, to, *it, true)));
            }
        }
    }
    let mut reach = vec![vec![false; seats.len()]; seats.len()];
    links.iter().for_each(|(from, to, ..)| reach[*from][*to] = true);
    for middle in 0..seats.len() {
        for from in 0..seats.len() {
            for to in 0..seats.len() {
                reach[from][to] |= reach[from][middle] && reach[middle][to];
            }
        }
    }
    let on = links.iter().filter(|(from, to, ..)| reach[*to][*from] || from == to);
    on.map(|(from, _, it, is_sent)| (format!("l{}", seats[*from].0), format!("t{it}"), *is_sent)).collect()
}

fn named(cycles: &[Cycle]) -> BTreeSet<(String, String, bool)> {
    let link = |(leaf, event, is_sent): Link| (leaf.to_owned(), event.to_owned(), is_sent);
    cycles.iter().flat_map(|it| &it.0).map(|it| link((it.leaf, it.event, it.is_sent))).collect()
}

proptest! {
    #![proptest_config(cases())]

    #[test]
    fn a_random_tree_does_what_the_naive_interpreter_does(
        spec in spec(), script in vec((0..12_u8, any::<u16>(), any::<u64>()), 1..120)
    ) {
        let links = links_on_cycles(&spec);
        match build(&spec) {
            Ok(mut built) => {
                prop_assert!(links.is_empty(), "{links:?} were not refused");
                compare(&spec, &mut built, &script);
            }
            Err(PlanError::Cycles(cycles)) => prop_assert_eq!(named(&cycles), links),
            Err(other) => prop_assert!(false, "{other}"),
        }
    }
}
