//! `rohrpost mailbox`: one mailbox from outside, down to its slots. It is read-only and sends nothing.

use crate::look::summary::{Bar, Losses, bars, class_name, losses, print_classes};
use crate::look::target::{Running, Target};
use crate::terminal::table::{table, time};
use crate::terminal::units::fine;
use crate::terminal::{Failure, say, say_folded};
use rohrpost::Name;
use rohrpost_config::{Installation, nearest};
use rohrpost_launch::survey::{MailboxSnapshot, Scope, purpose};
use rohrpost_mailbox::{
    ClassTraffic, Loss, MailboxDetail, OverflowPolicy, Party, Priority, SlotInfo, WaitingPackage, saturating_sum,
};
use serde::Serialize;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost mailbox laser.0           the mailbox for commands to laser.0
  rohrpost mailbox laser.0.2         another of its mailboxes, by its local id
  watch -n1 rohrpost mailbox laser.0
`rohrpost list --mailboxes` lists all. Reading them disturbs nobody.")]
pub(crate) struct Arguments {
    /// Mailbox to show, such as laser.0 or laser.0.2.
    name: String,
    #[command(flatten)]
    target: Target,
    /// One JSON object.
    #[arg(long)]
    json: bool,
}

/// Everything that is visible, as programs read it.
#[derive(Serialize)]
struct MailboxView {
    mailbox: String,
    module: String,
    purpose: &'static str,
    node: String,
    slots: u16,
    body_bytes_max: u16,
    /// Size of its shared memory.
    memory_bytes: usize,
    full: &'static str,
    max_age_s: Option<f64>,
    claims: u8,
    /// The present receiver, or the last one.
    receiver: Option<PartyLine>,
    retired: bool,
    adoptions: u32,
    waiting: u32,
    waiting_max: u32,
    sent: u64,
    received: u64,
    #[serde(flatten)]
    losses: Losses,
    classes: Vec<ClassLine>,
    slot_states: Vec<SlotLine>,
}

/// A participant.
#[derive(Clone, PartialEq, Serialize)]
struct PartyLine {
    module: Option<String>,
    pid: Option<u32>,
    participant: u16,
    alive: bool,
    /// Its process is stopped: by SIGSTOP, Ctrl-Z or a debugger.
    stopped: bool,
}

#[derive(Serialize)]
struct ClassLine {
    class: String,
    priority: Option<u8>,
    received: u64,
    bytes: u64,
    #[serde(flatten)]
    losses: Losses,
    waited_mean_s: Option<f64>,
    waited_p50_s: Option<f64>,
    waited_p99_s: Option<f64>,
    waited_max_s: f64,
    waited: Vec<Bar>,
}

#[derive(Serialize)]
struct SlotLine {
    slot: usize,
    state: &'static str,
    /// For a package that waits or is being read.
    class: Option<String>,
    priority: Option<u8>,
    ticket: Option<u64>,
    redelivered: bool,
    /// The sender that fills it.
    by: Option<PartyLine>,
    victim: Option<VictimLine>,
}

/// The packages that were removed for the package that is being written.
#[derive(Serialize)]
struct VictimLine {
    class: String,
    priority: u8,
    replaced: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let running = arguments.target.find()?;
    let name = running.name(&arguments.name)?;
    let look = running.inspect(name)?.ok_or_else(|| missing(&running, name, &arguments.name))?;
    let seen = MailboxView::new(&running, &look);
    if arguments.json {
        say(serde_json::to_string(&seen)?);
    } else {
        say_folded(print(&running.installation, &look.detail, &seen));
    }
    Ok(ExitCode::SUCCESS)
}

/// The error if there is no such mailbox, with the existing ones.
fn missing(running: &Running, name: Name, text: &str) -> Failure {
    let node = running.node_of(name);
    let all: Vec<Name> = match running.look(node, Scope::Mailboxes) {
        Ok(survey) => survey.mailboxes.iter().map(|mailbox| mailbox.name).collect(),
        Err(error) => return error,
    };
    let module = running.text(name.module());
    let own: Vec<String> = all.iter().filter(|n| n.module() == name.module()).map(|n| running.text(*n)).collect();
    if !own.is_empty() {
        return format!("{module} has no mailbox `{text}`; it has {}", own.join(", ")).into();
    }
    if running.installation.module(name).is_some() {
        return running.absent(name.module());
    }
    let all: Vec<String> = all.iter().map(|n| running.text(*n)).collect();
    let nearest = nearest(text, all.iter().map(String::as_str));
    let nearest = nearest.map_or(String::new(), |nearest| format!("did you mean `{nearest}`? "));
    format!("node {node} has no mailbox `{text}`; {nearest}`rohrpost list --mailboxes` lists all").into()
}

impl MailboxView {
    fn new(running: &Running, look: &MailboxSnapshot) -> Self {
        let (installation, detail) = (&running.installation, &look.detail);
        let (info, shape) = (&detail.info, &detail.info.shape);
        let party = |party: &Party| PartyLine::new(installation, look, party);
        Self {
            mailbox: installation.classes.format_full(info.name),
            module: running.text(info.name.module()),
            purpose: purpose(info.name.local()),
            node: running.node_of(info.name).into(),
            slots: shape.slots,
            body_bytes_max: shape.body_bytes_max,
            memory_bytes: shape.segment_bytes(),
            full: shape.full.name(),
            max_age_s: shape.max_age.map(|age| age.as_secs_f64()),
            claims: shape.claims,
            receiver: detail.receiver.as_ref().map(party),
            retired: detail.is_retired,
            adoptions: info.adoptions,
            waiting: info.depth,
            waiting_max: info.depth_max,
            sent: info.sent,
            received: saturating_sum(info.classes.iter().map(|class| class.received)),
            losses: Losses::new(&Loss::ALL.map(|cause| lost(&info.classes, cause))),
            classes: info.classes.iter().map(|class| ClassLine::new(installation, class)).collect(),
            slot_states: (0..)
                .zip(&detail.slots)
                .map(|(at, slot)| SlotLine::new(installation, look, at, slot))
                .collect(),
        }
    }
}

fn lost(classes: &[ClassTraffic], cause: Loss) -> u64 {
    saturating_sum(classes.iter().map(|class| class.lost(cause)))
}

impl PartyLine {
    fn new(installation: &Installation, look: &MailboxSnapshot, party: &Party) -> Self {
        Self {
            module: (party.module != Name::NONE).then(|| installation.classes.format(party.module)),
            pid: party.pid,
            participant: party.participant,
            alive: party.is_alive,
            stopped: party.is_alive && party.pid.is_some_and(|pid| look.stopped.contains(&pid)),
        }
    }

    fn text(&self) -> String {
        let process = self.pid.map_or("a process".into(), |pid| format!("process {pid}"));
        let name = self.module.as_ref().map_or(process.clone(), |module| format!("{module}, {process}"));
        match (self.alive, self.stopped) {
            (true, false) => name,
            (true, true) => format!("{name}, which is stopped"),
            (false, _) => format!("{name}, which is dead"),
        }
    }
}

impl ClassLine {
    fn new(installation: &Installation, class: &ClassTraffic) -> Self {
        let latency = &class.latency;
        Self {
            class: class_name(installation, class.class),
            priority: class.class.map(|class| class.0),
            received: class.received,
            bytes: class.body_bytes,
            losses: Losses::new(&class.losses),
            waited_mean_s: latency.mean().map(|time| time.as_secs_f64()),
            waited_p50_s: latency.quantile(0.5).map(|time| time.as_secs_f64()),
            waited_p99_s: latency.quantile(0.99).map(|time| time.as_secs_f64()),
            waited_max_s: latency.max.as_secs_f64(),
            waited: bars(latency),
        }
    }
}

impl SlotLine {
    fn new(installation: &Installation, look: &MailboxSnapshot, slot: usize, seen: &SlotInfo) -> Self {
        let class = |priority: Priority| class_name(installation, Some(rohrpost::Class(priority.0)));
        let state = |state, waiting: Option<&WaitingPackage>| Self {
            slot,
            state,
            class: waiting.map(|package| class(package.priority)),
            priority: waiting.map(|package| package.priority.0),
            ticket: waiting.map(|package| package.ticket),
            redelivered: waiting.is_some_and(|package| package.is_redelivered),
            by: None,
            victim: None,
        };
        match seen {
            SlotInfo::Free => state("free", None),
            SlotInfo::Ready(package) => state("ready", Some(package)),
            SlotInfo::Taken(package) => state("taken", Some(package)),
            SlotInfo::Filling { by, victim } => Self {
                by: Some(PartyLine::new(installation, look, by)),
                victim: victim.map(|victim| VictimLine {
                    class: class(victim.priority),
                    priority: victim.priority.0,
                    replaced: victim.is_replaced,
                }),
                ..state("filling", None)
            },
        }
    }

    /// Whether the next slot is free like this one, or holds the package that was sent next.
    fn goes_on_in(&self, next: &Self) -> bool {
        let same = (self.state, &self.class, self.redelivered) == (next.state, &next.class, next.redelivered);
        let is_next = self.ticket.map(|ticket| ticket + 1) == next.ticket;
        same && self.by.is_none() && is_next
    }

    fn remark(&self) -> String {
        let by = self.by.as_ref().map(|by| format!("by {}", by.text()));
        let victim = self.victim.as_ref().map(|victim| {
            let how = if victim.replaced { "replaces" } else { "displaced" };
            format!("{how} a package of {} ({})", victim.class, victim.priority)
        });
        let redelivered = self.redelivered.then(|| "an earlier receiver died while reading it".to_owned());
        [by, victim, redelivered].into_iter().flatten().collect::<Vec<_>>().join("; ")
    }
}

fn print(installation: &Installation, detail: &MailboxDetail, seen: &MailboxView) -> String {
    let shape = &detail.info.shape;
    let when_full = match shape.full {
        OverflowPolicy::Displace => "displace: a more important package replaces the least important one",
        OverflowPolicy::Latest => "latest: a newer package replaces an older one of the same state",
        OverflowPolicy::Reject => "reject: further packages are refused",
    };
    let receiver = match &seen.receiver {
        None => "nobody yet".into(),
        Some(party) if party.alive => party.text(),
        Some(party) => format!("nobody; the last was {}", party.text()),
    };
    let age = shape.max_age.map_or("nothing for its age".into(), |age| format!("what has waited {}", time(age)));
    let mut facts = vec![
        ("receiver", receiver),
        ("slots", format!("{} x {} B, {} B of shared memory", seen.slots, seen.body_bytes_max, seen.memory_bytes)),
        ("when full", when_full.into()),
        ("drops", age),
        ("claims", format!("{} a sender", seen.claims)),
        ("waiting", format!("{} (most {})", seen.waiting, seen.waiting_max)),
        ("sent", seen.sent.to_string()),
        ("received", seen.received.to_string()),
        ("lost", losses(|cause| lost(&detail.info.classes, cause))),
        ("adoptions", seen.adoptions.to_string()),
    ];
    if seen.retired {
        facts.push(("retired", "nobody sends here any more; the next receiver creates it again".into()));
    }
    let facts: String = facts.iter().map(|(what, text)| format!("  {what:10}  {text}\n")).collect();
    let mut text =
        format!("mailbox {}: {} of {}, node {}\n\n{facts}\n", seen.mailbox, seen.purpose, seen.module, seen.node);
    if !seen.classes.is_empty() {
        text += &format!("{}\n", print_classes(installation, &detail.info.classes));
    }
    for class in seen.classes.iter().filter(|class| !class.waited.is_empty()) {
        text += &format!("{}\n", print_bars(class));
    }
    text += &print_slots(&seen.slot_states);
    text.trim_end().to_owned()
}

/// How long the packages of a class waited.
fn print_bars(class: &ClassLine) -> String {
    let rows = class.waited.iter().map(|Bar { from, to, packages, length }| {
        [fine(from.as_secs_f64()), fine(to.as_secs_f64()), packages.to_string(), "█".repeat(*length)]
    });
    let head = format!("{} waited", class.class);
    table([">from", ">to", ">packages", &head], rows)
}

/// Slots, one a line; a run of similar slots shares a line.
fn print_slots(slots: &[SlotLine]) -> String {
    let range = |first: String, last: String| if first == last { first } else { format!("{first}-{last}") };
    let runs = slots.chunk_by(SlotLine::goes_on_in);
    let rows = runs.filter_map(|run| {
        let (first, last) = (run.first()?, run.last()?);
        let package = first.class.as_ref().zip(first.priority);
        Some([
            range(first.slot.to_string(), last.slot.to_string()),
            first.state.into(),
            package.map_or(String::new(), |(class, priority)| format!("{class} ({priority})")),
            first.ticket.zip(last.ticket).map_or(String::new(), |(a, b)| range(a.to_string(), b.to_string())),
            first.remark(),
        ])
    });
    table([">slot", "state", "class", ">ticket", ""], rows)
}
