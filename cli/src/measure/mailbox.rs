//! `rohrpost mailbox`: one mailbox from outside, down to its slots. It is read-only and sends nothing.

use crate::look::summary::{Bar, Losses, bars, class_name, losses, print_classes};
use crate::look::target::{Running, Target};
use crate::terminal::table::{table, time};
use crate::terminal::units::fine;
use crate::terminal::{Failure, say, say_folded};
use rohrpost::Name;
use rohrpost_config::nearest;
use rohrpost_launch::survey::{MailboxSnapshot, Scope, purpose};
use rohrpost_mailbox::{
    ClassTraffic, Latency, Loss, MailboxDetail, OverflowPolicy, Party, Priority, SlotInfo, VictimInfo, WaitingPackage,
    saturating_sum,
};
use serde_json::{Value, json};
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

/// A mailbox, as programs and people read it.
struct MailboxView<'a> {
    running: &'a Running,
    look: &'a MailboxSnapshot,
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let running = arguments.target.find()?;
    let name = running.name(&arguments.name)?;
    let look = running.inspect(name)?.ok_or_else(|| missing(&running, name, &arguments.name))?;
    let view = MailboxView { running: &running, look: &look };
    if arguments.json {
        say(view.json());
    } else {
        say_folded(view.text());
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

impl MailboxView<'_> {
    /// Everything that is visible, in one object.
    fn json(&self) -> Value {
        let MailboxDetail { info, receiver, is_retired, slots } = &self.look.detail;
        let shape = &info.shape;
        let losses = Losses::new(&Loss::ALL.map(|cause| lost(&info.classes, cause)));
        json!({
            "mailbox": self.running.installation.classes.format_full(info.name),
            "module": self.running.text(info.name.module()),
            "purpose": purpose(info.name.local()),
            "node": self.running.node_of(info.name),
            "slots": shape.slots,
            "body_bytes_max": shape.body_bytes_max,
            // Size of its shared memory.
            "memory_bytes": shape.segment_bytes(),
            "full": shape.full.name(),
            "max_age_s": shape.max_age.map(|age| age.as_secs_f64()),
            "claims": shape.claims,
            // The present receiver, or the last one.
            "receiver": receiver.as_ref().map(|party| self.party(party)),
            "retired": is_retired,
            "adoptions": info.adoptions,
            "waiting": info.depth,
            "waiting_max": info.depth_max,
            "sent": info.sent,
            "received": received(&info.classes),
            "lost": losses.lost,
            "lost_by_cause": losses.lost_by_cause,
            "replaced": losses.replaced,
            "classes": info.classes.iter().map(|class| self.class(class)).collect::<Vec<_>>(),
            "slot_states": (0..).zip(slots).map(|(at, slot)| self.slot(at, slot)).collect::<Vec<_>>(),
        })
    }

    fn party(&self, party: &Party) -> Value {
        json!({
            "module": self.module_of(party),
            "pid": party.pid,
            "participant": party.participant,
            "alive": party.is_alive,
            "stopped": self.is_stopped(party),
        })
    }

    fn class(&self, class: &ClassTraffic) -> Value {
        let (losses, latency) = (Losses::new(&class.losses), &class.latency);
        json!({
            "class": class_name(&self.running.installation, class.class),
            "priority": class.class.map(|class| class.0),
            "received": class.received,
            "bytes": class.body_bytes,
            "lost": losses.lost,
            "lost_by_cause": losses.lost_by_cause,
            "replaced": losses.replaced,
            "waited_mean_s": latency.mean().map(|time| time.as_secs_f64()),
            "waited_p50_s": latency.quantile(0.5).map(|time| time.as_secs_f64()),
            "waited_p99_s": latency.quantile(0.99).map(|time| time.as_secs_f64()),
            "waited_max_s": latency.max.as_secs_f64(),
            "waited": bars(latency),
        })
    }

    fn slot(&self, at: usize, slot: &SlotInfo) -> Value {
        let (state, package) = state_of(slot);
        let (by, victim) = match slot {
            SlotInfo::Filling { by, victim } => (Some(by), *victim),
            _ => (None, None),
        };
        json!({
            "slot": at,
            "state": state,
            // Of a package that waits or is being read.
            "class": package.map(|package| self.class_of(package.priority)),
            "priority": package.map(|package| package.priority.0),
            "ticket": package.map(|package| package.ticket),
            "redelivered": package.is_some_and(|package| package.is_redelivered),
            // The sender that fills it.
            "by": by.map(|by| self.party(by)),
            // The package that was removed for the one that is being written.
            "victim": victim.map(|victim| json!({
                "class": self.class_of(victim.priority),
                "priority": victim.priority.0,
                "replaced": victim.is_replaced,
            })),
        })
    }

    fn module_of(&self, party: &Party) -> Option<String> {
        (party.module != Name::NONE).then(|| self.running.text(party.module))
    }

    /// Whether its process is stopped: by SIGSTOP, Ctrl-Z or a debugger.
    fn is_stopped(&self, party: &Party) -> bool {
        party.is_alive && party.pid.is_some_and(|pid| self.look.stopped.contains(&pid))
    }

    fn class_of(&self, priority: Priority) -> String {
        class_name(&self.running.installation, Some(rohrpost::Class(priority.0)))
    }

    fn party_text(&self, party: &Party) -> String {
        let process = party.pid.map_or("a process".into(), |pid| format!("process {pid}"));
        let name = self.module_of(party).map_or(process.clone(), |module| format!("{module}, {process}"));
        match (party.is_alive, self.is_stopped(party)) {
            (true, false) => name,
            (true, true) => format!("{name}, which is stopped"),
            (false, _) => format!("{name}, which is dead"),
        }
    }

    fn text(&self) -> String {
        let MailboxDetail { info, receiver, is_retired, slots } = &self.look.detail;
        let (shape, installation) = (&info.shape, &self.running.installation);
        let when_full = match shape.full {
            OverflowPolicy::Displace => "displace: a more important package replaces the least important one",
            OverflowPolicy::Latest => "latest: a newer package replaces an older one of the same state",
            OverflowPolicy::Reject => "reject: further packages are refused",
        };
        let receiver = match receiver {
            None => "nobody yet".into(),
            Some(party) if party.is_alive => self.party_text(party),
            Some(party) => format!("nobody; the last was {}", self.party_text(party)),
        };
        let age = shape.max_age.map_or("nothing for its age".into(), |age| format!("what has waited {}", time(age)));
        let memory_bytes = shape.segment_bytes();
        let mut facts = vec![
            ("receiver", receiver),
            ("slots", format!("{} x {} B, {memory_bytes} B of shared memory", shape.slots, shape.body_bytes_max)),
            ("when full", when_full.into()),
            ("drops", age),
            ("claims", format!("{} a sender", shape.claims)),
            ("waiting", format!("{} (most {})", info.depth, info.depth_max)),
            ("sent", info.sent.to_string()),
            ("received", received(&info.classes).to_string()),
            ("lost", losses(|cause| lost(&info.classes, cause))),
            ("adoptions", info.adoptions.to_string()),
        ];
        if *is_retired {
            facts.push(("retired", "nobody sends here any more; the next receiver creates it again".into()));
        }
        let facts: String = facts.iter().map(|(what, text)| format!("  {what:10}  {text}\n")).collect();
        let (mailbox, module) = (installation.classes.format_full(info.name), self.running.text(info.name.module()));
        let (purpose, node) = (purpose(info.name.local()), self.running.node_of(info.name));
        let mut text = format!("mailbox {mailbox}: {purpose} of {module}, node {node}\n\n{facts}\n");
        if !info.classes.is_empty() {
            text += &format!("{}\n", print_classes(installation, &info.classes));
        }
        for class in info.classes.iter().filter(|class| class.latency.count() > 0) {
            text += &format!("{}\n", print_bars(&class_name(installation, class.class), &class.latency));
        }
        text += &self.print_slots(slots);
        text.trim_end().to_owned()
    }

    /// Slots, one a line; a run of similar slots shares a line.
    fn print_slots(&self, slots: &[SlotInfo]) -> String {
        let range = |first: u64, last: u64| if first == last { first.to_string() } else { format!("{first}-{last}") };
        let mut at = 0;
        let rows = slots.chunk_by(goes_on_in).filter_map(|run| {
            let (first, last) = (run.first()?, run.last()?);
            let (state, package) = state_of(first);
            let package = package.zip(state_of(last).1);
            let number = at;
            at += run.len() as u64;
            Some([
                range(number, at - 1),
                state.into(),
                package.map_or(String::new(), |(it, _)| format!("{} ({})", self.class_of(it.priority), it.priority.0)),
                package.map_or(String::new(), |(first, last)| range(first.ticket, last.ticket)),
                self.remark(first),
            ])
        });
        table([">slot", "state", "class", ">ticket", ""], rows)
    }

    fn remark(&self, slot: &SlotInfo) -> String {
        match slot {
            SlotInfo::Filling { by, victim: None } => format!("by {}", self.party_text(by)),
            SlotInfo::Filling { by, victim: Some(VictimInfo { priority, is_replaced }) } => {
                let (by, class) = (self.party_text(by), self.class_of(*priority));
                let how = if *is_replaced { "replaces" } else { "displaced" };
                format!("by {by}; {how} a package of {class} ({})", priority.0)
            }
            SlotInfo::Ready(package) | SlotInfo::Taken(package) if package.is_redelivered => {
                "an earlier receiver died while reading it".into()
            }
            SlotInfo::Free | SlotInfo::Ready(_) | SlotInfo::Taken(_) => String::new(),
        }
    }
}

fn received(classes: &[ClassTraffic]) -> u64 {
    saturating_sum(classes.iter().map(|class| class.received))
}

fn lost(classes: &[ClassTraffic], cause: Loss) -> u64 {
    saturating_sum(classes.iter().map(|class| class.lost(cause)))
}

/// A slot's state in one word, and the package that waits in it or is being read.
fn state_of(slot: &SlotInfo) -> (&'static str, Option<&WaitingPackage>) {
    match slot {
        SlotInfo::Free => ("free", None),
        SlotInfo::Filling { .. } => ("filling", None),
        SlotInfo::Ready(package) => ("ready", Some(package)),
        SlotInfo::Taken(package) => ("taken", Some(package)),
    }
}

/// Whether the next slot is free like this one, or holds the package that was sent next.
fn goes_on_in(slot: &SlotInfo, next: &SlotInfo) -> bool {
    match (slot, next) {
        (SlotInfo::Free, SlotInfo::Free) => true,
        (SlotInfo::Ready(first), SlotInfo::Ready(next)) | (SlotInfo::Taken(first), SlotInfo::Taken(next)) => {
            *next == WaitingPackage { ticket: first.ticket.wrapping_add(1), ..*first }
        }
        _ => false,
    }
}

/// How long the packages of a class waited.
fn print_bars(class: &str, latency: &Latency) -> String {
    let rows = bars(latency).into_iter().map(|Bar { from, to, packages, length }| {
        [fine(from.as_secs_f64()), fine(to.as_secs_f64()), packages.to_string(), "█".repeat(length)]
    });
    table([">from", ">to", ">packages", &format!("{class} waited")], rows)
}
