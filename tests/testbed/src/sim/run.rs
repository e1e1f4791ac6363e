//! One seed, from its plan to its verdict.

use super::calls::NewGuard;
use super::lease_plan::LeasePlan;
use super::packages::{Free, Packages, settings};
use super::plan::{Flow, Plan, incarnation};
use super::promise::Problem;
use super::replicas::{FreeReplicas, Replicas, Rings};
use super::seals;
use super::slotted::Slotted;
use super::station::Layer;
use super::ticking::{self, Ticking};
use super::world::{NewLayers, World};
use rohrpost_routers::tdma::SlotTable;
use std::collections::BTreeMap;
use std::rc::Rc;

/// What became of a seed.
#[derive(Debug, Default)]
pub struct Outcome {
    /// Promises that were broken; the first ends the run.
    pub problems: Vec<Problem>,
    /// What was seen, and how often.
    pub seen: BTreeMap<&'static str, u64>,
    /// From posting to delivery at most, ns, of each flow of the plan.
    pub slowest_ns: Vec<u64>,
    /// Lines, if they were asked for.
    pub trace: Vec<String>,
}

/// Runs a plan.
pub fn run(mut plan: Plan, guard: NewGuard, trace: bool) -> Outcome {
    plan.leases.iter_mut().for_each(LeasePlan::begin);
    let plan = Rc::new(plan);
    let rings = Rc::new(Rings::new(&plan));
    let layers = routers(&plan, &rings);
    let mut world = World::new(plan.clone(), guard, &rings, layers, trace);
    world.run();
    let oracle = world.oracle;
    let slowest =
        |flow: &Flow| oracle.slowest_ns.get(&(flow.from, flow.to, flow.priority)).copied().unwrap_or_default();
    let slowest_ns = plan.flows.iter().map(slowest).collect();
    Outcome { problems: oracle.problems, seen: oracle.seen, slowest_ns, trace: world.trace.lines }
}

/// Routers as this version has them.
fn routers(plan: &Rc<Plan>, rings: &Rc<Rings>) -> NewLayers<'static> {
    let (plan, rings) = (plan.clone(), rings.clone());
    Box::new(move |node, edition, life, now, page| {
        let incarnation = incarnation(plan.seed, life);
        let settings = settings(&plan, node, incarnation, edition);
        let mut packages = Packages::new(&settings, now.monotonic_ns);
        let mut ticking =
            Ticking::new(ticking::settings(&plan, node, incarnation, edition), now, page, plan.has_stamps);
        if plan.sealed {
            let all = seals::peer_sessions(&settings);
            (packages, ticking) = (packages.sealed(&all, incarnation), ticking.sealed(&all, plan.slots.is_some()));
        }
        let has_streams = !plan.streams.is_empty();
        let replicas =
            has_streams.then(|| Replicas::new((&settings, packages.all_stats()), &rings, packages.peer_sessions()));
        if let Some(slots) = plan.slots_of(edition) {
            let (own, nodes) = (settings.own, plan.nodes.len() as u8);
            let table = SlotTable::new(&slots.table, &slots.masters, own, nodes, settings.overhead_bytes());
            return vec![Box::new(Slotted::new((packages, ticking, replicas), &settings, table, now))];
        }
        let replicas = replicas.map(|replicas| Box::new(FreeReplicas::new(replicas, &settings)) as Box<dyn Layer>);
        let layers = [Box::new(Free::new(packages, &settings)) as Box<dyn Layer>, Box::new(ticking)];
        layers.into_iter().chain(replicas).collect()
    })
}
