//! What a node does, as text: modules, and traffic by class.

use super::table::{table, table_of, time};
use rohrpost::config::Installation;
use rohrpost::launch::Phase;
use rohrpost::mailbox::sys::Scheduling;
use rohrpost::mailbox::{ClassTraffic, Loss, ModuleState, saturating_sum};
use rohrpost::survey::{ModuleSurvey, Survey};
use rohrpost::{Class, Name};
use serde::Serialize;
use std::collections::BTreeMap;

/// State of modules whose node does not answer.
pub(super) const SILENT: &str = "silent";

/// A module, as the tables show it.
#[derive(Clone, Serialize)]
pub(super) struct ModuleLine {
    pub(super) module: String,
    pub(super) node: String,
    pub(super) faces: Vec<String>,
    pub(super) state: String,
    pub(super) priority: u8,
    pub(super) scheduling: String,
    pub(super) pid: Option<u32>,
    pub(super) received: u64,
    pub(super) received_per_s: Option<f64>,
    pub(super) waiting: u32,
    #[serde(flatten)]
    pub(super) losses: Losses,
    pub(super) restarts: u32,
}

/// The modules of a survey; rates since an earlier one. `launch` knows restarts and phases that the node's table does not.
pub(super) fn module_lines(
    installation: &Installation,
    survey: &Survey,
    earlier: Option<&Survey>,
    launch: impl Fn(Name) -> (u32, Option<Phase>),
) -> Vec<ModuleLine> {
    let line = |module: &ModuleSurvey| {
        let (restarts, phase) = launch(module.name);
        ModuleLine {
            module: installation.classes.format(module.name),
            node: module.node.clone(),
            faces: module.faces.iter().map(|face| installation.classes.format(*face)).collect(),
            state: state(module, phase, installation),
            priority: module.name.class().0,
            scheduling: scheduling(module.scheduling),
            pid: module.process.as_ref().map(|process| process.pid),
            received: module.received,
            received_per_s: earlier.map(|earlier| survey.received_per_s(earlier, module.name)),
            waiting: module.depth,
            losses: Losses::new(&module.losses),
            restarts: module.process.as_ref().map_or(restarts, |process| process.restarts),
        }
    };
    survey.modules.iter().map(line).collect()
}

/// How the module's process really is scheduled, which may differ from what was asked for.
fn scheduling(scheduling: Option<Scheduling>) -> String {
    match scheduling {
        Some(Scheduling::Fifo(priority)) => format!("fifo {priority}"),
        Some(Scheduling::Normal(nice)) => format!("nice {nice}"),
        None => "-".into(),
    }
}

pub(super) fn state(module: &ModuleSurvey, phase: Option<Phase>, installation: &Installation) -> String {
    match (&module.process, phase) {
        _ if module.at_ns.is_none() => SILENT.into(),
        (_, Some(phase)) if phase.is_over() || phase == Phase::Waiting => phase.name().into(),
        (Some(process), _) => process.state.map_or("-", ModuleState::name).into(),
        (None, _) if is_left_out(module, installation) => "left out".into(),
        (None, _) => "dead".into(),
    }
}

/// Whether a module does not run and need not: it is optional, and its program most likely not there.
pub(super) fn is_left_out(module: &ModuleSurvey, installation: &Installation) -> bool {
    module.at_ns.is_some()
        && module.process.is_none()
        && installation.module(module.name).is_some_and(|configured| configured.optional)
}

/// Modules as a table, one a line; of several nodes, with their nodes.
pub(super) fn print_modules(lines: &[ModuleLine], with_nodes: bool) -> String {
    let mut all = heads(">received").to_vec();
    let mut rows: Vec<Vec<String>> =
        lines.iter().map(|line| cells(line, " ", line.received.to_string()).into()).collect();
    if with_nodes {
        all.insert(1, "node");
        rows.iter_mut().zip(lines).for_each(|(row, line)| row.insert(1, line.node.clone()));
    }
    table_of(&all, rows)
}

/// The same for a terminal of 80 columns: faces below their module, and rates.
pub(super) fn print_modules_live(lines: &[ModuleLine]) -> String {
    let rate = |line: &ModuleLine| line.received_per_s.map_or("-".into(), |rate| format!("{rate:.0}"));
    table(heads(">in/s"), lines.iter().map(|line| cells(line, "\n", rate(line))))
}

const HEADS: usize = 9;

const fn heads(received: &str) -> [&str; HEADS] {
    ["module", "state", ">priority", "scheduling", ">pid", received, ">waiting", ">lost", ">restarts"]
}

/// Of what does not answer, nothing is known.
fn cells(line: &ModuleLine, gap: &str, received: String) -> [String; HEADS] {
    let faces: Vec<String> = line.faces.iter().map(|face| format!("{gap}+ {face}")).collect();
    let known = |text: String| if line.state == SILENT { "-".into() } else { text };
    [
        line.module.clone() + &faces.concat(),
        line.state.clone(),
        line.priority.to_string(),
        line.scheduling.clone(),
        line.pid.map_or("-".into(), |pid| pid.to_string()),
        known(received),
        known(line.waiting.to_string()),
        known(line.losses.lost.to_string()),
        known(line.restarts.to_string()),
    ]
}

/// Packages that were lost so far, as programs read it.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct Losses {
    /// Somebody misses them.
    pub(super) lost: u64,
    pub(super) lost_by_cause: BTreeMap<&'static str, u64>,
    /// A newer one took their place, as was wished.
    pub(super) replaced: u64,
}

impl Losses {
    /// Of these counts, in the order of [`Loss::ALL`].
    pub(super) fn new(counts: &[u64; Loss::ALL.len()]) -> Self {
        let missed = Loss::ALL.into_iter().filter(|cause| cause.is_missed() && counts[*cause as usize] > 0);
        let lost_by_cause: BTreeMap<_, _> = missed.map(|cause| (cause.name(), counts[cause as usize])).collect();
        Self {
            lost: saturating_sum(lost_by_cause.values().copied()),
            lost_by_cause,
            replaced: counts[Loss::Replaced as usize],
        }
    }
}

/// Losses by cause. Packages that a newer one replaced are nobody's loss, so they stand apart.
pub(super) fn losses(lost: impl Fn(Loss) -> u64) -> String {
    let (missed, replaced): (Vec<Loss>, _) =
        Loss::ALL.into_iter().filter(|cause| lost(*cause) > 0).partition(|cause| cause.is_missed());
    let list =
        |causes: &[Loss]| causes.iter().map(|c| format!("{} {}", lost(*c), c.name())).collect::<Vec<_>>().join(", ");
    let missed = if missed.is_empty() { "none".into() } else { list(&missed) };
    if replaced.is_empty() { missed } else { format!("{missed} ({})", list(&replaced)) }
}

/// A class as tables name it; none: all for which there was no row left.
pub(super) fn class_name(installation: &Installation, class: Option<Class>) -> String {
    let name = |class| installation.classes.name(class).map_or_else(|| class.0.to_string(), ToOwned::to_owned);
    class.map_or("others".into(), name)
}

/// Traffic by class as a table: packages, losses by cause, waiting times.
pub(super) fn print_classes(installation: &Installation, classes: &[ClassTraffic]) -> String {
    let rows = classes.iter().map(|class| {
        let quantile = |share| class.latency.quantile(share).map_or("-".into(), time);
        [
            class_name(installation, class.class),
            class.class.map_or("-".into(), |id| id.0.to_string()),
            class.received.to_string(),
            losses(|cause| class.lost(cause)),
            quantile(0.5),
            quantile(0.99),
            if class.received > 0 { time(class.latency.max) } else { "-".into() },
        ]
    });
    table(["class", ">priority", ">received", "lost", ">waited p50", ">p99", ">max"], rows)
}
