//! The content of `top`: two observations, combined into one table. `--json` prints it, too.

use crate::look::observer::Silence;
use crate::look::summary::{Losses, ModuleLine, module_lines};
use crate::look::target::Running;
use crate::measure::stream::{StreamView, stream_views};
use crate::running::list::{MailboxLine, mailbox_lines};
use crate::terminal::Failure;
use rohrpost::Name;
use rohrpost_config::Installation;
use rohrpost_launch::survey::{ModuleSurvey, Scope, Standing, Survey};
use rohrpost_mailbox::{FlowInfo, Loss, SystemClock, monotonic_ns, realtime_ns, saturating_sum};
use serde::Serialize;
use std::collections::{BTreeMap, HashMap};
use std::time::Duration;

/// One observation.
pub(super) struct Sample {
    /// All selected nodes, merged.
    pub(super) survey: Survey,
    /// Nodes that do not answer.
    pub(super) silent: Vec<Silence>,
    /// The summaries of `list`, in the order of the survey's modules.
    pub(super) lines: Vec<ModuleLine>,
    pub(super) time: TimeNow,
    /// Whether a launch supervises the node that the tool runs on.
    pub(super) launched: bool,
}

impl Sample {
    /// Modules in error without a known cause.
    pub(super) fn unexplained(&self) -> impl Iterator<Item = Name> {
        let modules = self.survey.modules.iter().zip(&self.lines);
        let is_it = |line: &ModuleLine| line.account.state == Standing::Error && line.account.error.is_none();
        modules.filter(move |(_, line)| is_it(line)).map(|(module, _)| module.name)
    }

    /// Whether the module's node does not answer.
    pub(super) fn is_silent(&self, name: Name) -> bool {
        self.survey.module(name).is_some_and(|module| module.at_ns.is_none())
    }
}

/// System time on the node.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct TimeNow {
    /// Nanoseconds since 1970.
    pub(super) time_ns: u64,
    /// Where it comes from.
    pub(super) time_source: &'static str,
    /// Its seconds per second of this computer.
    pub(super) time_pace: f64,
    /// Whether its source has told it: a log that has not begun has not.
    pub(super) time_known: bool,
    /// How far the computer's clock was set away from it, ns; positive: it is ahead.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) clock_set_by_ns: Option<i64>,
}

/// Everything that is shown.
#[derive(Serialize)]
pub(super) struct Model {
    pub(super) installation: String,
    /// The node that the tool runs on.
    pub(super) node: String,
    /// The nodes that are shown.
    pub(super) nodes: Vec<String>,
    /// The shown nodes that do not answer.
    pub(super) silent: Vec<Silence>,
    #[serde(flatten)]
    pub(super) time: TimeNow,
    pub(super) launched: bool,
    /// The interval of rates and waiting times; none with the first observation.
    pub(super) interval_s: Option<f64>,
    /// Number of modules by state.
    pub(super) states: BTreeMap<&'static str, usize>,
    pub(super) received_per_s: Option<f64>,
    #[serde(flatten)]
    pub(super) losses: Losses,
    pub(super) lost_per_s: Option<f64>,
    pub(super) modules: Vec<Row>,
    pub(super) mailboxes: Vec<MailboxLine>,
    pub(super) streams: Vec<StreamView>,
}

/// A module.
#[derive(Clone, Serialize)]
pub(super) struct Row {
    #[serde(skip)]
    pub(super) name: Name,
    #[serde(flatten)]
    pub(super) line: ModuleLine,
    pub(super) class: String,
    pub(super) lost_per_s: Option<f64>,
    pub(super) sent_per_s: Option<f64>,
    /// Waiting times of the packages that it took in the interval; none without any.
    pub(super) waited_p50_s: Option<f64>,
    pub(super) waited_p99_s: Option<f64>,
    /// Time since its process joined the node.
    pub(super) uptime_s: Option<f64>,
    /// Share of one processor.
    pub(super) cpu_percent: Option<f64>,
    pub(super) memory_bytes: Option<u64>,
    pub(super) sends_to: Vec<FlowEnd>,
    pub(super) receives_from: Vec<FlowEnd>,
}

/// The other end of a flow.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct FlowEnd {
    pub(super) module: String,
    pub(super) packages: u64,
    pub(super) packages_per_s: Option<f64>,
}

impl Model {
    /// The table for `now`; with an earlier observation also rates.
    pub(super) fn new(
        installation: &Installation,
        node: &str,
        nodes: &[&str],
        now: &Sample,
        earlier: Option<&Sample>,
    ) -> Self {
        let interval = earlier.map(|earlier| between(earlier.survey.at_ns, now.survey.at_ns));
        let rows = now.survey.modules.iter().zip(&now.lines).map(|(module, line)| {
            let before = earlier.and_then(|earlier| since(module, earlier));
            let waited = before.map(|(before, _)| module.waited.since(&before.waited));
            let quantile = |share| waited.as_ref()?.quantile(share).map(|waited| waited.as_secs_f64());
            Row {
                name: module.name,
                line: line.clone(),
                class: installation.classes.name(module.name.class()).unwrap_or("-").into(),
                lost_per_s: before.map(|(before, interval)| per_s(module.lost, before.lost, interval)),
                sent_per_s: before.and_then(|(before, interval)| sent_per_s(module, before, interval)),
                waited_p50_s: quantile(0.5),
                waited_p99_s: quantile(0.99),
                uptime_s: module
                    .process
                    .as_ref()
                    .zip(module.at_ns)
                    .map(|(process, at_ns)| at_ns.saturating_sub(process.joined_ns) as f64 / 1e9),
                cpu_percent: before.and_then(|(before, interval)| cpu_percent(module, before, interval)),
                memory_bytes: module.usage.map(|usage| usage.memory_bytes),
                sends_to: peers(installation, now, earlier, |flow| (flow.module == module.name).then_some(flow.to)),
                receives_from: peers(installation, now, earlier, |flow| {
                    let to = flow.to.module();
                    (to == module.name || module.aliases.contains(&to)).then_some(sender(flow))
                }),
            }
        });
        let modules: Vec<Row> = rows.collect();
        let mut states = BTreeMap::new();
        modules.iter().for_each(|row| *states.entry(row.line.account.state.word()).or_default() += 1);
        let received = |sample: &Sample| saturating_sum(sample.survey.classes.iter().map(|class| class.received));
        let losses = |sample: &Sample| {
            Losses::new(
                &Loss::ALL.map(|cause| saturating_sum(sample.survey.classes.iter().map(|class| class.lost(cause)))),
            )
        };
        let lost_since = |before: &Sample, interval| per_s(losses(now).lost, losses(before).lost, interval);
        let since = earlier.zip(interval);
        Self {
            installation: installation.name.clone(),
            node: node.into(),
            nodes: nodes.iter().map(|node| (*node).into()).collect(),
            silent: now.silent.clone(),
            time: now.time,
            launched: now.launched,
            interval_s: interval.map(|interval| interval.as_secs_f64()),
            states,
            received_per_s: since.map(|(before, interval)| per_s(received(now), received(before), interval)),
            losses: losses(now),
            lost_per_s: since.map(|(before, interval)| lost_since(before, interval)),
            modules,
            mailboxes: mailbox_lines(installation, &now.survey.mailboxes),
            streams: stream_views(installation, &now.survey.streams),
        }
    }

    pub(super) fn row(&self, name: Name) -> Option<&Row> {
        self.modules.iter().find(|row| row.name == name)
    }
}

/// A restarted process counts its output from 0.
fn sent_per_s(now: &ModuleSurvey, before: &ModuleSurvey, interval: Duration) -> Option<f64> {
    let incarnation = |module: &ModuleSurvey| module.process.as_ref().map(|process| process.incarnation);
    (now.process.is_some() && incarnation(now) == incarnation(before)).then(|| per_s(now.sent, before.sent, interval))
}

/// The sender: the module, or the name that a tool's answers go to.
fn sender(flow: &FlowInfo) -> Name {
    if flow.module == Name::NONE { flow.from } else { flow.module }
}

/// The other ends of flows, selected by `end`, the busiest first.
fn peers(
    installation: &Installation,
    now: &Sample,
    earlier: Option<&Sample>,
    end: impl Fn(&FlowInfo) -> Option<Name>,
) -> Vec<FlowEnd> {
    let since = earlier.map(|earlier| (earlier, between(earlier.survey.at_ns, now.survey.at_ns)));
    let mut peers: Vec<FlowEnd> = Vec::new();
    for flow in now.survey.flows.iter().filter(|flow| !flow.is_publication()) {
        let Some(name) = end(flow).filter(|name| *name != Name::NONE) else { continue };
        let packages_per_s = since.map(|(earlier, interval)| {
            let before = earlier.survey.flows.iter().find(|before| flow.is_same(before));
            per_s(flow.packages, before.map_or(0, |before| before.packages), interval)
        });
        let module = installation.classes.format(name.module());
        match peers.iter_mut().find(|peer| peer.module == module) {
            Some(peer) => {
                peer.packages += flow.packages;
                peer.packages_per_s = peer.packages_per_s.zip(packages_per_s).map(|(sum, more)| sum + more);
            }
            None => peers.push(FlowEnd { module, packages: flow.packages, packages_per_s }),
        }
    }
    peers.sort_by_key(|peer| std::cmp::Reverse(peer.packages));
    peers
}

/// Mailboxes may disappear with their counters, so the later sum may be smaller.
fn per_s(now: u64, before: u64, interval: Duration) -> f64 {
    if interval.is_zero() { 0.0 } else { now.saturating_sub(before) as f64 / interval.as_secs_f64() }
}

/// From one moment of a clock to a later one.
fn between(earlier_ns: u64, now_ns: u64) -> Duration {
    Duration::from_nanos(now_ns.saturating_sub(earlier_ns))
}

/// The module at an earlier observation, and the time since, on its own node's clock; none if the node did not report
/// again.
fn since<'a>(module: &ModuleSurvey, earlier: &'a Sample) -> Option<(&'a ModuleSurvey, Duration)> {
    let before = earlier.survey.module(module.name)?;
    let interval = between(before.at_ns?, module.at_ns?);
    (!interval.is_zero()).then_some((before, interval))
}

/// Share of one processor between two observations; none when the process has changed.
fn cpu_percent(now: &ModuleSurvey, before: &ModuleSurvey, interval: Duration) -> Option<f64> {
    let pid = |module: &ModuleSurvey| module.process.as_ref().map(|process| process.pid);
    let ran = now.usage?.cpu.checked_sub(before.usage?.cpu).filter(|_| pid(now) == pid(before))?;
    Some(ran.as_secs_f64() / interval.as_secs_f64() * 100.0)
}

/// Why modules are in error, as they reported.
pub(super) type ErrorCauses = HashMap<Name, String>;

/// The reports of some nodes, or why they do not answer.
pub(super) type NodeSurveys = Vec<Result<Survey, Silence>>;

/// Observes the own node, if it is selected.
pub(super) fn own(running: &Running) -> Result<NodeSurveys, Failure> {
    let is_own = |node: &&str| *node == running.node_name;
    let own: Vec<&str> = running.shown().into_iter().filter(is_own).collect();
    running.look_at(&own, Scope::All)
}

/// Merges the nodes' reports; `earlier` is the base of rates.
pub(super) fn put_together(
    running: &Running,
    seen: NodeSurveys,
    earlier: Option<&Sample>,
    said: &ErrorCauses,
) -> Sample {
    let (mut survey, silent) = running.joined(seen);
    for module in survey.modules.iter_mut().filter(|module| module.standing() == Standing::Error) {
        if let Some(error) = said.get(&module.name) {
            module.error = Some(error.clone());
        }
    }
    let lines = module_lines(&running.installation, &survey, earlier.map(|sample| &sample.survey));
    let clock = SystemClock::open(&running.node);
    let record = clock.record();
    let time = TimeNow {
        time_ns: clock.now().ns,
        time_source: record.map_or("local", |record| record.source.name()),
        time_pace: record.map_or(1.0, |record| record.pace_ppb as f64 / 1e9),
        time_known: record.is_none_or(|record| record.is_known()),
        clock_set_by_ns: record.and_then(|record| record.clock_set_by(monotonic_ns(), realtime_ns())),
    };
    let launched = running.node.launcher().is_some();
    Sample { survey, silent, lines, time, launched }
}
