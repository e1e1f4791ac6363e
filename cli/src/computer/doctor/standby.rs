//! What keeps a node from running its modules with several nodes, or from standing by for them.

use super::finding::{Check, Finding};
use super::machine::{Needs, Seat};
use rohrpost_config::{HOLDERS_FILE, Installation, Node as NodeConfig, holders};
use rohrpost_launch::survey::{Scope, Standing, Survey};
use rohrpost_mailbox::{Node, node_directory};

const CHECK: Check = Check(
    "standby",
    "a module with several nodes goes on when one of them dies, if another one stands by, and the node that grants its \
     lease is reached",
);

/// Those of a node.
pub(super) fn seats(installation: &Installation, node: &NodeConfig) -> Vec<Seat> {
    let all: Vec<_> = installation.modules_for(&node.name).filter(|module| module.has_standby()).collect();
    let runs = (!all.is_empty()).then(|| Node::open(&node_directory(&installation.name, &node.name)).ok()).flatten();
    let runs = runs.filter(|runs| runs.launcher().is_some());
    let survey = runs.as_ref().and_then(|runs| Survey::within(Scope::Modules, runs, installation, &node.name).ok());
    let told = runs.and_then(|runs| runs.read_file(HOLDERS_FILE).ok().flatten()).unwrap_or_default();
    let told = String::from_utf8_lossy(&told);
    let seat = |module: &rohrpost_config::Module| {
        let place = holders(&told).filter(|(name, _)| *name == module.name).map(|(_, place)| usize::from(place)).last();
        let holder = place.and_then(|place| installation.lan_nodes().get(place)).map(|holder| holder.name.clone());
        let here = survey.as_ref().and_then(|survey| survey.module(module.name));
        Seat {
            module: installation.classes.format(module.name),
            node: node.name.clone(),
            witness: installation.witness_of(module).unwrap_or_default().into(),
            holder,
            here: here.map(|here| (here.standing(), here.last_error(installation))),
        }
    };
    all.into_iter().map(seat).collect()
}

pub(super) fn findings(needs: &Needs) -> Vec<Finding> {
    needs.seats.iter().map(of_one).collect()
}

fn of_one(Seat { module, node, witness, holder, here }: &Seat) -> Finding {
    let start = || format!("rohrpost start {module} --node {node}");
    match (here, holder) {
        (None, _) => CHECK.ok(format!("{module} may run on {node}, which does not run now")),
        (Some((Standing::Failed, why)), _) => CHECK.bad(format!("{module} cannot run on {node}: {why}"), start()),
        (Some((Standing::Stopped, _)), _) => {
            CHECK.warn(format!("{module} is stopped on {node}, which does not stand by for it"), start())
        }
        (Some((Standing::StandsBy, _)), None) => CHECK.bad(
            format!("{module} stands by on {node}, and no node is known to hold its lease: {witness} does not answer"),
            format!("rohrpost launch FILE --node {witness}, there; rohrpost net shows whether it is reached"),
        ),
        (Some((Standing::StandsBy, _)), Some(holder)) => {
            CHECK.ok(format!("{module} runs on {holder}, and {node} stands by"))
        }
        (Some((standing, why)), _) if !standing.answers() => {
            CHECK.warn(format!("{module} is {standing} on {node}: {why}"), format!("rohrpost log {module}"))
        }
        (Some((standing, _)), _) => CHECK.ok(format!("{module} is {standing} on {node}")),
    }
}
