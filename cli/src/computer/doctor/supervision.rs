//! What keeps the wormholes of a configuration from their work, on this computer and as they run here.

use super::finding::{Check, Finding};
use super::machine::{Machine, Needs, Supervisor};
use crate::look::control::{STATE, holders};
use rohrpost::ToolLink;
use rohrpost::interfaces::{ControlMode, SupervisorInterface};
use rohrpost::wire::from_bytes;
use rohrpost_config::{Installation, Node as NodeConfig, Program, Scheduling};
use rohrpost_mailbox::{Node, node_directory};
use std::time::Duration;

const CHECK: Check = Check(
    "supervision",
    "a wormhole that wakes up later than `late-ms` has less room to brake than it counts on; without sight, or while \
     it is held, nobody drives",
);
/// For the answer of one that runs.
const PATIENCE: Duration = Duration::from_secs(1);

/// The wormholes of a node.
pub(super) fn supervisors(installation: &Installation, node: &NodeConfig) -> Vec<Supervisor> {
    let is_wormhole = |program: &Program| matches!(program, Program::Builtin(name) if name == "wormhole");
    let all: Vec<_> = installation.modules_on(&node.name).filter(|module| is_wormhole(&module.program)).collect();
    let runs = (!all.is_empty()).then(|| Node::open(&node_directory(&installation.name, &node.name)).ok()).flatten();
    let mut tool = runs.and_then(|runs| ToolLink::join(installation, &runs, &node.name, PATIENCE).ok());
    let told = all.into_iter().map(|module| Supervisor {
        module: installation.classes.format(module.name),
        fifo: match installation.scheduling(module.name.class()) {
            Scheduling::Fifo { priority } => Some(priority),
            Scheduling::Normal { .. } => None,
        },
        says: tool.as_mut().map(|tool| {
            let said =
                tool.call(module.name, STATE, SupervisorInterface::hash(), |_| Ok(()), |bytes| from_bytes(bytes));
            said.map_err(|error| error.to_string())
        }),
    });
    let told = told.collect();
    if let Some(tool) = tool {
        tool.close();
    }
    told
}

pub(super) fn findings(machine: &Machine, needs: &Needs) -> Vec<Finding> {
    needs.supervisors.iter().map(|supervisor| of_one(machine, supervisor)).collect()
}

/// The worst that there is to say of one.
fn of_one(machine: &Machine, Supervisor { module, fifo, says }: &Supervisor) -> Finding {
    let Some(fifo) = fifo else {
        let fix = format!("give the class of {module} an id of 128 or more in [classes]");
        return CHECK.warn(format!("{module} runs under the normal scheduler; a busy computer makes it late"), fix);
    };
    if machine.asked.fifo.is_err() {
        let fix = "the fix of `real time`, above";
        return CHECK.warn(format!("{module} asks for SCHED_FIFO {fifo}, and is refused: it may be late"), fix);
    }
    let state = match says {
        None => return CHECK.ok(format!("{module} gets SCHED_FIFO {fifo}; it does not run now")),
        Some(Err(why)) => {
            return CHECK.bad(format!("{module} does not answer: {why}"), format!("rohrpost start {module}"));
        }
        Some(Ok(state)) => state,
    };
    if state.mode == ControlMode::Failed {
        let fix = format!("rohrpost log {}; then rohrpost call {module} reset", state.driven_by);
        return CHECK.warn(format!("{module}: {} failed too often, and nobody drives", state.driven_by), fix);
    }
    if state.held_unnamed || !state.halts.is_empty() {
        let by = holders(&state.halts, state.held_unnamed);
        return CHECK.warn(format!("{module} holds the robot, by order of {by}"), "rohrpost resume");
    }
    if !state.sees {
        let fix = format!("rohrpost hz of the scanner that `laser` of {module} names");
        return CHECK.warn(format!("{module} has no scan that it can believe"), fix);
    }
    if state.late_looks > 0 {
        let fix = format!("raise `late-ms` of {module}, or end what delays it (rohrpost doctor --measure)");
        return CHECK.warn(format!("{module} has looked late {} times", state.late_looks), fix);
    }
    CHECK.ok(format!("{module} runs with SCHED_FIFO {fifo}, and was never late"))
}
