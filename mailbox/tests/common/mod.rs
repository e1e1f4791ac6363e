//! A node of its own for each test, and processes that use it: the test binary starts itself again in a role.

#![allow(dead_code, reason = "each test binary uses its part")]
#![allow(clippy::unwrap_used, reason = "these are tests")]

pub(crate) mod board;
pub(crate) mod crew;
pub(crate) mod hands;
pub(crate) mod load;
pub(crate) mod random;
pub(crate) mod records;
pub(crate) mod small_memory;
pub(crate) mod stream_load;

use rohrpost_mailbox::{
    Label, Loss, MailboxInfo, Name, Node, OverflowPolicy, Participant, Priority, Receiver, Sender, Shape, Type,
};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::mpsc;
use std::time::{Duration, Instant};
use tempfile::TempDir;

pub(crate) const MAILBOX: Name = Name::new(1, 200, 1, 0);
pub(crate) const OTHER: Name = Name::new(1, 201, 1, 0);
pub(crate) const LOW: Priority = Priority(10);
pub(crate) const HIGH: Priority = Priority(20);
/// Nothing here takes so long, unless it never ends.
pub(crate) const PATIENCE: Duration = Duration::from_secs(60);

pub(crate) fn shape(slots: u16) -> Shape {
    Shape { slots, body_bytes_max: 256, full: OverflowPolicy::Displace, max_age: None, claims: 1 }
}

/// A node in a directory of its own.
pub(crate) struct Ground {
    path: PathBuf,
    /// None in a child: its parent removes it.
    _directory: Option<TempDir>,
}

impl Ground {
    pub(crate) fn new() -> Self {
        Self::within(tempfile::tempdir().unwrap())
    }

    /// One that is there.
    pub(crate) fn made() -> (Self, Arc<Node>) {
        let ground = Self::new();
        let node = ground.node();
        (ground, node)
    }

    /// One with a participant.
    pub(crate) fn joined() -> (Self, Arc<Participant>) {
        let ground = Self::new();
        let me = ground.join();
        (ground, me)
    }

    /// One with [`MAILBOX`], its owner and its receiver.
    pub(crate) fn owned(shape: Shape) -> (Self, Arc<Participant>, Receiver) {
        let (ground, me) = Self::joined();
        let receiver = me.receiver(MAILBOX, shape).unwrap();
        (ground, me, receiver)
    }

    /// One with both ends of [`MAILBOX`], of a participant each.
    pub(crate) fn ends(shape: Shape) -> (Self, Receiver, Sender) {
        let (ground, _, receiver) = Self::owned(shape);
        let sender = ground.sender();
        (ground, receiver, sender)
    }

    pub(crate) fn within(directory: TempDir) -> Self {
        Self { path: directory.path().join("node"), _directory: Some(directory) }
    }

    /// In shared memory, as real nodes are: for tests that send millions of packages, which a disk would want to keep.
    pub(crate) fn in_memory() -> Self {
        let directory = tempfile::Builder::new().prefix("rohrpost-test-").tempdir_in("/dev/shm").unwrap();
        Self { path: directory.path().join("node"), _directory: Some(directory) }
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

    pub(crate) fn sender(&self) -> Sender {
        self.join().sender(MAILBOX).unwrap()
    }

    pub(crate) fn look(&self) -> MailboxInfo {
        self.node().look_at(MAILBOX).unwrap()
    }

    /// This test binary once more, in this role (see [`role`]).
    pub(crate) fn start(&self, role: &str) -> Process {
        self.start_with(role, |_| ())
    }

    /// The same, prepared in some way.
    pub(crate) fn start_with(&self, role: &str, prepare: impl FnOnce(&mut Command)) -> Process {
        self.start_by(Command::new(std::env::current_exe().unwrap()), role, prepare)
    }

    /// By another program; its command line ends with this binary.
    #[allow(dead_code, reason = "each test uses a part")]
    pub(crate) fn start_behind(&self, program: &str, arguments: &[&str], role: &str) -> Process {
        let mut command = Command::new(program);
        command.args(arguments).arg(std::env::current_exe().unwrap());
        self.start_by(command, role, |_| ())
    }

    fn start_by(&self, mut command: Command, role: &str, prepare: impl FnOnce(&mut Command)) -> Process {
        command
            .args(["--exact", "role", "--nocapture", "--test-threads=1"])
            .env("ROHRPOST_TEST_ROLE", role)
            .env("ROHRPOST_TEST_GROUND", &self.path)
            .stdin(Stdio::null())
            .stdout(Stdio::piped());
        prepare(&mut command);
        let mut child = command.spawn().unwrap();
        let output = BufReader::new(child.stdout.take().unwrap());
        let (tell, told) = mpsc::channel();
        std::thread::spawn(move || {
            let lines = output.lines().map_while(Result::ok);
            // The child's test harness writes too, and ends no line before its test.
            for line in lines {
                if let Some((_, told)) = line.split_once('@') {
                    let _ = tell.send(told.to_owned());
                }
            }
        });
        Process { child, told }
    }
}

/// In a process that [`Ground::start`] made: its role. None in the test binary that the user started.
pub(crate) fn role() -> Option<(String, Ground)> {
    let role = std::env::var("ROHRPOST_TEST_ROLE").ok()?;
    let path = std::env::var_os("ROHRPOST_TEST_GROUND")?.into();
    // Dies with the test that started it.
    // SAFETY: takes numbers only.
    unsafe { libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL) };
    Some((role, Ground { path, _directory: None }))
}

/// In a child: tells its parent.
pub(crate) fn tell(what: impl std::fmt::Display) {
    println!("@{what}");
}

/// A started process; killed when dropped.
pub(crate) struct Process {
    child: std::process::Child,
    told: mpsc::Receiver<String>,
}

impl Process {
    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// What it tells next.
    pub(crate) fn hear(&self) -> String {
        self.told.recv_timeout(PATIENCE).expect("a child said nothing; it died or hangs")
    }

    /// It must still live: one that ended by itself found something wrong.
    pub(crate) fn kill(mut self) {
        assert_eq!(self.child.try_wait().unwrap(), None, "it ended by itself");
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// A line into its standard input, if it was started with one.
    pub(crate) fn answer(&self, line: &str) {
        writeln!(self.child.stdin.as_ref().unwrap(), "{line}").unwrap();
    }

    pub(crate) fn signal(&self, signal: i32) {
        // SAFETY: takes numbers only; the child has not been waited for, so the id is its own.
        assert_eq!(unsafe { libc::kill(self.child.id() as i32, signal) }, 0);
    }

    /// Until it ends by itself, well.
    pub(crate) fn finish(mut self) {
        assert!(self.child.wait().unwrap().success());
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Asks again and again, for a long time at most.
pub(crate) fn until(what: &str, mut done: impl FnMut() -> bool) {
    let start = Instant::now();
    while !done() {
        assert!(start.elapsed() < PATIENCE, "waited too long until {what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Sleeps until killed.
pub(crate) fn stay() -> ! {
    loop {
        std::thread::park();
    }
}

pub(crate) fn label(priority: Priority, id: u16) -> Label {
    Label { priority, id, kind: Type::command(16), ..Label::default() }
}

pub(crate) fn received(info: &MailboxInfo) -> u64 {
    info.classes.iter().map(|class| class.received).sum()
}

pub(crate) fn lost(info: &MailboxInfo, cause: Loss) -> u64 {
    info.classes.iter().map(|class| class.lost(cause)).sum()
}

/// Received, lost after being accepted, and still there.
pub(crate) fn accounted(info: &MailboxInfo) -> u64 {
    let accepted = Loss::ALL.into_iter().filter(|cause| cause.was_accepted());
    received(info) + accepted.map(|cause| lost(info, cause)).sum::<u64>() + u64::from(info.depth)
}

/// Files of a node that nobody finished.
pub(crate) fn unfinished(node: &Path) -> Vec<PathBuf> {
    let all = std::fs::read_dir(node).unwrap().map(|entry| entry.unwrap().path());
    let is_unfinished = |path: &PathBuf| {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        name == "unfinished" || name.ends_with(".new")
    };
    all.filter(is_unfinished).collect()
}
