//! A node's state as text: modules, and traffic by class.

use crate::terminal::table::{table, table_of, time};
use crate::terminal::{columns, folded};
use rohrpost::Class;
use rohrpost::common::Status;
use rohrpost::output::plain;
use rohrpost_config::Installation;
use rohrpost_launch::survey::{ModuleSurvey, Standing, Survey};
use rohrpost_mailbox::sys::Scheduling;
use rohrpost_mailbox::{ClassTraffic, Latency, Loss, saturating_sum};
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;
use std::iter;
use std::time::Duration;

/// A module, as the tables show it.
#[derive(Clone, Serialize)]
pub(crate) struct ModuleLine {
    pub(crate) module: String,
    pub(crate) node: String,
    pub(crate) aliases: Vec<String>,
    #[serde(flatten)]
    pub(crate) account: Account,
    pub(crate) priority: u8,
    pub(crate) scheduling: String,
    pub(crate) pid: Option<u32>,
    pub(crate) received: u64,
    pub(crate) received_per_s: Option<f64>,
    pub(crate) waiting: u32,
    #[serde(flatten)]
    pub(crate) losses: Losses,
}

/// A module's state, the same in every table and JSON output.
#[derive(Clone, Serialize)]
pub(crate) struct Account {
    pub(crate) state: Standing,
    /// The number of the present restart that counts,
    attempt: Option<u32>,
    /// and the number at which launch gives up.
    attempts_max: Option<u32>,
    pub(crate) error: Option<String>,
    pub(crate) restarts: u32,
    /// For how long the part of its own code that runs has not come back, seconds; none: none runs.
    pub(crate) in_turn_s: Option<f64>,
}

impl Account {
    pub(crate) fn of(module: &ModuleSurvey, installation: &Installation) -> Self {
        let state = module.standing();
        let counts = match state {
            Standing::Restarting { attempt, most } => Some((attempt, most)),
            _ => None,
        };
        Self {
            state,
            attempt: counts.map(|(attempt, _)| attempt),
            attempts_max: counts.map(|(_, most)| most),
            error: Some(module.last_error(installation)).filter(|error| !error.is_empty()),
            restarts: module.restarts(),
            in_turn_s: module.in_turn.map(|turn| turn.as_secs_f64()),
        }
    }

    /// From the module's own report; `before` is what others know of it.
    pub(crate) fn said(status: &Status, before: Option<Self>) -> Self {
        let before = before.unwrap_or_else(Self::unknown);
        let error = Some(status.error.clone()).filter(|error| !error.is_empty()).or(before.error);
        Self { state: status.state.into(), attempt: None, attempts_max: None, error, ..before }
    }

    /// A module that does not answer, for this reason.
    pub(crate) fn unreachable(why: &str, before: Option<Self>) -> Self {
        let before = before.unwrap_or_else(Self::unknown);
        Self { state: Standing::Unreachable, attempt: None, attempts_max: None, error: Some(why.into()), ..before }
    }

    const fn unknown() -> Self {
        Self {
            state: Standing::Unreachable,
            attempt: None,
            attempts_max: None,
            error: None,
            restarts: 0,
            in_turn_s: None,
        }
    }

    /// The last error, with at most this many characters.
    pub(crate) fn short_error(&self, most: usize) -> String {
        let error = plain::line(self.error.as_deref().unwrap_or_default());
        match error.char_indices().nth(most) {
            Some(_) => error.chars().take(most - 1).chain(['…']).collect(),
            None => error.into_owned(),
        }
    }
}

/// The modules of a survey; rates are relative to an earlier one.
pub(crate) fn module_lines(installation: &Installation, survey: &Survey, earlier: Option<&Survey>) -> Vec<ModuleLine> {
    let line = |module: &ModuleSurvey| ModuleLine {
        module: installation.classes.format(module.name),
        node: module.node.clone(),
        aliases: module.aliases.iter().map(|alias| installation.classes.format(*alias)).collect(),
        account: Account::of(module, installation),
        priority: module.name.class().0,
        scheduling: scheduling(module.scheduling),
        pid: module.process.as_ref().map(|process| process.pid),
        received: module.received,
        received_per_s: earlier.map(|earlier| survey.received_per_s(earlier, module.name)),
        waiting: module.depth,
        losses: Losses::new(&module.losses),
    };
    survey.modules.iter().map(line).collect()
}

/// The actual scheduling of the module's process, which may differ from the requested one.
fn scheduling(scheduling: Option<Scheduling>) -> String {
    match scheduling {
        Some(Scheduling::Fifo(priority)) => format!("fifo {priority}"),
        Some(Scheduling::Normal(nice)) => format!("nice {nice}"),
        None => "-".into(),
    }
}

/// Modules as a table, one a line; with their nodes if there are several.
pub(crate) fn print_modules(lines: &[ModuleLine], with_nodes: bool) -> String {
    let mut all = heads(">received").to_vec();
    let mut rows: Vec<Vec<String>> = lines.iter().map(|line| cells(line, line.received.to_string()).into()).collect();
    for (row, line) in rows.iter_mut().zip(lines) {
        line.aliases.iter().for_each(|alias| row[0] += &format!(" + {alias}"));
    }
    // A column only if it has any content.
    if lines.iter().any(|line| line.account.error.is_some()) {
        all.push("last error");
        rows.iter_mut().zip(lines).for_each(|(row, line)| row.push(line.account.short_error(ERROR_MAX)));
    }
    if with_nodes {
        all.insert(1, "node");
        rows.iter_mut().zip(lines).for_each(|(row, line)| row.insert(1, line.node.clone()));
    }
    table_of(&all, rows)
}

/// Modules as the live table has them: rates; aliases in lines below their module; below all, the last errors.
pub(crate) fn print_modules_live(lines: &[ModuleLine]) -> String {
    let rate = |line: &ModuleLine| line.received_per_s.map_or("-".into(), |rate| format!("{rate:.0}"));
    let alias = |alias: &String| std::array::from_fn(|at| if at == 0 { format!("+ {alias}") } else { String::new() });
    let of = |line| iter::once(cells(line, rate(line))).chain(line.aliases.iter().map(alias));
    let mut text = table(heads(">in/s"), lines.iter().flat_map(of));
    for line in lines.iter().filter(|line| line.account.error.is_some()) {
        let error = format!("{}: {}", line.module, line.account.error.as_deref().unwrap_or_default());
        text.push_str(&format!("{}\n", folded(&plain::line(&error), columns())));
    }
    text
}

/// An error, shortened for a table; the whole text is in the JSON.
const ERROR_MAX: usize = 100;

const HEADS: usize = 9;

/// As `top` has them, so that a table fits into 80 columns.
const fn heads(received: &str) -> [&str; HEADS] {
    ["module", "state", ">prio", "sched", ">pid", received, ">wait", ">lost", ">rst"]
}

/// Nothing is known of a module that does not answer.
fn cells(line: &ModuleLine, received: String) -> [String; HEADS] {
    let known = |text: String| if line.account.state == Standing::Unreachable { "-".into() } else { text };
    [
        line.module.clone(),
        line.account.state.to_string(),
        line.priority.to_string(),
        line.scheduling.clone(),
        line.pid.map_or("-".into(), |pid| pid.to_string()),
        known(received),
        known(line.waiting.to_string()),
        known(line.losses.lost.to_string()),
        known(line.account.restarts.to_string()),
    ]
}

/// Packages that were lost so far, as programs read it.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct Losses {
    /// Losses that a receiver misses.
    pub(crate) lost: u64,
    pub(crate) lost_by_cause: BTreeMap<&'static str, u64>,
    /// Packages that a newer one replaced, as configured.
    pub(crate) replaced: u64,
}

impl Losses {
    /// From these counts, in the order of [`Loss::ALL`].
    pub(crate) fn new(counts: &[u64; Loss::ALL.len()]) -> Self {
        let missed = Loss::ALL.into_iter().filter(|cause| cause.is_missed() && counts[*cause as usize] > 0);
        let lost_by_cause: BTreeMap<_, _> = missed.map(|cause| (cause.word(), counts[cause as usize])).collect();
        Self {
            lost: saturating_sum(lost_by_cause.values().copied()),
            lost_by_cause,
            replaced: counts[Loss::Replaced as usize],
        }
    }
}

/// A bucket of waiting times.
#[derive(Serialize)]
pub(crate) struct Bar {
    #[serde(rename = "from_s", serialize_with = "in_seconds")]
    pub(crate) from: Duration,
    #[serde(rename = "to_s", serialize_with = "in_seconds")]
    pub(crate) to: Duration,
    pub(crate) packages: u64,
    /// Characters of the bar: one in a million is visible, too.
    #[serde(skip)]
    pub(crate) length: usize,
}

fn in_seconds<S: Serializer>(time: &Duration, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_f64(time.as_secs_f64())
}

/// Characters of the longest bar.
const BAR: f64 = 40.0;

/// One bucket for each octave, from the first to the last that is not empty.
pub(crate) fn bars(latency: &Latency) -> Vec<Bar> {
    let octaves = latency.buckets.chunks(2).map(|pair| pair.iter().map(|count| u64::from(*count)).sum::<u64>());
    let octaves: Vec<(usize, u64)> = octaves.enumerate().collect();
    let (first, last) = (octaves.iter().position(|it| it.1 > 0), octaves.iter().rposition(|it| it.1 > 0));
    let Some((first, last)) = first.zip(last) else { return Vec::new() };
    let most = octaves.iter().map(|(_, packages)| *packages).max().unwrap_or(1);
    let bar = |(octave, packages): &(usize, u64)| Bar {
        from: Latency::bucket_start(octave * 2),
        to: Latency::bucket_start(octave * 2 + 2),
        packages: *packages,
        length: (*packages as f64 / most as f64 * BAR).ceil() as usize,
    };
    octaves[first..=last].iter().map(bar).collect()
}

/// Losses by cause. Replaced packages are no loss, so they are listed separately.
pub(crate) fn losses(lost: impl Fn(Loss) -> u64) -> String {
    let (missed, replaced): (Vec<Loss>, _) =
        Loss::ALL.into_iter().filter(|cause| lost(*cause) > 0).partition(|cause| cause.is_missed());
    let list =
        |causes: &[Loss]| causes.iter().map(|c| format!("{} {}", lost(*c), c.word())).collect::<Vec<_>>().join(", ");
    let missed = if missed.is_empty() { "none".into() } else { list(&missed) };
    if replaced.is_empty() { missed } else { format!("{missed} ({})", list(&replaced)) }
}

/// A class as tables name it; none stands for all classes without a row of their own.
pub(crate) fn class_name(installation: &Installation, class: Option<Class>) -> String {
    let name = |class| installation.classes.name(class).map_or_else(|| class.0.to_string(), ToOwned::to_owned);
    class.map_or("others".into(), name)
}

/// Traffic by class as a table: packages, losses by cause, waiting times.
pub(crate) fn print_classes(installation: &Installation, classes: &[ClassTraffic]) -> String {
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
