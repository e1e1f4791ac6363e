//! `rohrpost delay`: how long packages wait to be taken, and how old data are when they are published.

use super::hz::{data_of, published, short};
use super::table::{table, time};
use super::target::{Running, Target};
use super::watch::{Pace, Tracks, Window};
use super::{Failure, say};
use rohrpost::mailbox::{Class, Kind, Latency, Type};
use rohrpost::survey::purpose;
use rohrpost::{Name, config::Installation};
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

struct Watched {
    waits: Window<Vec<Wait>>,
    data: Tracks,
}

#[derive(Serialize)]
struct WaitLine {
    mailbox: String,
    purpose: &'static str,
    /// Somebody else's, to which this module sends data.
    subscriber: bool,
    class: String,
    received: u64,
    mean_s: Option<f64>,
    p50_s: Option<f64>,
    p99_s: Option<f64>,
    max_ever_s: f64,
}

#[derive(Serialize)]
struct AgeLine {
    data: String,
    values: u64,
    age_mean_s: Option<f64>,
}

#[derive(Serialize)]
struct Delays {
    waits: Vec<WaitLine>,
    published: Vec<AgeLine>,
}

pub(super) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let running = arguments.target.find()?;
    let module = running.present(&arguments.name)?;
    let names = data_of(&running, module, None).unwrap_or_default();
    let long = arguments.pace.window()?;
    let mut watched = Watched { waits: Window::new(long), data: Tracks::new(long) };
    let look = |watched: &mut Watched| {
        watched.waits.push(waits(&running, module)?);
        watched.data.look(published(&running, module));
        Ok(())
    };
    let tell = |watched: &mut Watched| {
        let delays = delays(&running.installation, module, watched, &names);
        Ok(say(if arguments.pace.json { serde_json::to_string(&delays)? } else { in_text(&delays) }))
    };
    arguments.pace.watch(&mut watched, look, tell)?;
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

fn delays(installation: &Installation, module: Name, watched: &Watched, names: &[(u16, String)]) -> Delays {
    let (earlier, now) = watched.waits.ends().map_or((&[][..], &[][..]), |(a, b)| (&a[..], &b[..]));
    let line = |wait: &Wait| {
        let before = earlier.iter().find(|known| (known.mailbox, known.class) == (wait.mailbox, wait.class));
        let latency = before.map_or(wait.latency.clone(), |before| wait.latency.since(&before.latency));
        let class = wait.class.map_or("others".into(), |class| {
            installation.classes.name(class).map_or_else(|| class.0.to_string(), ToOwned::to_owned)
        });
        WaitLine {
            mailbox: installation.classes.format_full(wait.mailbox),
            purpose: purpose(wait.mailbox.local()),
            subscriber: wait.mailbox.module() != module,
            class,
            received: latency.count(),
            mean_s: latency.mean().map(|mean| mean.as_secs_f64()),
            p50_s: latency.quantile(0.5).map(|found| found.as_secs_f64()),
            p99_s: latency.quantile(0.99).map(|found| found.as_secs_f64()),
            max_ever_s: latency.max.as_secs_f64(),
        }
    };
    let age = |(number, name): &(u16, String)| {
        let figures = watched.data.figures().find(|(flow, _)| flow.kind == Type::data(*number)).map(|(_, found)| found);
        let figures = figures.unwrap_or_default();
        AgeLine { data: name.clone(), values: figures.packages, age_mean_s: figures.age_mean_s }
    };
    Delays { waits: now.iter().map(line).collect(), published: names.iter().map(age).collect() }
}

fn in_text(delays: &Delays) -> String {
    let or_none = |seconds: Option<f64>| seconds.map_or("-".into(), short);
    let rows = delays.waits.iter().map(|line| {
        [
            line.mailbox.clone(),
            if line.subscriber { format!("{} (subscribed)", line.purpose) } else { line.purpose.into() },
            line.class.clone(),
            line.received.to_string(),
            or_none(line.mean_s),
            or_none(line.p50_s),
            or_none(line.p99_s),
            time(std::time::Duration::from_secs_f64(line.max_ever_s)),
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
