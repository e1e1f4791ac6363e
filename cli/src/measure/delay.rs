//! `rohrpost delay`: how long packages wait in mailboxes, and how old data are when they are published.

use crate::look::published::{WatchedModule, data_of};
use crate::look::summary::class_name;
use crate::look::target::{Running, Target};
use crate::measure::watch::{Pace, Window};
use crate::terminal::table::table;
use crate::terminal::units::short;
use crate::terminal::{Failure, say};
use rohrpost::Name;
use rohrpost_launch::survey::{Scope, Survey, purpose};
use rohrpost_mailbox::{Class, ClassTraffic, FlowInfo, Kind, Latency, MailboxInfo};
use serde::Serialize;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost delay mapper.0             by mailbox and class, once a second; Ctrl-C ends it
  rohrpost delay mapper.0 --count 1 --window 5
  rohrpost delay laser.0 --json       also how long its data wait at the subscribers
The waiting time runs from publishing a package to taking it. The mean is exact; p50 and p99 come from a histogram \
    and are accurate to about 25 %; the longest is that since the mailbox was created. The tool reads counters, on \
    other nodes through their launches: it sends nothing to the modules.")]
pub(crate) struct Arguments {
    /// Module or alias, such as mapper.0.
    name: String,
    #[command(flatten)]
    target: Target,
    #[command(flatten)]
    pace: Pace,
}

/// The waits of one class in one mailbox.
#[derive(Clone)]
struct Wait {
    mailbox: Name,
    class: Option<Class>,
    latency: Latency,
}

/// One observation.
struct ObservedDelays {
    waits: Window<Vec<Wait>>,
    module: WatchedModule,
}

#[derive(Serialize)]
struct WaitLine {
    mailbox: String,
    purpose: &'static str,
    /// A mailbox of another module, to which this module sends data.
    subscriber: bool,
    class: String,
    received: u64,
    waited_mean_s: Option<f64>,
    waited_p50_s: Option<f64>,
    waited_p99_s: Option<f64>,
    waited_max_ever_s: f64,
}

#[derive(Serialize)]
struct AgeLine {
    data: String,
    values: u64,
    age_mean_s: Option<f64>,
}

#[derive(Serialize)]
struct Delays<'a> {
    module: &'a str,
    waits: Vec<WaitLine>,
    published: Vec<AgeLine>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let long = arguments.pace.window()?;
    let mut module = WatchedModule::new(&arguments.target, &arguments.name, long)?;
    module.require_present()?;
    let mut names = data_of(&module.running, module.module, None).unwrap_or_default();
    let mut observed = ObservedDelays { waits: Window::new(long), module };
    let look = |observed: &mut ObservedDelays| {
        let ObservedDelays { waits: window, module } = observed;
        let Some(survey) = module.look()? else { return Ok(()) };
        let waits = waits(&module.running, module.module, &survey)?;
        if window.ends().is_some_and(|(_, before)| begins_anew(before, &waits)) {
            *window = Window::new(long);
        }
        window.push(survey.at_ns, waits);
        module.take_published(survey);
        Ok(())
    };
    let tell = |observed: &mut ObservedDelays| {
        observed.module.renew(&mut names, None);
        let module = observed.module.name();
        let delays = delays(&module, observed, &names);
        Ok(say(if arguments.pace.json { serde_json::to_string(&delays)? } else { in_text(&delays) }))
    };
    arguments.pace.watch(&mut observed, look, tell)?;
    Ok(ExitCode::SUCCESS)
}

/// Whether mailboxes were created anew and count from 0, for example after their node was launched again.
fn begins_anew(before: &[Wait], now: &[Wait]) -> bool {
    let known = |wait: &Wait| before.iter().find(|known| (known.mailbox, known.class) == (wait.mailbox, wait.class));
    now.iter().any(|wait| known(wait).is_some_and(|known| wait.latency.count() < known.latency.count()))
}

/// Waits in the module's mailboxes and in the mailboxes that it sends data to, on any node. Nodes that do not answer
/// are left out.
fn waits(running: &Running, module: Name, survey: &Survey) -> Result<Vec<Wait>, Failure> {
    let is_sent = |flow: &&FlowInfo| matches!(flow.kind.kind(), Kind::Data(_)) && !flow.is_publication();
    let sent: Vec<Name> =
        survey.flows.iter().filter(is_sent).filter(|flow| flow.from.module() == module).map(|flow| flow.to).collect();
    let mut others: Vec<&str> =
        sent.iter().map(|to| running.node_of(*to)).filter(|node| *node != survey.node).collect();
    others.sort_unstable();
    others.dedup();
    let elsewhere = running.look_at(&others, Scope::Module(module.raw()))?;
    let seen = elsewhere.iter().flatten().chain([survey]).flat_map(|survey| &survey.mailboxes);
    let of = |mailbox: &&MailboxInfo| mailbox.name.module() == module || sent.contains(&mailbox.name);
    let mut mailboxes: Vec<&MailboxInfo> = seen.filter(of).collect();
    mailboxes.sort_unstable_by_key(|mailbox| (mailbox.name.module() != module, mailbox.name));
    let wait = |mailbox: Name| {
        move |class: &ClassTraffic| Wait { mailbox, class: class.class, latency: class.latency.clone() }
    };
    Ok(mailboxes.into_iter().flat_map(|mailbox| mailbox.classes.iter().map(wait(mailbox.name))).collect())
}

fn delays<'a>(name: &'a str, observed: &ObservedDelays, names: &[(u16, String)]) -> Delays<'a> {
    let installation = &observed.module.running.installation;
    let (earlier, now) = observed.waits.ends().map_or((&[][..], &[][..]), |(a, b)| (&a[..], &b[..]));
    let line = |wait: &Wait| {
        let before = earlier.iter().find(|known| (known.mailbox, known.class) == (wait.mailbox, wait.class));
        let latency = before.map_or(wait.latency.clone(), |before| wait.latency.since(&before.latency));
        WaitLine {
            mailbox: installation.classes.format_full(wait.mailbox),
            purpose: purpose(wait.mailbox.local()),
            subscriber: wait.mailbox.module() != observed.module.module,
            class: class_name(installation, wait.class),
            received: latency.count(),
            waited_mean_s: latency.mean().map(|mean| mean.as_secs_f64()),
            waited_p50_s: latency.quantile(0.5).map(|found| found.as_secs_f64()),
            waited_p99_s: latency.quantile(0.99).map(|found| found.as_secs_f64()),
            waited_max_ever_s: latency.max.as_secs_f64(),
        }
    };
    let age = |(number, name): &(u16, String)| {
        let figures = observed.module.figures(*number).unwrap_or_default();
        AgeLine { data: name.clone(), values: figures.packages, age_mean_s: figures.age_mean_s }
    };
    Delays { module: name, waits: now.iter().map(line).collect(), published: names.iter().map(age).collect() }
}

fn in_text(delays: &Delays<'_>) -> String {
    let or_none = |seconds: Option<f64>| seconds.map_or("-".into(), short);
    let rows = delays.waits.iter().map(|line| {
        [
            line.mailbox.clone(),
            if line.subscriber { format!("{} (subscribed)", line.purpose) } else { line.purpose.into() },
            line.class.clone(),
            line.received.to_string(),
            or_none(line.waited_mean_s),
            or_none(line.waited_p50_s),
            or_none(line.waited_p99_s),
            short(line.waited_max_ever_s),
        ]
    });
    let heads = ["mailbox", "for", "class", ">received", ">waited mean", ">p50", ">p99", ">max ever"];
    let mut text = table(heads, rows);
    if !delays.published.is_empty() {
        let rows =
            delays.published.iter().map(|line| [line.data.clone(), line.values.to_string(), or_none(line.age_mean_s)]);
        text.push('\n');
        text.push_str(&table(["published", ">values", ">age mean"], rows));
    }
    text
}
