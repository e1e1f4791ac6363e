//! A node's files as another process may leave them: any bytes in a mailbox, in a stream, in the table of participants,
//! in a table of traffic, in the time page and in owners' descriptions of themselves; before they are opened, and while
//! they are in use.
//!
//! The input is a program: what to do next, and which bytes to change before. Every second byte or so of it is an
//! instruction, so that a fuzzer can put programs together.

use crate::split::Bytes;
use crate::streams::{STREAM_STEPS, Stream, ring_file};
use rohrpost_config::Installation;
use rohrpost_launch::survey::Survey;
use rohrpost_mailbox::{
    Label, ModuleState, Name, Node, OverflowPolicy, Participant, Priority, Publications, Receiver, Sender, Shape,
    SystemClock, TimeKeeper, TimeSource, Type, Waiting, monotonic_ns, wait_any,
};
use rohrpost_modules::description::noted;
use std::fs::OpenOptions;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};
use std::time::Duration;

const CONFIG: &str = include_str!("../corpus/config/small.toml");
/// Instructions of one program.
const STEPS_MAX: usize = 64;
/// Longest file that a program makes.
const FILE_MAX: u64 = 1 << 20;
const MAILBOX: Name = Name::new(1, 200, 0, 0);
const OTHER: Name = Name::new(1, 150, 0, 2);

static INSTALLATION: LazyLock<Installation> =
    LazyLock::new(|| Installation::parse(CONFIG, "small.toml".as_ref()).unwrap_or_else(|errors| panic!("{errors}")));

pub(crate) fn run(data: &[u8]) {
    let folder = tempfile::tempdir().unwrap_or_else(|error| panic!("a temporary folder: {error}"));
    let mut bytes = Bytes(data);
    let mut robot = Robot::new(folder.path().join("node"), bytes.byte());
    for _ in 0..STEPS_MAX {
        if bytes.is_empty() {
            break;
        }
        robot.step(&mut bytes);
    }
}

/// The state of a program. An object that could not be made or opened is missing, and the program goes on without it.
struct Robot {
    path: PathBuf,
    shape: Shape,
    node: Option<Arc<Node>>,
    participant: Option<Arc<Participant>>,
    receiver: Option<Receiver>,
    sender: Option<Sender>,
    keeper: Option<TimeKeeper>,
    clock: Option<SystemClock>,
    publications: Option<Publications>,
    stream: Stream,
}

impl Robot {
    fn new(path: PathBuf, how: u8) -> Self {
        let full = OverflowPolicy::ALL[usize::from(how & 3) % OverflowPolicy::ALL.len()];
        // More than 64 slots lie closer together.
        let slots = [1, 2, 5, 70][usize::from(how >> 2 & 3)];
        let max_age = (how & 16 != 0).then_some(Duration::from_millis(1));
        let shape = Shape { slots, body_bytes_max: 40, full, max_age, claims: 1 + (how >> 5) };
        let (node, participant, receiver, sender, keeper, clock, publications) = Default::default();
        let stream = Stream::new(how);
        Self { path, shape, node, participant, receiver, sender, keeper, clock, publications, stream }
    }

    fn step(&mut self, bytes: &mut Bytes<'_>) {
        match bytes.byte() % (24 + STREAM_STEPS) {
            0 => self.node = Node::create(&self.path, 0o700).ok(),
            1 => self.node = Node::open(&self.path).ok(),
            2 => self.participant = self.join(Name::new(1, 200, 0, 0)),
            3 => self.participant = None,
            4 => self.receiver = self.participant.as_ref().and_then(|me| me.receiver(MAILBOX, self.shape).ok()),
            5 => self.receiver = None,
            6 => drop(self.receiver.take().map(Receiver::close)),
            7 => self.sender = self.participant.as_ref().and_then(|me| me.sender(MAILBOX).ok()),
            8 => self.sender = None,
            9 => self.send(bytes),
            10 => self.lend(bytes),
            11 => self.receive(bytes.byte() % 4),
            12 => self.wait(),
            13 => self.look(),
            14 => self.tidy(bytes.byte()),
            15 => self.time(bytes),
            16 => self.publish(bytes),
            17 => self.describe(),
            18 => self.lengthen(bytes),
            19 => self.overwrite(bytes),
            20..24 => self.change(bytes),
            stream => self.stream.step(stream - 24, self.participant.as_ref(), bytes),
        }
    }

    fn join(&self, name: Name) -> Option<Arc<Participant>> {
        let me = Participant::join(self.node.as_ref()?, name).ok()?;
        me.set_state(ModuleState::On);
        Some(me)
    }

    fn send(&mut self, bytes: &mut Bytes<'_>) {
        let Some(sender) = &mut self.sender else { return };
        let label = label(bytes.byte());
        let length = usize::from(bytes.byte() % 48);
        let body = [7; 48];
        let _ = sender.send(&label, &[&body[..length]]);
    }

    fn lend(&mut self, bytes: &mut Bytes<'_>) {
        let Some(sender) = &mut self.sender else { return };
        let (label, length) = (label(bytes.byte()), usize::from(bytes.byte()));
        if let Ok(mut loan) = sender.loan(label.priority) {
            loan.body().fill(9);
            if length > 0 {
                let _ = loan.send(&label, length - 1);
            }
        }
    }

    fn receive(&mut self, times: u8) {
        let Some(receiver) = &mut self.receiver else { return };
        let max = usize::from(receiver.shape().body_bytes_max);
        for _ in 0..times {
            let Some(package) = receiver.try_receive() else { break };
            assert!(package.body().len() <= max);
            assert_eq!(package.body().len(), usize::from(package.head().len));
            let _ = package.published_ns();
        }
    }

    /// Sleeps only briefly, whatever the words contain.
    fn wait(&mut self) {
        let Some(receiver) = &mut self.receiver else { return };
        let _ = wait_any(&mut [&mut *receiver], Waiting::from(Duration::from_micros(1)), || false);
        drop(receiver.receive_timeout(Duration::from_micros(1)));
    }

    fn look(&self) {
        let Some(node) = &self.node else { return };
        for name in node.mailboxes().unwrap_or_default().into_iter().chain([MAILBOX, OTHER]) {
            if let Some(info) = node.look_at(name) {
                assert_eq!(info.name, name);
                assert!(info.depth <= u32::from(info.shape.slots));
                assert!(info.shape.segment_bytes() > 0);
            }
        }
        let participants = node.participants();
        assert!(participants.iter().all(|participant| participant.pid != 0), "0 would be one's own process group");
        for flow in node.traffic() {
            assert!(flow.is_same(&flow.clone()));
            let _ = (flow.rate_since(None), flow.rate_since(Some(&flow.clone())), flow.is_publication());
        }
        let _ =
            (node.launcher(), node.registry_epoch(), node.route(OTHER), node.last_word_of(MAILBOX, std::process::id()));
        if let Ok(survey) = Survey::new(node, &INSTALLATION, "main") {
            let _ = (survey.received_per_s(&survey, MAILBOX), survey.module(MAILBOX).map(|module| module.lost));
        }
    }

    fn tidy(&mut self, how: u8) {
        let Some(node) = self.node.clone() else { return };
        match how % 5 {
            0 => drop(node.remove_orphan(MAILBOX)),
            1 => drop(node.try_remove_orphan(OTHER)),
            2 => node.announce_death(),
            3 => drop(node.launch_lock()),
            _ => drop(node.remove_if_dead()),
        }
    }

    fn time(&mut self, bytes: &mut Bytes<'_>) {
        let Some(node) = &self.node else { return };
        let how = bytes.byte();
        if how & 1 != 0 {
            let pace = f64::from_bits(bytes.long());
            self.keeper = TimeKeeper::begin(node, TimeSource::Simulation, bytes.long(), pace).ok();
        }
        if how & 2 != 0 {
            self.clock = Some(SystemClock::open(node));
        }
        if let (Some(keeper), true) = (&mut self.keeper, how & 4 != 0) {
            keeper.set_pace(f64::from(how));
        }
        if let Some(clock) = &self.clock {
            let _ = (clock.now(), clock.at(bytes.long()), clock.at(monotonic_ns()), clock.record());
        }
    }

    fn publish(&mut self, bytes: &mut Bytes<'_>) {
        let Some(me) = &self.participant else { return };
        let publications = self.publications.get_or_insert_with(|| Publications::new(me));
        publications.published(MAILBOX, Type::data(bytes.byte().into()), 40, Duration::from_nanos(bytes.long()));
    }

    fn describe(&mut self) {
        let Some(node) = &self.node else { return };
        if let Some(receiver) = &self.receiver {
            let _ = receiver.set_about(b"\x00\x00\x00\x00\x00");
        }
        if let Some(about) = node.about(MAILBOX) {
            let _ = (noted(node, MAILBOX), about.len());
        }
    }

    /// One of the node's files, of any maker.
    fn file(&self, which: u8) -> PathBuf {
        let mailbox = |name: Name, kind: &str| format!("{:08x}.{kind}", name.raw());
        let name = match which % 7 {
            _ if which == u8::MAX => "routes".into(),
            _ if which >= 192 => return ring_file(&self.path),
            0 | 1 => mailbox(MAILBOX, "mbx"),
            2 => mailbox(OTHER, "mbx"),
            3 => "node".into(),
            4 => "traffic.0".into(),
            5 => "time".into(),
            _ => mailbox(MAILBOX, "about"),
        };
        self.path.join(name)
    }

    /// Never truncates a file that a process may have mapped: that is outside the contract, and ends the process.
    fn lengthen(&self, bytes: &mut Bytes<'_>) {
        let path = self.file(bytes.byte());
        let more = u64::from(bytes.half()) * 16;
        let Ok(file) = OpenOptions::new().write(true).create(true).truncate(false).open(path) else { return };
        let length = file.metadata().map_or(0, |found| found.len());
        if length < FILE_MAX {
            let _ = file.set_len(length + more);
        }
    }

    /// A new file in place of the old one, from its first byte on; processes that have the old one open keep it.
    fn overwrite(&self, bytes: &mut Bytes<'_>) {
        let path = self.file(bytes.byte());
        let contents = bytes.take(4096).to_vec();
        let _ = std::fs::remove_file(&path);
        let _ = std::fs::write(&path, contents);
    }

    fn change(&self, bytes: &mut Bytes<'_>) {
        let path = self.file(bytes.byte());
        let at = bytes.half();
        let length = usize::from(bytes.byte() % 8) + 1;
        write_at(&path, at.into(), bytes.take(length));
    }
}

fn write_at(path: &Path, at: u64, what: &[u8]) {
    if let Ok(file) = OpenOptions::new().write(true).open(path) {
        let _ = file.write_all_at(what, at);
    }
}

fn label(which: u8) -> Label {
    Label {
        from: OTHER,
        kind: Type::command(16 + u16::from(which & 3)),
        id: u16::from(which >> 2 & 3),
        priority: Priority(which & 0xf0),
        ..Label::default()
    }
}
