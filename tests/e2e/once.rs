//! At most once, from end to end: with any loss, duplicate or restart, no command runs twice.

use crate::harness::{OUTPUT, PATIENCE, Place, Robot, halt, probe, signal, until, wait};
use crate::output::lines;
use crate::probe::{COUNT, COUNT_AGAIN, ProbingInterface};
use nix::sys::signal::Signal;
use rohrpost::common;
use rohrpost::serde::{Serialize, de::DeserializeOwned};
use rohrpost::{CallError, Class, Fault};
use rohrpost_launch::launcher::{AskLaunch, ControlError, LauncherInterface};
use rohrpost_mailbox::{Label, Name, Options, OverflowPolicy, Participant, Receiver, Sender, Shape, Type, local};
use rohrpost_modules::call::{CallEnvelope, Link, ReplyEnvelope};
use std::collections::BTreeSet;
use std::time::{Duration, Instant};

/// Of launch.
const RESTART: u16 = 17;

/// Packages as a caller would send them, with every field under the test's control.
struct Raw {
    replies: Receiver,
    sender: Sender,
}

impl Raw {
    /// Under an instance of class `tool` that no real tool takes.
    fn new(robot: &Robot, module: &str) -> Self {
        let participant = Participant::join(&robot.node, Name::NONE).unwrap();
        let me = Name::new(1, 16, 200, local::REPLIES);
        let replies = participant.receiver(me, Shape::default()).unwrap();
        Self { replies, sender: participant.sender(robot.name(module)).unwrap() }
    }

    fn envelope(incarnation: u32, sequence: u32, age_us: u32) -> CallEnvelope {
        CallEnvelope { interface: ProbingInterface::hash(), incarnation, sequence, valid_for_us: 60_000_000, age_us }
    }

    fn send(&mut self, function: u16, envelope: CallEnvelope, number: u32) {
        self.send_with(function, envelope, number);
    }

    fn send_with(&mut self, function: u16, envelope: CallEnvelope, argument: impl Serialize) {
        let mut body = envelope.to_bytes().to_vec();
        rohrpost::wire::append(&mut body, &(argument,)).unwrap();
        let label = Label {
            from: self.replies.name(),
            kind: Type::command(function),
            id: envelope.sequence as u16,
            priority: Class(16).priority(),
            options: Options::default(),
        };
        self.sender.send(&label, &[&body]).unwrap();
    }

    /// The next answer to this call. If a server is killed between its answer and the release of a command, its
    /// next incarnation answers the command, too.
    fn answer_to(&mut self, sequence: u32) -> Result<u64, Fault> {
        loop {
            let (envelope, result) = self.answer();
            if envelope.sequence == sequence {
                return result;
            }
        }
    }

    /// The next answer: what it answers, and the result or the fault.
    fn answer(&mut self) -> (ReplyEnvelope, Result<u64, Fault>) {
        self.answer_as()
    }

    fn answer_as<T: DeserializeOwned>(&mut self) -> (ReplyEnvelope, Result<T, Fault>) {
        let package = self.replies.receive_timeout(PATIENCE).expect("no answer");
        let (envelope, result) = ReplyEnvelope::split(package.body()).unwrap();
        let result = if package.head().options.has(Options::ERROR) {
            Err(rohrpost::wire::from_bytes(result).unwrap())
        } else {
            Ok(rohrpost::wire::from_bytes(result).unwrap())
        };
        (envelope, result)
    }
}

#[test]
fn duplicates_of_one_envelope_run_once_and_have_the_same_answer() {
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", "")]);
    let mut raw = Raw::new(&robot, "probe.0");
    for (function, number) in [(COUNT, 1), (COUNT_AGAIN, 2)] {
        for age_us in [0, 0, 1, 1000] {
            raw.send(function, Raw::envelope(7, number, age_us), number);
        }
        let answers: Vec<_> = (0..4).map(|_| raw.answer()).collect();
        let expected = (ReplyEnvelope { incarnation: 7, sequence: number }, Ok(u64::from(number)));
        assert!(answers.iter().all(|answer| *answer == expected), "{answers:?}");
    }
    assert_eq!(place.counted(), [1, 2]);
    raw.replies.close();
    launch.stop();
}

#[test]
fn duplicates_of_an_order_to_launch_restart_a_module_once() {
    let (_place, mut launch, robot) = Place::running(&[&probe("probe.0", "", "")]);
    let mut raw = Raw::new(&robot, "tool.0");
    let pid = robot.pid("probe.0");
    let order = |age_us| CallEnvelope { interface: LauncherInterface::hash(), ..Raw::envelope(7, 1, age_us) };
    for age_us in [0, 0, 1] {
        raw.send_with(RESTART, order(age_us), "probe.0");
        assert_eq!(raw.answer_as::<Result<u32, ControlError>>().1, Ok(Ok(2)), "its second process");
    }
    wait("it runs again", || robot.process("probe.0").filter(|process| process.pid != pid));
    // Also when the first order was carried out long ago.
    raw.send_with(RESTART, order(1000), "probe.0");
    assert_eq!(raw.answer_as::<Result<u32, ControlError>>().1, Ok(Ok(2)));
    let mut tool = robot.tool(PATIENCE);
    assert_eq!(tool.children(tool.launcher()).unwrap()[0].lives, 2);
    tool.close();
    raw.replies.close();
    let out = launch.stop();
    assert_eq!(out.matches("probe.0 is started again, as asked").count(), 1, "{out}");
}

#[test]
fn a_restarted_caller_begins_anew_and_its_earlier_incarnation_is_not_heard() {
    let (place, mut launch, robot) = Place::running(&[OUTPUT, &probe("probe.0", "", "")]);
    let mut raw = Raw::new(&robot, "probe.0");
    for (incarnation, sequence, number) in [(7, 1, 1), (7, 2, 2), (8, 1, 3), (8, 2, 4)] {
        raw.send(COUNT, Raw::envelope(incarnation, sequence, 0), number);
        let (envelope, result) = raw.answer();
        assert_eq!((envelope, result), (ReplyEnvelope { incarnation, sequence }, Ok(u64::from(number))));
    }
    // Late packages of the earlier incarnation: one that ran, and one that arrives for the first time. If the sender is
    // no earlier incarnation, but a program after its clock was set back, it learns why it is refused.
    for (sequence, age_us, number) in [(2, 500, 5), (3, 0, 6)] {
        raw.send(COUNT, Raw::envelope(7, sequence, age_us), number);
        let refused = (ReplyEnvelope { incarnation: 7, sequence }, Err(Fault::EarlierIncarnation));
        assert_eq!(raw.answer(), refused);
    }
    // The server reports it, too, at a limited rate.
    until("the server's line", || {
        let log = lines(&place, "probe.0");
        let told = log.iter().filter(|line| {
            let text = line["text"].as_str().unwrap();
            line["level"] == "warn"
                && text.contains("a later incarnation of it has called")
                && text.contains("clock was set back")
        });
        let told = told.count();
        assert!(told <= 1, "{log:#?}");
        told == 1
    });
    raw.send(COUNT, Raw::envelope(8, 3, 0), 7);
    assert_eq!(raw.answer().0, ReplyEnvelope { incarnation: 8, sequence: 3 });
    // The same with real tools: each is a new incarnation under the same name, with numbers from 1 on.
    for number in 8..=10u32 {
        place.say(&["call", "probe.0", "count", &number.to_string()]).ok();
    }
    assert_eq!(place.counted(), [1, 2, 3, 4, 7, 8, 9, 10]);
    raw.replies.close();
    launch.stop();
}

#[test]
fn a_restarted_server_runs_no_repeat_of_a_call_that_its_earlier_incarnation_may_have_run() {
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", "restart = { backoff = \"50 ms\" }")]);
    let mut raw = Raw::new(&robot, "probe.0");
    let began = Instant::now();
    raw.send(COUNT, Raw::envelope(7, 1, 0), 1);
    assert_eq!(raw.answer().1, Ok(1));
    robot.kill("probe.0");
    let age_us = |began: Instant| began.elapsed().as_micros() as u32;
    for (function, sequence, answer) in
        [(COUNT, 1, Err(Fault::Interrupted)), (COUNT, 2, Err(Fault::Interrupted)), (COUNT_AGAIN, 3, Ok(1))]
    {
        raw.send(function, Raw::envelope(7, sequence, age_us(began)), sequence);
        assert_eq!(raw.answer_to(sequence), answer, "tried before the new incarnation: {sequence}");
    }
    // A first arrival is no repeat, whatever came before.
    raw.send(COUNT, Raw::envelope(7, 4, 0), 4);
    assert_eq!(raw.answer_to(4), Ok(2));
    assert_eq!(place.counted(), [1, 3, 4]);
    raw.replies.close();
    launch.stop();
}

#[test]
fn repeats_that_pile_up_before_a_stopped_server_run_once() {
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", "")]);
    let pid = robot.pid("probe.0");
    halt(pid);
    let call = std::thread::scope(|scope| {
        // Repeats after a third of the time, and after two thirds.
        let call = scope.spawn(|| place.say(&["call", "probe.0", "count", "1", "--timeout", "60"]));
        let call_early = scope.spawn(|| {
            let mut tool = robot.tool(Duration::from_millis(900));
            let call = begin(&robot, &mut tool.link, 2, Duration::from_millis(900)).unwrap();
            let result = tool.link.wait(call, |_| Ok(()));
            tool.close();
            result
        });
        let early = call_early.join().unwrap();
        assert!(matches!(early, Err(CallError::Timeout(..))), "{early:?}");
        until("repeats", || robot.waiting("probe.0") >= 2);
        signal(pid, Signal::SIGCONT);
        call.join().unwrap()
    });
    // `call` asked for the description first, so its command came after.
    assert_eq!(call.ok(), "1\n");
    until("nothing waits", || robot.waiting("probe.0") == 0);
    launch.stop();
    assert_eq!(place.counted(), [1], "what is answered for nobody any more is not run either");
}

fn begin(robot: &Robot, link: &mut Link, number: u32, timeout: Duration) -> Result<u32, CallError> {
    let write = |body: &mut Vec<u8>| rohrpost::wire::append(body, &(number,));
    link.begin(robot.name("probe.0"), COUNT, ProbingInterface::hash(), timeout, write)
}

#[test]
fn replies_that_find_no_room_are_asked_for_again_and_nothing_runs_twice() {
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", "")]);
    let participant = Participant::join(&robot.node, Name::NONE).unwrap();
    let me = Name::new(1, 16, 201, 0);
    // Room for one answer, and eight calls at a time.
    let shape = Shape { slots: 1, full: OverflowPolicy::Reject, ..Shape::default() };
    let replies = participant.receiver(me.with_local(local::REPLIES), shape).unwrap();
    let mut link = Link::new(&participant, me, replies);
    let mut answers = BTreeSet::new();
    for round in 0..5u32 {
        let timeout = Duration::from_secs(3);
        let calls: Vec<u32> = (0..8).map(|call| begin(&robot, &mut link, round * 8 + call, timeout).unwrap()).collect();
        // All have run, and seven answers found no room, before the first is taken.
        until("the round has run", || place.counted().len() >= (round as usize + 1) * 8);
        for call in calls {
            match link.wait(call, |bytes| rohrpost::wire::from_bytes::<u64>(bytes)) {
                Ok(answer) => assert!(answers.insert(answer), "{answer} was told to two calls"),
                // On a busy computer both repeats may find no room.
                Err(error) => assert!(matches!(error, CallError::Timeout(..)), "{error}"),
            }
        }
    }
    assert!(answers.len() > 20, "hardly any answer was asked for again: {answers:?}");
    assert_eq!(place.counted(), (0..40).collect::<Vec<_>>());
    let refused: u64 = robot
        .node
        .look_at(me.with_local(local::REPLIES))
        .unwrap()
        .classes
        .iter()
        .map(|class| class.lost(rohrpost_mailbox::Loss::Refused))
        .sum();
    assert!(refused > 0, "no reply was lost, so nothing was tested");
    link.close();
    launch.stop();
}

#[test]
fn callers_in_a_crowd_before_a_small_mailbox_and_a_halting_server_never_run_twice() {
    let keys = "[module.mailbox.commands]\nslots = 6\nfull = \"reject\"";
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", keys)]);
    let pid = robot.pid("probe.0");
    // Time enough for an answer when the server runs, too little when it is stopped: repeats, expiry and time-outs
    // happen.
    let (callers, each, timeout) = (6, 60, Duration::from_millis(60));
    let work = |caller: u32| {
        let mut tool = robot.tool(timeout);
        let mut outcomes = Vec::new();
        for number in caller * 1000..caller * 1000 + each {
            let outcome = begin(&robot, &mut tool.link, number, timeout)
                .and_then(|call| tool.link.wait(call, |bytes| rohrpost::wire::from_bytes::<u64>(bytes)));
            if outcome.is_err() {
                std::thread::sleep(Duration::from_millis(5));
            }
            outcomes.push((number, outcome));
        }
        tool.close();
        outcomes
    };
    let outcomes: Vec<_> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..callers)
            .map(|caller| {
                scope.spawn({
                    let work = &work;
                    move || work(caller)
                })
            })
            .collect();
        while !threads.iter().all(|thread| thread.is_finished()) {
            halt(pid);
            std::thread::sleep(Duration::from_millis(70));
            signal(pid, Signal::SIGCONT);
            std::thread::sleep(Duration::from_millis(5));
        }
        threads.into_iter().flat_map(|thread| thread.join().unwrap()).collect()
    });
    until("nothing waits", || robot.waiting("probe.0") == 0);
    launch.stop();
    let counted = place.counted();
    let distinct: BTreeSet<u32> = counted.iter().copied().collect();
    assert_eq!(distinct.len(), counted.len(), "something ran twice: {counted:?}");
    let mut seen = [0; 3];
    for (number, outcome) in &outcomes {
        match outcome {
            Ok(_) => assert!(distinct.contains(number), "{number} was answered and did not run"),
            Err(CallError::NotSent(_)) => assert!(!distinct.contains(number), "{number} was not sent and ran"),
            Err(CallError::Fault(_, Fault::Expired)) => assert!(!distinct.contains(number), "{number} expired and ran"),
            Err(CallError::Timeout(..)) => {}
            Err(error) => panic!("{number}: {error}"),
        }
        seen[match outcome {
            Ok(_) => 0,
            Err(CallError::Timeout(..)) => 1,
            Err(_) => 2,
        }] += 1;
    }
    assert!(seen[0] > 0 && seen[1] > 0, "too calm to prove anything: {seen:?}");
}

/// As docs/src/wire.md says, of the common functions too.
#[test]
fn what_follows_the_arguments_is_refused_and_nothing_is_run() {
    let (_place, mut launch, robot) = Place::running(&[&probe("probe.0", "", "")]);
    let mut tool = robot.tool(PATIENCE);
    let module = robot.name("probe.0");
    let write = |body: &mut Vec<u8>| {
        body.push(0);
        Ok(())
    };
    for function in [common::OFF, common::ON, common::STATUS, common::TIME] {
        match tool.call(module, function, common::HASH, write, |_| Ok(())) {
            Err(CallError::Fault(_, Fault::Arguments(why))) => assert_eq!(why, "1 bytes too many"),
            other => panic!("{function}: {other:?}"),
        }
    }
    assert_eq!(robot.state("probe.0"), "on");
    tool.close();
    launch.stop();
}
