//! From exec of a program to the first package in its hand, beside the same program with POSIX queues.
//!
//! ```text
//!  bench: takes the time ──exec──▶ program: main ─ opens, makes its mailbox ─ says hello to the hub ─ has the answer: time
//!                                                                               hub (bench) opens the mailbox, answers
//! ```
//! `new` is as drawn: the mailbox is made and its first package comes from a process that has to find it. `waiting` is a
//! program that was started again: its mailbox is there, with a package in it. Each program is this binary in a hidden role, so
//! that exec costs all the same; what they do after `main` has a row of its own. All have their defaults: a mailbox of
//! `Shape::default()`, a queue of the kernel's default size.

use nix::mqueue::{MQ_OFlag, MqdT, mq_close, mq_open, mq_receive, mq_send, mq_unlink};
use nix::sys::stat::Mode;
use rohrpost_mailbox::{Label, Name, Node, Participant, Shape, Type, monotonic_ns};
use std::error::Error;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;

type Done<T> = Result<T, Box<dyn Error>>;

/// The first argument of the hidden programs.
pub const ROLE: &str = "startup-program";
const HUB: Name = Name::new(1, 100, 0, 0);
const OWN: Name = Name::new(1, 200, 0, 0);
const BODY: &[u8] = &[7; 64];
/// Messages of a queue of default size have at most so many bytes.
const QUEUE_BYTES_MAX: usize = 8192;

/// Whether its mailbox is there before the program.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Start {
    /// The program makes it, and tells the hub.
    New,
    /// It is there, with a package.
    Waiting,
}

impl Start {
    /// Both.
    pub const ALL: [Self; 2] = [Self::New, Self::Waiting];

    /// The word for it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::New => "new",
            Self::Waiting => "waiting",
        }
    }
}

/// One start: from exec, and from `main`, to the first package. Nanoseconds.
#[derive(Clone, Copy, Debug)]
pub struct Started {
    /// From just before exec.
    pub from_exec_ns: u64,
    /// From the first line of `main`.
    pub from_main_ns: u64,
}

/// What is started: a program with mailboxes, or one with POSIX queues.
pub trait Ground {
    /// Starts the program once, takes part, and cleans up after it.
    ///
    /// # Errors
    /// When anything fails.
    fn start(&mut self, start: Start) -> Done<Started>;
}

/// A node with a hub on it.
pub struct Mailboxes {
    directory: tempfile::TempDir,
    hub: rohrpost_mailbox::Receiver,
    participant: Arc<Participant>,
}

impl Mailboxes {
    /// Makes a node of its own in shared memory.
    ///
    /// # Errors
    /// When that cannot be.
    pub fn new() -> Done<Self> {
        let directory = tempfile::Builder::new().prefix("rohrpost-bench-").tempdir_in("/dev/shm")?;
        let participant = Participant::join(&Node::create(&directory.path().join("node"), 0o700)?, HUB)?;
        let hub = participant.receiver(HUB, Shape::default())?;
        Ok(Self { directory, hub, participant })
    }

    fn answer(&self) -> Done<()> {
        let label = Label { kind: Type::data(0), ..Label::default() };
        Ok(self.participant.sender(OWN)?.send(&label, &[BODY])?)
    }
}

impl Ground for Mailboxes {
    fn start(&mut self, start: Start) -> Done<Started> {
        if start == Start::Waiting {
            // Dropped, it stays, as if its owner had died.
            drop(self.participant.receiver(OWN, Shape::default())?);
            self.answer()?;
        }
        let path = self.directory.path().join("node");
        let program = Program::exec(&["mailbox", start.name(), path.to_str().ok_or("node's path is no UTF-8")?])?;
        if start == Start::New {
            drop(self.hub.receive());
            self.answer()?;
        }
        let started = program.started()?;
        self.participant.node().remove_orphan(OWN)?;
        Ok(started)
    }
}

/// A hub's queue, and the name of the program's.
pub struct Queues {
    hub: MqdT,
    names: [String; 2],
}

impl Queues {
    /// Makes the hub's queue.
    ///
    /// # Errors
    /// When the kernel has no room for it.
    pub fn new() -> Done<Self> {
        let names = ["hub", "own"].map(|name| format!("/rohrpost-bench-{}-{name}", std::process::id()));
        Ok(Self { hub: make_queue(&names[0])?, names })
    }

    fn answer(&self) -> Done<()> {
        let queue = mq_open(self.names[1].as_str(), MQ_OFlag::O_WRONLY, Mode::empty(), None)?;
        mq_send(&queue, BODY, 0)?;
        Ok(mq_close(queue)?)
    }
}

impl Ground for Queues {
    fn start(&mut self, start: Start) -> Done<Started> {
        if start == Start::Waiting {
            mq_close(make_queue(&self.names[1])?)?;
            self.answer()?;
        }
        let program = Program::exec(&["queue", start.name(), &self.names[0], &self.names[1]])?;
        if start == Start::New {
            receive(&self.hub)?;
            self.answer()?;
        }
        let started = program.started();
        mq_unlink(self.names[1].as_str())?;
        started
    }
}

impl Drop for Queues {
    fn drop(&mut self) {
        // The program's is gone unless a start failed; then this is all that can be done for it.
        self.names.iter().for_each(|name| drop(mq_unlink(name.as_str())));
    }
}

fn make_queue(name: &str) -> nix::Result<MqdT> {
    let flags = MQ_OFlag::O_RDWR | MQ_OFlag::O_CREAT | MQ_OFlag::O_EXCL;
    mq_open(name, flags, Mode::S_IRUSR | Mode::S_IWUSR, None)
}

fn receive(queue: &MqdT) -> nix::Result<usize> {
    mq_receive(queue, &mut [0; QUEUE_BYTES_MAX], &mut 0)
}

/// A started program, and when that was.
struct Program {
    child: std::process::Child,
    exec_ns: u64,
}

impl Program {
    fn exec(arguments: &[&str]) -> Done<Self> {
        let mut command = Command::new(std::env::current_exe()?);
        command.arg(ROLE).args(arguments).stdin(Stdio::null()).stdout(Stdio::piped());
        let exec_ns = monotonic_ns();
        Ok(Self { child: command.spawn()?, exec_ns })
    }

    fn started(self) -> Done<Started> {
        let output = self.child.wait_with_output()?;
        let said = String::from_utf8(output.stdout)?;
        let times: Vec<u64> = said.split_whitespace().map(str::parse).collect::<Result<_, _>>()?;
        let [main_ns, first_ns] = times[..] else { return Err(format!("the program said `{said}`").into()) };
        Ok(Started { from_exec_ns: first_ns - self.exec_ns, from_main_ns: first_ns - main_ns })
    }
}

/// The hidden program. `arguments` are those after [`ROLE`]; `main_ns` is when `main` began.
///
/// # Errors
/// When anything fails, or the first package is not the one that was sent.
pub fn program(arguments: &[String], main_ns: u64) -> Done<()> {
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let first_ns = match arguments[..] {
        ["mailbox", start, path] => with_mailbox(start == Start::New.name(), Path::new(path))?,
        ["queue", start, hub, own] => with_queue(start == Start::New.name(), hub, own)?,
        _ => return Err(format!("no such program: {arguments:?}").into()),
    };
    println!("{main_ns} {first_ns}");
    Ok(())
}

fn with_mailbox(hello: bool, path: &Path) -> Done<u64> {
    let participant = Participant::join(&Node::open(path)?, OWN)?;
    let mut own = participant.receiver(OWN, Shape::default())?;
    let mut hub = participant.sender(HUB)?;
    if hello {
        hub.send(&Label { from: OWN, kind: Type::data(0), ..Label::default() }, &[BODY])?;
    }
    let first = own.receive();
    let first_ns = monotonic_ns();
    if first.body() == BODY { Ok(first_ns) } else { Err("the first package is another".into()) }
}

fn with_queue(hello: bool, hub: &str, own: &str) -> Done<u64> {
    let own = if hello { make_queue(own)? } else { mq_open(own, MQ_OFlag::O_RDWR, Mode::empty(), None)? };
    let hub = mq_open(hub, MQ_OFlag::O_WRONLY, Mode::empty(), None)?;
    if hello {
        mq_send(&hub, BODY, 0)?;
    }
    let mut first = [0; QUEUE_BYTES_MAX];
    let len = mq_receive(&own, &mut first, &mut 0)?;
    let first_ns = monotonic_ns();
    if &first[..len] == BODY { Ok(first_ns) } else { Err("the first message is another".into()) }
}
