//! A node with many mailboxes: opening one by name and sending there, and listing all.

use rohrpost_mailbox::{Label, Name, Node, Participant, Priority, Receiver, Shape, Type, monotonic_ns, node_directory};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;

type Done<T> = Result<T, Box<dyn Error>>;

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
pub struct Many {
    directory: tempfile::TempDir,
    node: Arc<Node>,
    receivers: Vec<Receiver>,
}

impl Many {
    /// Makes them. All belong to one participant of this process.
    ///
    /// # Errors
    /// When that cannot be; each takes a file descriptor and some 40 KiB.
    pub fn new(count: usize) -> Done<Self> {
        let directory = tempfile::Builder::new().prefix("rohrpost-bench-").tempdir_in("/dev/shm")?;
        let node = Node::create(&path_in(directory.path()), 0o700)?;
        let participant = Participant::join(&node, Name::NONE)?;
        let receivers: Result<_, _> =
            (0..count).map(|index| participant.receiver(name(index), Shape::default())).collect();
        Ok(Self { directory, node, receivers: receivers? })
    }

    /// For each mailbox, as a participant that has never seen it: nanoseconds to open it by name and to have sent there.
    /// The receivers then check that each got its package.
    ///
    /// # Errors
    /// When anything fails.
    pub fn first_sends_ns(&mut self) -> Done<Vec<u64>> {
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
    ///
    /// # Errors
    /// When a mailbox is not found.
    pub fn survey_ns(&self) -> Done<u64> {
        let began_ns = monotonic_ns();
        let node = Node::open(self.node.path())?;
        let seen = node.mailboxes()?.into_iter().filter_map(|name| node.look_at(name)).count();
        let took_ns = monotonic_ns() - began_ns;
        if seen == self.receivers.len() { Ok(took_ns) } else { Err(format!("{seen} mailboxes were seen").into()) }
    }

    /// Nanoseconds from exec to the end of `rohrpost list --mailboxes`, everything read.
    ///
    /// # Errors
    /// When the command fails or does not list all.
    pub fn list_ns(&self, rohrpost: &Path) -> Done<u64> {
        let config = self.directory.path().join("bench.toml");
        std::fs::write(&config, CONFIGURATION)?;
        let mut command = Command::new(rohrpost);
        command.args(["list", "--mailboxes", "--config"]).arg(config).env("ROHRPOST_DIR", self.directory.path());
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
