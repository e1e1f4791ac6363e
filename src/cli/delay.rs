//! `rohrpost delay`: how long packages wait to be taken, and how old data are when they are published.

use super::published::{Watched, data_of};
use super::summary::class_name;
use super::table::table;
use super::target::{Running, Target};
use super::units::short;
use super::watch::{Pace, Window};
use super::{Failure, say};
use rohrpost::Name;
use rohrpost::mailbox::{Class, Kind, Latency};
use rohrpost::survey::purpose;
use serde::Serialize;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost delay mapper.0             by mailbox and class, once a second; Ctrl-C ends it
  rohrpost delay mapper.0 --count 1 --window 5
  rohrpost delay laser.0 --json       also how long its data wait for those that subscribed
A package waits from being published to being taken. The mean is exact; p50 and p99 come from a histogram and are \
right to a quarter or so; the longest is that of the mailbox's whole life. It reads counters: nothing is sent.")]
pub(super) struct Arguments {
    /// Module or face, such as mapper.0.
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

/// What the tool looks at.
struct Looked {
    waits: Window<Vec<Wait>>,
    module: Watched,
}

#[derive(Serialize)]
struct WaitLine {
    mailbox: String,
    purpose: &'static str,
    /// Somebody else's, to which this module sends data.
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

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let long = arguments.pace.window()?;
    let module = Watched::new(&arguments.target, &arguments.name, long)?;
    module.running.present(&arguments.name)?;
    let mut names = data_of(&module.running, module.module, None).unwrap_or_default();
    let mut looked = Looked { waits: Window::new(long), module };
    let look = |looked: &mut Looked| {
        let Looked { waits: window, module } = looked;
        if module.find_again()? {
            *window = Window::new(long);
        }
        // Its directory goes with a node that has ended; there is nothing to be seen until the next.
        match waits(&module.running, module.module) {
            Ok(waits) => window.push(waits),
            Err(_) if module.waits_for_launch() => window.push(Vec::new()),
            Err(error) => return Err(error),
        }
        let flows = module.published();
        module.tracks.look(flows);
        Ok(())
    };
    let tell = |looked: &mut Looked| {
        looked.module.renew(&mut names, None);
        let delays = delays(&arguments.name, looked, &names);
        Ok(say(if arguments.pace.json { serde_json::to_string(&delays)? } else { in_text(&delays) }))
    };
    arguments.pace.watch(&mut looked, look, tell)?;
    Ok(ExitCode::SUCCESS)
}

/// Waits in the module's mailboxes, and in those that it sends data to.
fn waits(running: &Running, module: Name) -> Result<Vec<Wait>, Failure> {
    let data = running.node.traffic().into_iter().filter(|flow| matches!(flow.kind.kind(), Kind::Data(_)));
    let sent = data.filter(|flow| !flow.is_publication() && flow.from.module() == module).map(|flow| flow.to);
    let own = running.node.mailboxes()?.into_iter().filter(|mailbox| mailbox.module() == module);
    let mut mailboxes: Vec<Name> = own.chain(sent).collect();
    mailboxes.sort_unstable_by_key(|mailbox| (mailbox.module() != module, *mailbox));
    mailboxes.dedup();
    let infos = mailboxes.into_iter().filter_map(|mailbox| running.node.look_at(mailbox));
    let wait = |mailbox: Name| {
        move |class: rohrpost::mailbox::ClassTraffic| Wait { mailbox, class: class.class, latency: class.latency }
    };
    Ok(infos.flat_map(|info| info.classes.into_iter().map(wait(info.name))).collect())
}

fn delays<'a>(name: &'a str, looked: &Looked, names: &[(u16, String)]) -> Delays<'a> {
    let installation = &looked.module.running.installation;
    let (earlier, now) = looked.waits.ends().map_or((&[][..], &[][..]), |(a, b)| (&a[..], &b[..]));
    let line = |wait: &Wait| {
        let before = earlier.iter().find(|known| (known.mailbox, known.class) == (wait.mailbox, wait.class));
        let latency = before.map_or(wait.latency.clone(), |before| wait.latency.since(&before.latency));
        WaitLine {
            mailbox: installation.classes.format_full(wait.mailbox),
            purpose: purpose(wait.mailbox.local()),
            subscriber: wait.mailbox.module() != looked.module.module,
            class: class_name(installation, wait.class),
            received: latency.count(),
            waited_mean_s: latency.mean().map(|mean| mean.as_secs_f64()),
            waited_p50_s: latency.quantile(0.5).map(|found| found.as_secs_f64()),
            waited_p99_s: latency.quantile(0.99).map(|found| found.as_secs_f64()),
            waited_max_ever_s: latency.max.as_secs_f64(),
        }
    };
    let age = |(number, name): &(u16, String)| {
        let figures = looked.module.figures(*number).unwrap_or_default();
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
