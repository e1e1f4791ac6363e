//! A node of its own for each death, and the loop over the steps.

use rohrpost_mailbox_crash::{Label, Name, Node, OverflowPolicy, Participant, Priority, Receiver, Sender, Shape, Type};
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use tempfile::TempDir;

pub(crate) const MAILBOX: Name = Name::new(1, 200, 1, 0);
/// Small, so that it is full at once.
pub(crate) const SHAPE: Shape =
    Shape { slots: 4, body_bytes_max: 64, full: OverflowPolicy::Displace, max_age: None, claims: 1 };
pub(crate) const OTHER_SHAPE: Shape = Shape { slots: 5, ..SHAPE };
pub(crate) const LATEST: Shape = Shape { full: OverflowPolicy::Latest, ..SHAPE };
pub(crate) const LOW: Priority = Priority(10);
pub(crate) const HIGH: Priority = Priority(20);

/// A node in a directory of its own.
pub(crate) struct Ground {
    path: PathBuf,
    /// The parent's, which removes it in the end.
    _directory: Option<TempDir>,
}

impl Ground {
    fn new() -> Self {
        let directory = tempfile::tempdir().unwrap();
        Self { path: directory.path().join("node"), _directory: Some(directory) }
    }

    /// The one at this path, which somebody else removes.
    pub(crate) fn at(path: &Path) -> Self {
        Self { path: path.into(), _directory: None }
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    pub(crate) fn node(&self) -> Arc<Node> {
        Node::create(&self.path, 0o700).unwrap()
    }

    pub(crate) fn join(&self) -> Arc<Participant> {
        Participant::join(&self.node(), Name::NONE).unwrap()
    }

    pub(crate) fn receiver(&self) -> Receiver {
        self.join().receiver(MAILBOX, SHAPE).unwrap()
    }

    pub(crate) fn sender(&self) -> Sender {
        self.join().sender(MAILBOX).unwrap()
    }

    /// Sends packages of these numbers.
    pub(crate) fn send(&self, priority: Priority, ids: impl IntoIterator<Item = u32>) {
        let mut sender = self.sender();
        ids.into_iter().for_each(|id| send(&mut sender, priority, id).unwrap());
    }

    /// A mailbox without owner that holds packages 0, 1, 2 of low priority.
    pub(crate) fn orphan(&self) {
        let _receiver = self.receiver();
        self.send(LOW, 0..3);
    }

    /// Does `role` (see `victim`) in a process of its own; how that ended, and the step it died at.
    pub(crate) fn run(&self, role: &str, fatal: u64) -> Option<Death> {
        let output = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "victim::victim", "--nocapture", "--test-threads=1"])
            .env("ROHRPOST_VICTIM", role)
            .env("ROHRPOST_FATAL", fatal.to_string())
            .env("ROHRPOST_GROUND", &self.path)
            .stdin(Stdio::null())
            .output()
            .unwrap();
        if output.status.success() {
            return None;
        }
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.signal(), Some(libc::SIGABRT), "{role}, step {fatal}: {errors}");
        let step = errors.lines().last().unwrap_or_default().to_owned();
        // For `tests/mistaken`, which looks for steps that no scene dies at.
        println!("died at {step}");
        Some(Death { step })
    }
}

/// How a victim ended.
#[derive(Debug)]
pub(crate) struct Death {
    /// The name of the step it died at.
    pub(crate) step: String,
}

/// The body is the number and its complement, so that a torn one is seen.
pub(crate) fn send(sender: &mut Sender, priority: Priority, id: u32) -> Result<(), rohrpost_mailbox_crash::SendError> {
    let label = Label { priority, kind: Type::command(16), ..Label::default() };
    sender.send(&label, &[&id.to_le_bytes(), &(!id).to_le_bytes()])
}

/// The scene of a role that needs nothing prepared.
pub(crate) fn nothing(_: &Ground) {}

/// Kills `role` at each step in turn; `scene` prepares, `aftermath` looks. At the last turn the victim survived and
/// `aftermath` gets none.
pub(crate) fn each_step<S>(
    role: &str,
    steps_min: u64,
    scene: impl Fn(&Ground) -> S,
    aftermath: impl Fn(&Ground, S, Option<&Death>),
) {
    for fatal in 1.. {
        let ground = Ground::new();
        let there = scene(&ground);
        let death = ground.run(role, fatal);
        aftermath(&ground, there, death.as_ref());
        if death.is_none() {
            assert!(fatal > steps_min, "{role} has only {} steps; where are the others?", fatal - 1);
            return;
        }
    }
}
