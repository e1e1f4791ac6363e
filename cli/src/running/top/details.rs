//! The page about one module: its process, its mailboxes with their waiting times, its streams, and its interface.

use super::columns::{memory, short};
use super::model::{FlowEnd, Model, Row, Sample};
use crate::look::control::control_lines;
use crate::look::summary::{Bar, bars, print_classes};
use crate::running::call::usage;
use crate::running::list::mailbox_lines;
use crate::terminal::table::{table, time};
use rohrpost::Name;
use rohrpost::interfaces::ControlState;
use rohrpost::output::plain;
use rohrpost::schema::{Description, describe_field, describe_result};
use rohrpost_config::{Installation, Program};
use rohrpost_launch::survey::{StreamSurvey, sum};
use rohrpost_mailbox::{Latency, MailboxInfo};
use std::time::Duration;

/// The page as lines; headings begin without a blank. `control`: what it told, if it is a supervisor; `describe`
/// returns a module's description.
pub(super) fn page(
    installation: &Installation,
    sample: &Sample,
    model: &Model,
    name: Name,
    (control, mut describe): (Option<&ControlState>, impl FnMut(Name) -> Option<Description>),
) -> Vec<String> {
    let Some(row) = model.row(name) else {
        return vec![format!("{} no longer exists", installation.classes.format(name))];
    };
    let mut lines = vec![format!("{}: {}", row.line.module, row.line.account.state)];
    lines.extend(indented(&about(installation, sample, row)));
    for (what, text) in control.into_iter().flat_map(control_lines) {
        lines.push(format!("  {what:<11}{text}"));
    }
    let module = sample.survey.module(name);
    let is_own = |name: Name| {
        let of = name.module();
        module.is_some_and(|module| of == module.name || module.aliases.contains(&of))
    };
    let mailboxes = sample.survey.mailboxes.iter().filter(|mailbox| is_own(mailbox.name));
    let mailboxes: Vec<MailboxInfo> = mailboxes.cloned().collect();
    if !mailboxes.is_empty() {
        lines.extend(["".into(), "mailboxes".into()]);
        lines.extend(indented(&mailbox_table(installation, &mailboxes)));
        let classes = sum(&mailboxes);
        lines.extend(["".into(), "received, by the class that packages came with".into()]);
        lines.extend(indented(&print_classes(installation, &classes)));
        lines.extend(["".into(), "how long packages waited".into()]);
        for class in &classes {
            let name = class.class.and_then(|id| installation.classes.name(id)).unwrap_or("others");
            lines.extend(histogram(name, &class.latency));
        }
    }
    let streams: Vec<_> = sample.survey.streams.iter().filter(|stream| is_own(stream.info.id.name)).collect();
    if !streams.is_empty() {
        lines.extend(["".into(), "streams".into()]);
        lines.extend(indented(&stream_table(installation, &streams)));
    }
    lines.extend(peers("sends to", &row.sends_to));
    lines.extend(peers("receives from", &row.receives_from));
    let names = module.into_iter().flat_map(|module| std::iter::once(&module.name).chain(&module.aliases));
    for alias in names {
        lines
            .extend(describe(*alias).into_iter().flat_map(|description| interface(installation, *alias, &description)));
    }
    lines
}

fn indented(text: &str) -> Vec<String> {
    text.lines().map(|line| format!("  {line}")).collect()
}

/// The module and its process.
fn about(installation: &Installation, sample: &Sample, row: &Row) -> String {
    let mut lines = Vec::new();
    let mut say = |what: &str, text: String| lines.push(format!("{what:<11}{text}"));
    if let Some(error) = &row.line.account.error {
        say("why", plain::line(error).into_owned());
    }
    let text = installation.classes.text(row.name.class()).filter(|text| !text.is_empty());
    let text = text.map_or(String::new(), |text| format!(": {text}"));
    say("class", format!("{}, priority {}{text}", row.class, row.line.priority));
    if !row.line.aliases.is_empty() {
        say("also", row.line.aliases.join(", "));
    }
    if let Some(module) = installation.module(row.name) {
        let program = match &module.program {
            Program::Builtin(name) => format!("builtin {name}"),
            Program::Command(words) => words.join(" "),
        };
        say("program", format!("{program} ({}:{})", installation.path.display(), module.line));
        let names = |names: Vec<Name>| match &names[..] {
            [] => "nobody".into(),
            names => names.iter().map(|name| installation.classes.format(*name)).collect::<Vec<_>>().join(", "),
        };
        say("calls", names(module.calls.clone()));
        let callers =
            installation.modules.iter().filter(|other| module.names().any(|name| other.calls.contains(&name)));
        say("called by", names(callers.map(|other| other.name).collect()));
    }
    let surveyed = sample.survey.module(row.name);
    if let Some(module) = surveyed
        && let Some(process) = &module.process
    {
        let since = Duration::from_secs_f64(row.uptime_s.unwrap_or(0.0));
        let restarts = match row.line.account.restarts {
            0 => String::new(),
            count => format!(", started again {count} times"),
        };
        say("process", format!("{}, for {}{restarts}, {}", process.pid, span(since), row.line.scheduling));
        if let Some(watchdog) = installation.module(row.name).and_then(|module| module.watchdog) {
            let turn = module.in_turn.map(|lasts| format!("; in a turn for {lasts:.1?}"));
            say("watchdog", format!("{watchdog}{}", turn.unwrap_or_default()));
        }
        let percent = row.cpu_percent.map_or("-".into(), |percent| format!("{percent:.1}"));
        say(
            "takes",
            format!(
                "{percent} % of a processor, {} of memory",
                row.memory_bytes.map_or("-".into(), |bytes| memory(bytes as f64))
            ),
        );
    }
    lines.join("\n")
}

/// Narrower than that of `list`: it fits into a terminal of 80 columns.
fn mailbox_table(installation: &Installation, mailboxes: &[MailboxInfo]) -> String {
    let lines = mailbox_lines(installation, mailboxes);
    let rows = mailboxes.iter().zip(lines).map(|(mailbox, line)| {
        [
            format!("{} {}", installation.classes.format(mailbox.name.module()), line.purpose),
            format!("{} x {} B", line.slots, line.body_bytes_max),
            line.full.into(),
            format!("{} (most {})", line.waiting, line.waiting_max),
            line.received.to_string(),
            line.lost_text.clone(),
        ]
    });
    table(["", ">slots", "when full", ">waiting", ">received", "lost"], rows)
}

/// Narrower than that of `list`, too.
fn stream_table(installation: &Installation, streams: &[&StreamSurvey]) -> String {
    let rows = streams.iter().map(|StreamSurvey { info, .. }| {
        let shape = &info.shape;
        [
            format!("{} {}", installation.classes.format(info.id.name.module()), info.id.number),
            format!("{} x {} B", shape.keep, shape.record_bytes),
            format!("{} of {}", info.readers, shape.readers),
            info.written.to_string(),
            info.refused.to_string(),
            memory(shape.segment_bytes() as f64),
        ]
    });
    table(["", ">records", ">readers", ">written", ">refused", ">memory"], rows)
}

/// The modules that it exchanges packages with, and the amounts.
fn peers(head: &str, peers: &[FlowEnd]) -> Vec<String> {
    if peers.is_empty() {
        return Vec::new();
    }
    let rows = peers.iter().map(|peer| {
        let per_s = peer.packages_per_s.map_or("-".into(), short);
        [peer.module.clone(), format!("{per_s}/s"), format!("{} so far", peer.packages)]
    });
    let mut lines = vec![String::new(), head.into()];
    lines.extend(indented(&table(["", ">", ">"], rows)).into_iter().skip(1));
    lines
}

/// A long time, in hours, minutes and seconds.
fn span(time: Duration) -> String {
    let seconds = time.as_secs();
    format!("{}:{:02}:{:02}", seconds / 3600, seconds / 60 % 60, seconds % 60)
}

/// Bars for the octaves of waiting times, from the shortest to the longest that occurred.
fn histogram(class: &str, latency: &Latency) -> Vec<String> {
    let bars = bars(latency);
    let lines = bars.iter().map(|Bar { to, packages, length, .. }| {
        format!("    below {:>7}  {packages:>9}  {}", time(*to), "#".repeat(*length))
    });
    let head = (!bars.is_empty()).then(|| format!("  {class}"));
    head.into_iter().chain(lines).collect()
}

/// Functions and data, as the module itself describes them.
fn interface(installation: &Installation, alias: Name, description: &Description) -> Vec<String> {
    let mut lines = vec!["".into(), format!("{} offers: {}", installation.classes.format(alias), description.text)];
    for function in &description.functions {
        lines.push(format!("  {} -> {}", usage(function), describe_result(&function.result)));
        lines.push(format!("      {}", function.text));
    }
    for item in &description.data {
        lines.push(format!("  data {}", describe_field(&item.field)));
        lines.push(format!("      {}", item.field.text));
    }
    lines
}
