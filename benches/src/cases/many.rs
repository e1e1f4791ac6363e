//! A node with many mailboxes: opening one by name and sending there, and listing all.
//!
//! Each turn makes its node anew, in a process of its own.

use super::errors::{Done, as_failure};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{End, Placement, Samples, Scheduling, Scratch, sample_in_child, settle};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, at_most, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_bench_local::statistics::Summary;
use rohrpost_mailbox::{Label, Name, Node, Participant, Priority, Receiver, Shape, Type, monotonic_ns, node_directory};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

const MAILBOXES: usize = 1_000;
/// Times that all are listed in a turn.
const LISTINGS: usize = 11;
const PATIENCE: Duration = Duration::from_secs(60);

/// All of them.
pub(super) fn cases() -> Vec<Case> {
    let what = [MailboxAction::FirstSend, MailboxAction::Survey, MailboxAction::List];
    what.map(|what| {
        Case::new(what.name(), BODY.len(), "us", move |settings, subject| Ok(what.measure(settings, subject)))
    })
    .into()
}

/// What is done with the mailboxes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum MailboxAction {
    /// Each is opened by name and gets its first package.
    FirstSend,
    /// The library looks at all of them.
    Survey,
    /// The command lists all of them.
    List,
}

impl MailboxAction {
    fn name(self) -> &'static str {
        match self {
            Self::FirstSend => "many-first-send",
            Self::Survey => "many-survey",
            Self::List => "many-list",
        }
    }

    fn limit(self) -> (&'static str, f64) {
        match self {
            Self::FirstSend => ("100 us", 100.0),
            Self::Survey | Self::List => ("50 ms", 50_000.0),
        }
    }

    fn turn(self, settings: &Settings, samples: &Samples) -> Done<()> {
        // Before the node is made: what a turn cannot do without is not there.
        let rohrpost = if self == Self::List { Some(settings.command()?) } else { None };
        let mut many = Many::new(settings.count(MAILBOXES))?;
        settle(End::Ping, Placement::TwoCores, Scheduling::Fifo)?;
        let all_ns = match self {
            Self::FirstSend => many.first_sends_ns()?,
            Self::Survey => (0..settings.count(LISTINGS)).map(|_| many.survey_ns()).collect::<Done<_>>()?,
            Self::List => {
                let rohrpost = rohrpost.unwrap_or_default();
                (0..settings.count(LISTINGS)).map(|_| many.list_ns(&rohrpost)).collect::<Done<_>>()?
            }
        };
        all_ns.into_iter().for_each(|ns| samples.push(ns as f64 / 1000.0));
        Ok(())
    }

    fn measure(self, settings: &Settings, subject: &Subject) -> Vec<Row> {
        let ours = Contender::sampled("rohrpost", || {
            sample_in_child(PATIENCE, |samples| self.turn(settings, samples).map_err(as_failure("many mailboxes")))
        });
        let (name, limit_us) = self.limit();
        let limit = Contender::fixed(name, Summary { p99: Some(limit_us), ..Summary::single(limit_us) });
        compare(settings, subject, &[ours, limit.beside(at_most(1.0), at_most(1.0))])
    }
}

const INSTALLATION: &str = "bench";
const NODE: &str = "main";
/// Never launched: it only tells where the node lies. The mailboxes are of class 100 and above.
const CONFIGURATION: &str = r#"
installation = "bench"
[system]
name = "bench"
id = 1
[classes]
output = { id = 32, text = "Collects what modules say" }
tool = { id = 16, text = "Tools" }
[nodes.main]
[[module]]
name = "output.0"
builtin = "output"
"#;
const BODY: &[u8] = &[7; 64];

/// A node and the receivers of all its mailboxes, each of the default shape.
struct Many {
    scratch: Scratch,
    node: Arc<Node>,
    receivers: Vec<Receiver>,
}

impl Many {
    /// Makes them. All belong to one participant of this process.
    fn new(count: usize) -> Done<Self> {
        let scratch = Scratch::new()?;
        let node = Node::create(&path_in(&scratch.directory()), 0o700)?;
        let participant = Participant::join(&node, Name::NONE)?;
        let receivers: Result<_, _> =
            (0..count).map(|index| participant.receiver(name(index), Shape::default())).collect();
        Ok(Self { scratch, node, receivers: receivers? })
    }

    /// For each mailbox, as a participant that has never seen it: nanoseconds to open it by name and to have sent
    /// there. The receivers then check that each got its package.
    fn first_sends_ns(&mut self) -> Done<Vec<u64>> {
        let participant = Participant::join(&Node::open(self.node.path())?, Name::NONE)?;
        let label = Label { kind: Type::data(0), priority: Priority(100), ..Label::default() };
        let mut senders = Vec::with_capacity(self.receivers.len());
        let mut took_ns = Vec::with_capacity(self.receivers.len());
        for receiver in &self.receivers {
            let began_ns = monotonic_ns();
            let mut sender = participant.sender(receiver.name())?;
            sender.send(&label, &[BODY])?;
            took_ns.push(monotonic_ns() - began_ns);
            senders.push(sender);
        }
        for receiver in &mut self.receivers {
            let name = receiver.name();
            match receiver.try_receive() {
                Some(package) if package.body() == BODY => {}
                _ => return Err(format!("{name} has not got what was sent there").into()),
            }
        }
        Ok(took_ns)
    }

    /// Nanoseconds that the library takes to open the node and to look at every mailbox.
    fn survey_ns(&self) -> Done<u64> {
        let began_ns = monotonic_ns();
        let node = Node::open(self.node.path())?;
        let seen = node.mailboxes()?.into_iter().filter_map(|name| node.look_at(name)).count();
        let took_ns = monotonic_ns() - began_ns;
        if seen == self.receivers.len() { Ok(took_ns) } else { Err(format!("{seen} mailboxes were seen").into()) }
    }

    /// Nanoseconds from exec to the end of `rohrpost list --mailboxes`, everything read.
    fn list_ns(&self, rohrpost: &Path) -> Done<u64> {
        let config = self.scratch.directory().join("bench.toml");
        std::fs::write(&config, CONFIGURATION)?;
        let mut command = Command::new(rohrpost);
        command.args(["list", "--mailboxes", "--config"]).arg(config).env("ROHRPOST_DIR", self.scratch.directory());
        let began_ns = monotonic_ns();
        let output = command.stdin(Stdio::null()).stderr(Stdio::inherit()).output()?;
        let took_ns = monotonic_ns() - began_ns;
        let text = String::from_utf8(output.stdout)?;
        let listed = text.lines().filter(|line| line.contains("32 x 1024 B")).count();
        if output.status.success() && listed == self.receivers.len() {
            return Ok(took_ns);
        }
        Err(format!("{}: {}, {listed} mailboxes listed\n{text}", rohrpost.display(), output.status).into())
    }
}

/// Where the library and the command look for the node when `ROHRPOST_DIR` is `base`.
fn path_in(base: &Path) -> PathBuf {
    let file = node_directory(INSTALLATION, NODE);
    base.join(file.file_name().unwrap_or_default())
}

fn name(index: usize) -> Name {
    Name::new(1, 100 + (index / 256) as u8, (index % 256) as u8, 0)
}
