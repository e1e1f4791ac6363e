//! From exec of a program to the first package in its hand, beside the same program with POSIX queues.
//!
//! ```text
//!  bench: takes the time ──exec──▶ program: main ─ opens, makes its mailbox ─ sends hello to hub ─ has answer: time
//!                                                                               hub (bench) opens the mailbox, answers
//! ```
//! `new` is as drawn: the mailbox is made, and its first package comes from a process that has to find it. `waiting` is
//! a program that was started again: its mailbox is there, with a package in it. Each program is the bench itself in a
//! hidden role, so that exec costs all the same; what they do after `main` has rows of its own. All have their
//! defaults: a mailbox of `Shape::default()`, a queue of the kernel's default size.

use super::errors::{Done, as_failure};
use nix::mqueue::{MQ_OFlag, MqAttr, MqdT, mq_close, mq_open, mq_send, mq_timedreceive, mq_unlink};
use nix::sys::stat::Mode;
use nix::sys::time::TimeSpec;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{
    End, Failure, OrFail, Placement, Samples, Scheduling, Scratch, sample_in_child, settle,
};
use rohrpost_bench_local::rounds::{Contender, Row, Subject, at_most, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_mailbox::{Label, Name, Node, Participant, Receiver, Shape, Type, monotonic_ns, realtime_ns};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::{Arc, mpsc};
use std::time::Duration;

/// Starts of a turn.
const STARTS: usize = 21;
const PATIENCE: Duration = Duration::from_secs(30);
/// Neither side waits longer for the other.
const ANSWER_WITHIN: Duration = Duration::from_secs(5);
/// Set for the hidden programs, to what they are to do.
const ROLE: &str = "ROHRPOST_BENCH_STARTUP";
const HUB: Name = Name::new(1, 100, 0, 0);
const OWN: Name = Name::new(1, 200, 0, 0);
const BODY: &[u8] = &[7; 64];
/// Messages of a queue of default size have at most so many bytes.
const QUEUE_BYTES_MAX: usize = 8192;

/// All of them.
pub(super) fn cases() -> Vec<Case> {
    let all = [
        (Start::New, StartupClock::Exec),
        (Start::New, StartupClock::Main),
        (Start::Waiting, StartupClock::Exec),
        (Start::Waiting, StartupClock::Main),
    ];
    all.map(|(start, from)| {
        let end = if from == StartupClock::Exec { "" } else { "-after-main" };
        let name = format!("startup-{}{end}", start.name());
        Case::new(name, BODY.len(), "us", move |settings, subject| {
            Ok(Startup { start, from }.measure(settings, subject))
        })
    })
    .into()
}

/// Whether its mailbox is there before the program.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Start {
    /// The program makes it, and tells the hub.
    New,
    /// It is there, with a package.
    Waiting,
}

impl Start {
    const fn name(self) -> &'static str {
        match self {
            Self::New => "new",
            Self::Waiting => "waiting",
        }
    }
}

/// When the clock starts.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum StartupClock {
    Exec,
    /// The first line of `main`.
    Main,
}

struct Startup {
    start: Start,
    from: StartupClock,
}

impl Startup {
    fn measure(&self, settings: &Settings, subject: &Subject) -> Vec<Row> {
        let starts = settings.count(STARTS);
        let ours = Contender::sampled("rohrpost", || self.turn(starts, HubNode::new));
        let queue = Contender::sampled("posix-mq", || self.turn(starts, HubQueue::new));
        let target = at_most(1.5).filter(|_| self.from == StartupClock::Exec);
        compare(settings, subject, &[ours, queue.beside(target, None)])
    }

    /// Microseconds of each start.
    fn turn<G: Host>(&self, starts: usize, ground: impl FnOnce() -> Done<G>) -> Result<Vec<f64>, Failure> {
        sample_in_child(PATIENCE, |samples| self.start_all(starts, ground, samples).map_err(as_failure("start-up")))
    }

    fn start_all<G: Host>(&self, starts: usize, ground: impl FnOnce() -> Done<G>, samples: &Samples) -> Done<()> {
        let mut ground = ground()?;
        std::thread::scope(|scope| {
            let (roles, to_start) = mpsc::channel();
            let (done, ended) = mpsc::channel();
            // Before this thread is bound to its processor: the other one must not inherit that.
            scope.spawn(move || {
                let settled = settle(End::Pong, Placement::TwoCores, Scheduling::Fifo);
                to_start.into_iter().try_for_each(|role: String| done.send(settled.clone().map(|()| run(&role))))
            });
            settle(End::Ping, Placement::TwoCores, Scheduling::Fifo)?;
            for _ in 0..starts {
                if self.start == Start::Waiting {
                    ground.make_waiting()?;
                }
                roles.send(ground.role(self.start)?)?;
                if self.start == Start::New {
                    ground.answer_hello()?;
                }
                let times = ended.recv()???;
                ground.forget()?;
                let began_ns = if self.from == StartupClock::Exec { times.exec_ns } else { times.main_ns };
                samples.push((times.first_ns - began_ns) as f64 / 1000.0);
            }
            Ok(())
        })
    }
}

/// When what was, on the monotonic clock.
struct Times {
    exec_ns: u64,
    main_ns: u64,
    first_ns: u64,
}

/// Starts the program on this thread's processor, and waits for its end.
fn run(role: &str) -> Done<Times> {
    let mut command = Command::new(std::env::current_exe()?);
    command.env(ROLE, role).stdin(Stdio::null()).stdout(Stdio::piped());
    let exec_ns = monotonic_ns();
    let output = command.spawn()?.wait_with_output()?;
    let said = String::from_utf8(output.stdout)?;
    let times: Vec<u64> = said.split_whitespace().map(str::parse).collect::<Result<_, _>>().unwrap_or_default();
    let [main_ns, first_ns] = times[..] else { return Err(format!("the program said `{said}`").into()) };
    Ok(Times { exec_ns, main_ns, first_ns })
}

/// What a program is started on: a node, or queues.
trait Host {
    /// Makes the program's mailbox or queue, with something in it.
    fn make_waiting(&mut self) -> Done<()>;

    /// What to tell the program.
    fn role(&self, start: Start) -> Done<String>;

    /// Waits for the program's hello, and answers.
    fn answer_hello(&mut self) -> Done<()>;

    /// Removes the program's mailbox or queue.
    fn forget(&mut self) -> Done<()>;
}

/// A node with a hub on it.
struct HubNode {
    scratch: Scratch,
    hub: Receiver,
    participant: Arc<Participant>,
}

impl HubNode {
    fn new() -> Done<Self> {
        let scratch = Scratch::new()?;
        let participant = Participant::join(&Node::create(&scratch.directory().join("node"), 0o700)?, HUB)?;
        let hub = participant.receiver(HUB, Shape::default())?;
        Ok(Self { scratch, hub, participant })
    }

    fn answer(&self) -> Done<()> {
        Ok(self.participant.sender(OWN)?.send(&label(), &[BODY])?)
    }
}

fn label() -> Label {
    Label { from: OWN, kind: Type::data(0), ..Label::default() }
}

impl Host for HubNode {
    fn make_waiting(&mut self) -> Done<()> {
        // Dropped, it stays, as if its owner had died.
        drop(self.participant.receiver(OWN, Shape::default())?);
        self.answer()
    }

    fn role(&self, start: Start) -> Done<String> {
        let path = self.scratch.directory().join("node");
        Ok(format!("mailbox {} {}", start.name(), path.to_str().ok_or("the node's path is no UTF-8")?))
    }

    fn answer_hello(&mut self) -> Done<()> {
        drop(self.hub.receive_timeout(ANSWER_WITHIN).ok_or("the program did not say hello")?);
        self.answer()
    }

    fn forget(&mut self) -> Done<()> {
        self.participant.node().remove_orphan(OWN)?;
        Ok(())
    }
}

/// A hub's queue, and the names of both.
struct HubQueue {
    hub: MqdT,
    names: [String; 2],
}

impl HubQueue {
    fn new() -> Done<Self> {
        let names = ["hub", "own"].map(|name| format!("/rohrpost-bench-{}-{name}", std::process::id()));
        Ok(Self { hub: make_queue(&names[0])?, names })
    }

    fn answer(&self) -> Done<()> {
        let queue = mq_open(self.names[1].as_str(), MQ_OFlag::O_WRONLY, Mode::empty(), None)?;
        mq_send(&queue, BODY, 0)?;
        Ok(mq_close(queue)?)
    }
}

impl Host for HubQueue {
    fn make_waiting(&mut self) -> Done<()> {
        mq_close(make_queue(&self.names[1])?)?;
        self.answer()
    }

    fn role(&self, start: Start) -> Done<String> {
        Ok(format!("queue {} {} {}", start.name(), self.names[0], self.names[1]))
    }

    fn answer_hello(&mut self) -> Done<()> {
        receive(&self.hub)?;
        self.answer()
    }

    fn forget(&mut self) -> Done<()> {
        Ok(mq_unlink(self.names[1].as_str())?)
    }
}

impl Drop for HubQueue {
    fn drop(&mut self) {
        for name in &self.names {
            // The program's is gone unless a start failed.
            let _ = mq_unlink(name.as_str());
        }
    }
}

fn make_queue(name: &str) -> nix::Result<MqdT> {
    let flags = MQ_OFlag::O_RDWR | MQ_OFlag::O_CREAT | MQ_OFlag::O_EXCL;
    // The kernel's defaults, said aloud: without attributes nix leaves out two arguments that making a queue reads.
    let attributes = MqAttr::new(0, 10, 8192, 0);
    mq_open(name, flags, Mode::S_IRUSR | Mode::S_IWUSR, Some(&attributes))
}

/// The next message, which must be the body, and when it was there.
fn receive(queue: &MqdT) -> Done<u64> {
    let mut message = [0; QUEUE_BYTES_MAX];
    // A queue's deadline is a time of day.
    let deadline = TimeSpec::from_duration(Duration::from_nanos(realtime_ns()) + ANSWER_WITHIN);
    let bytes = mq_timedreceive(queue, &mut message, &mut 0, &deadline)?;
    let now_ns = monotonic_ns();
    if &message[..bytes] == BODY { Ok(now_ns) } else { Err("the first message is another".into()) }
}

/// If this process was started as one of the programs here: does what it has to. Fails when anything does, or the first
/// package is not the one that was sent.
pub(super) fn run_hidden_program() -> Option<Result<(), Failure>> {
    let main_ns = monotonic_ns();
    let role = std::env::var(ROLE).ok()?;
    let first_ns = match role.split(' ').collect::<Vec<_>>()[..] {
        ["mailbox", start, path] => with_mailbox(start == Start::New.name(), Path::new(path)),
        ["queue", start, hub, own] => with_queue(start == Start::New.name(), hub, own),
        _ => Err(format!("{ROLE}: no such program: {role}").into()),
    };
    let said = first_ns.map(|first_ns| println!("{main_ns} {first_ns}"));
    Some(said.or_fail("hidden program"))
}

fn with_mailbox(hello: bool, path: &Path) -> Done<u64> {
    let participant = Participant::join(&Node::open(path)?, OWN)?;
    let mut own = participant.receiver(OWN, Shape::default())?;
    let mut hub = participant.sender(HUB)?;
    if hello {
        hub.send(&label(), &[BODY])?;
    }
    let first = own.receive_timeout(ANSWER_WITHIN).ok_or("no package came")?;
    let now_ns = monotonic_ns();
    if first.body() == BODY { Ok(now_ns) } else { Err("the first package is another".into()) }
}

fn with_queue(hello: bool, hub: &str, own: &str) -> Done<u64> {
    let own = if hello { make_queue(own)? } else { mq_open(own, MQ_OFlag::O_RDWR, Mode::empty(), None)? };
    let hub = mq_open(hub, MQ_OFlag::O_WRONLY, Mode::empty(), None)?;
    if hello {
        mq_send(&hub, BODY, 0)?;
    }
    receive(&own)
}
