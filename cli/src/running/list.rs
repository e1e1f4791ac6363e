//! `rohrpost list`.

use crate::look::observer::Silence;
use crate::look::summary::{Losses, ModuleLine, losses, module_lines, print_modules};
use crate::look::target::{Running, Target};
use crate::measure::stream::{StreamView, name_items, print_streams, stream_views};
use crate::terminal::table::table;
use crate::terminal::{Failure, say};
use rohrpost::Name;
use rohrpost::interfaces::{BeyondHost, BeyondHosts};
use rohrpost::output::plain;
use rohrpost_config::Installation;
use rohrpost_launch::survey::{Scope, node_of, purpose};
use rohrpost_mailbox::{Loss, MailboxInfo, saturating_sum};
use serde::Serialize;
use std::process::ExitCode;

#[derive(clap::Args)]
#[command(after_help = "Example: rohrpost list --mailboxes\nLists all nodes; --node lists one. Reading the counters \
        disturbs nobody.")]
pub(crate) struct Arguments {
    #[command(flatten)]
    target: Target,
    /// List mailboxes too.
    #[arg(long, short)]
    mailboxes: bool,
    /// List streams too.
    #[arg(long, short)]
    streams: bool,
    /// One JSON object.
    #[arg(long)]
    json: bool,
}

/// A mailbox, as the tables show it.
#[derive(Serialize)]
pub(crate) struct MailboxLine {
    pub(crate) node: String,
    pub(crate) mailbox: String,
    pub(crate) purpose: &'static str,
    pub(crate) owner: Option<u32>,
    pub(crate) slots: u16,
    pub(crate) body_bytes_max: u16,
    pub(crate) full: &'static str,
    pub(crate) waiting: u32,
    pub(crate) waiting_max: u32,
    pub(crate) sent: u64,
    pub(crate) received: u64,
    #[serde(flatten)]
    pub(crate) losses: Losses,
    /// Its state in words.
    #[serde(skip)]
    pub(crate) lost_text: String,
}

/// A node, and whether it answers.
#[derive(Serialize)]
pub(crate) struct NodeLine {
    node: String,
    /// Why not, if it does not answer.
    silent: Option<String>,
    /// For how long, as far as it is known.
    silent_s: Option<f64>,
}

/// These nodes, and those of them that do not answer.
pub(crate) fn node_lines(nodes: &[&str], silent: &[Silence]) -> Vec<NodeLine> {
    let line = |node: &&str| {
        let silence = silent.iter().find(|silence| silence.node == *node);
        NodeLine {
            node: (*node).into(),
            silent: silence.map(|silence| silence.why.clone()),
            silent_s: silence.and_then(|silence| silence.silent_s),
        }
    };
    nodes.iter().map(line).collect()
}

/// A name that is registered at the TCP router and in no configuration here.
#[derive(Serialize)]
struct BeyondLine {
    module: String,
    system: u8,
    /// The client that hosts it.
    by: String,
}

#[derive(Serialize)]
struct Listing<'a> {
    installation: &'a str,
    /// The node that the tool runs on.
    node: &'a str,
    nodes: Vec<NodeLine>,
    modules: Vec<ModuleLine>,
    mailboxes: Vec<MailboxLine>,
    streams: Vec<StreamView>,
    beyond: Vec<BeyondLine>,
    /// Ranges of names that the TCP router did not list, for lack of room.
    beyond_more: u64,
    /// Why the names are not known; none also without a TCP router.
    beyond_silent: Option<String>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let running = arguments.target.find()?;
    let all = arguments.mailboxes || arguments.streams || arguments.json;
    let scope = if all { Scope::Mailboxes } else { Scope::Modules };
    let (survey, silent) = running.survey(scope)?;
    let nodes = running.shown();
    let (beyond, beyond_more, beyond_silent) = match running.hosts_beyond() {
        None => (Vec::new(), 0, None),
        Some(Ok(hosts)) => (beyond(&running, &hosts), hosts.more, None),
        Some(Err(why)) => (Vec::new(), 0, Some(why.to_string())),
    };
    let mut streams = stream_views(&running.installation, &survey.streams);
    name_items(&running, &mut streams);
    let listing = Listing {
        installation: &running.installation.name,
        node: &running.node_name,
        nodes: node_lines(&nodes, &silent),
        modules: module_lines(&running.installation, &survey, None),
        mailboxes: mailbox_lines(&running.installation, &survey.mailboxes),
        streams,
        beyond,
        beyond_more,
        beyond_silent,
    };
    if arguments.json {
        say(serde_json::to_string(&listing)?);
        return Ok(ExitCode::SUCCESS);
    }
    let several = nodes.len() > 1;
    if several {
        say(format_args!("nodes {} of {}, seen from {}\n", nodes.join(", "), listing.installation, listing.node));
    } else {
        say(format_args!("node {} of {}\n", nodes.join(", "), listing.installation));
    }
    say(print_modules(&listing.modules, several).trim_end());
    if !listing.beyond.is_empty() {
        let rows = listing.beyond.iter().map(|line| [line.module.clone(), line.system.to_string(), line.by.clone()]);
        let table = table(["beyond", ">system", "by"], rows);
        say(format_args!("\n{}(modules at the TCP router that this configuration does not have)", table));
    }
    if listing.beyond_more > 0 {
        say(format_args!(
            "(the TCP router knows {} more ranges of names, of this system or others, than fit into its report)",
            listing.beyond_more
        ));
    }
    if let Some(why) = &listing.beyond_silent {
        say(format_args!("\nmodules at the TCP router are not known: {}", plain::line(why)));
    }
    if !silent.is_empty() {
        let lines: Vec<String> = silent.iter().map(Silence::text).collect();
        say(format_args!("\n{}", lines.join("\n")));
    }
    if arguments.mailboxes {
        say(format_args!("\n{}", print_mailboxes(&listing.mailboxes).trim_end()));
    }
    if arguments.streams {
        let streams = print_streams(&listing.streams, several);
        say(format_args!("\n{}", if listing.streams.is_empty() { "no streams" } else { streams.trim_end() }));
    }
    Ok(ExitCode::SUCCESS)
}

/// Modules that the TCP router knows and the configuration does not.
fn beyond(running: &Running, hosts: &BeyondHosts) -> Vec<BeyondLine> {
    let line = |host: &BeyondHost| {
        let (name, last) = (Name::from_raw(host.first).module(), Name::from_raw(host.last).module());
        let text = |name| running.text(name);
        let module = if name == last { text(name) } else { format!("{} to {}", text(name), text(last)) };
        BeyondLine { module, system: name.system(), by: host.client.clone() }
    };
    hosts.hosts.iter().filter(|host| running.is_outside(host)).map(line).collect()
}

pub(crate) fn mailbox_lines(installation: &Installation, mailboxes: &[MailboxInfo]) -> Vec<MailboxLine> {
    mailboxes.iter().map(|mailbox| mailbox_line(installation, mailbox)).collect()
}

fn mailbox_line(installation: &Installation, mailbox: &MailboxInfo) -> MailboxLine {
    let lost = |cause: Loss| saturating_sum(mailbox.classes.iter().map(|class| class.lost(cause)));
    MailboxLine {
        node: node_of(installation, mailbox.name).unwrap_or_default().into(),
        mailbox: installation.classes.format_full(mailbox.name),
        purpose: purpose(mailbox.name.local()),
        owner: mailbox.owner,
        slots: mailbox.shape.slots,
        body_bytes_max: mailbox.shape.body_bytes_max,
        full: mailbox.shape.full.name(),
        waiting: mailbox.depth,
        waiting_max: mailbox.depth_max,
        sent: mailbox.sent,
        received: saturating_sum(mailbox.classes.iter().map(|class| class.received)),
        losses: Losses::new(&Loss::ALL.map(lost)),
        lost_text: losses(lost),
    }
}

fn print_mailboxes(lines: &[MailboxLine]) -> String {
    let rows = lines.iter().map(|line| {
        [
            line.mailbox.clone(),
            line.purpose.into(),
            line.owner.map_or("nobody".into(), |pid| pid.to_string()),
            format!("{} x {} B", line.slots, line.body_bytes_max),
            line.full.into(),
            format!("{} (most {})", line.waiting, line.waiting_max),
            line.sent.to_string(),
            line.received.to_string(),
            line.lost_text.clone(),
        ]
    });
    table(["mailbox", "for", ">owner", ">slots", "when full", ">waiting", ">sent", ">received", "lost"], rows)
}
