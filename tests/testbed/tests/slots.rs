//! Simulated latencies of declared flows never exceed the computed bounds: `ROHRPOST_SIM_SEEDS=1000` for more networks,
//! `ROHRPOST_SIM_SEED=n` to see one line by line.

mod simulated;

use rohrpost_config::{Flow, Installation, bounds};
use rohrpost_mailbox::Name;
use rohrpost_network::Bound;
use rohrpost_testbed::sim::calls::{Attempt, Guard, Ruling};
use rohrpost_testbed::sim::declared::PERIOD_MIN_PERCENT;
use rohrpost_testbed::sim::plan::Plan;
use rohrpost_testbed::sim::run::run;
use simulated::{for_all, number};
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;
use std::time::Duration;

/// Networks without being asked for more.
const SEEDS: u64 = 100;
/// Of these, those in which a broken analysis must show.
const BROKEN_SEEDS: u64 = 60;

/// Nobody calls.
struct NoCalls;

impl Guard for NoCalls {
    fn validate(&mut self, _: &Attempt, _: u64) -> Ruling {
        Ruling::Ignore
    }

    fn done(&mut self, _: &Attempt, _: u64, _: u32) {}
}

/// What the analysis does wrong.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Broken {
    /// No flow waits for another one.
    Alone,
    /// Nothing goes before a package of the same node but what is more important.
    ForgetsEqual,
    /// A slot is there in each cycle.
    ForgetsPeriods,
    /// Slots have no guard.
    ForgetsGuard,
    /// Packages are half as large.
    HalfAsLarge,
}

impl Broken {
    const ALL: [Self; 5] =
        [Self::Alone, Self::ForgetsEqual, Self::ForgetsPeriods, Self::ForgetsGuard, Self::HalfAsLarge];

    /// What an analysis that does so takes for the installation, when it looks at a flow.
    fn seen(self, installation: &Installation, flow: usize) -> Installation {
        let mut seen = installation.clone();
        let own = seen.flows[flow].clone();
        let Some(tdma) = &mut seen.tdma else { return seen };
        match self {
            Self::Alone => seen.flows = vec![own],
            Self::ForgetsEqual => seen.flows.retain(|other| *other == own || other.from.class() != own.from.class()),
            Self::ForgetsPeriods => tdma.slots.iter_mut().for_each(|slot| (slot.period, slot.phase) = (1, 0)),
            Self::ForgetsGuard => tdma.guard = Duration::ZERO,
            Self::HalfAsLarge => seen.flows.iter_mut().for_each(|flow| flow.size /= 2),
        }
        seen
    }
}

/// The installation that a plan runs, its declared flows first.
fn installation(plan: &Plan) -> Installation {
    let mut text = String::from(
        "installation = \"declared\"\n[system]\nname = \"robot\"\nid = 1\n[network]\nsecurity = \"none\"\n[classes]\n\
         router = { id = 250, text = \"Carries packages\" }\ntool = { id = 16, text = \"Programs run by hand\" }\n",
    );
    let classes: BTreeSet<u8> = plan.nodes.iter().flat_map(|node| &node.modules).map(|name| name.class().0).collect();
    for class in classes {
        writeln!(text, "c{class} = {{ id = {class}, text = \"Some module\" }}").expect("a string takes it");
    }
    let masters: Vec<_> = plan.masters.iter().map(|node| format!("\"n{node}\"")).collect();
    writeln!(text, "[time]\nsource = \"master\"\nmasters = [{}]", masters.join(", ")).expect("a string takes it");
    for node in 0..plan.nodes.len() {
        let tools = (16 * node, 16 * node + 15);
        writeln!(text, "[nodes.n{node}]\naddress = \"10.77.0.{}\"\ntools = [{}, {}]", node + 1, tools.0, tools.1)
            .expect("a string takes it");
    }
    for (node, its) in plan.nodes.iter().enumerate() {
        for module in &its.modules {
            let name = format!("c{}.{node}", module.class().0);
            writeln!(text, "[[module]]\nname = \"{name}\"\nnode = \"n{node}\"\nprogram = \"./it\"")
                .expect("a string takes it");
        }
    }
    let mut installation =
        Installation::parse(&text, Path::new("declared.toml")).unwrap_or_else(|errors| panic!("{errors}\n{text}"));
    installation.tdma = plan.slots.as_ref().map(|slots| slots.table.clone());
    if let Some(network) = &mut installation.network {
        network.datagram_bytes_max = plan.shape.datagram_bytes_max;
        network.bulk_below = plan.shape.bulk_below;
    }
    for flow in declared(plan) {
        let period = Duration::from_nanos(flow.period_ns * PERIOD_MIN_PERCENT / 100);
        let (from, to, size) = (flow.from.module(), flow.to.module(), flow.bytes.1 as u32);
        installation.flows.push(Flow { from, to, carries: None, size, period, deadline: period, line: 0 });
        // So its packages have the priority of the sender.
        let sender = installation.modules.iter_mut().find(|module| module.name == from);
        sender.expect("it is in the text").calls.push(to);
    }
    installation
}

fn declared(plan: &Plan) -> impl Iterator<Item = &rohrpost_testbed::sim::plan::Flow> {
    plan.flows.iter().filter(|flow| flow.burst == 1)
}

/// A flow, how long it took at most, and what was computed.
struct Compared {
    flow: (Name, Name),
    took: Duration,
    index: usize,
    bound: Option<Bound>,
}

/// Runs a network, and compares. What a link takes stands in place of what the analysis thinks of a switch.
fn compare(plan: &Plan) -> (Installation, Vec<Compared>) {
    let installation = installation(plan);
    let outcome = run(plan.clone(), |_| Box::new(NoCalls), false);
    assert!(outcome.problems.is_empty(), "seed {}: {:?}", plan.seed, outcome.problems[0]);
    let silent = declared(plan).zip(&outcome.slowest_ns).find(|(_, slowest_ns)| **slowest_ns == 0);
    assert!(silent.is_none(), "seed {}: nothing of {silent:?} was delivered", plan.seed);
    let link = Duration::from_nanos(plan.quality.delay_ns + plan.quality.jitter_ns);
    let bounds = bounds(&installation);
    let compared = declared(plan).zip(&outcome.slowest_ns).enumerate().map(|(index, (flow, took_ns))| Compared {
        flow: (flow.from, flow.to),
        took: Duration::from_nanos(*took_ns).saturating_sub(link),
        index,
        bound: bounds.iter().find(|bound| bound.flow == index).and_then(|bound| bound.latency.ok()),
    });
    let compared = compared.collect();
    (installation, compared)
}

fn without_switch(bound: &Bound) -> Duration {
    bound.latency - bound.forward
}

#[test]
fn no_declared_flow_is_later_than_its_bound() {
    if let Some(seed) = number("ROHRPOST_SIM_SEED") {
        let plan = Plan::declared(seed);
        eprintln!("{plan:#?}\n{:#?}", bounds(&installation(&plan)));
        run(plan, |_| Box::new(NoCalls), true).trace.iter().for_each(|line| eprintln!("{line}"));
    }
    let seeds = number("ROHRPOST_SIM_SEEDS").unwrap_or(SEEDS);
    let all = for_all(seeds, |seed| (seed, compare(&Plan::declared(seed)).1));
    let (mut late, mut shares) = (Vec::new(), Vec::new());
    for (seed, compared) in all.iter().flat_map(|(seed, compared)| compared.iter().map(move |flow| (seed, flow))) {
        let Some(bound) = &compared.bound else { continue };
        shares.push(compared.took.as_nanos() as f64 / without_switch(bound).as_nanos() as f64);
        if compared.took > without_switch(bound) {
            let (from, to) = compared.flow;
            late.push(format!("seed {seed}: {from} to {to} took {:?}, {bound:?}", compared.took));
        }
    }
    shares.sort_by(f64::total_cmp);
    let [median, many, most] = [50, 90, 100].map(|percent| shares[(shares.len() - 1) * percent / 100]);
    eprintln!("{} flows took {median:.2} of their bounds, one of ten {many:.2}, {most:.2} at most", shares.len());
    assert!(late.is_empty(), "{} flows were later than computed:\n{}", late.len(), late.join("\n"));
    assert!(many > 2.0 / 3.0, "bounds that are never nearly reached say little");
}

#[test]
fn every_mistake_of_an_analysis_is_noticed() {
    let all = for_all(BROKEN_SEEDS, |seed| (seed, compare(&Plan::declared(seed))));
    let notices = |broken: Broken| {
        all.iter().find_map(|(seed, (installation, compared))| {
            let is_late = |flow: &&Compared| {
                let seen = broken.seen(installation, flow.index);
                let index = seen.flows.iter().position(|other| *other == installation.flows[flow.index]);
                let bound = bounds(&seen).into_iter().find(|bound| Some(bound.flow) == index.or(Some(flow.index)));
                bound.and_then(|bound| bound.latency.ok()).is_some_and(|bound| flow.took > without_switch(&bound))
            };
            compared.iter().find(is_late).map(|_| *seed)
        })
    };
    let found = Broken::ALL.map(|broken| (broken, notices(broken)));
    eprintln!("{found:?}");
    let missed: Vec<_> = found.iter().filter(|(_, seed)| seed.is_none()).collect();
    assert!(missed.is_empty(), "went unnoticed in {BROKEN_SEEDS} networks: {missed:?}");
}
