//! The caller's side of calls, against a server that is played by the test: real mailboxes, one process, no waiting for
//! luck.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_config::Principal;
use rohrpost_mailbox::{Head, Label, Name, Node, Options, Participant, Receiver, SendError, Sender, Shape, Type};
use rohrpost_modules::call::{
    CallEnvelope, CallError, Caller, Deduplicator, Fault, Link, Pending, REPLIES_KEPT, ReplyEnvelope, Request, Verdict,
};
use std::sync::Arc;
use std::time::Duration;
use tempfile::TempDir;

const CALLER: Name = Name::new(1, 90, 1, 0);
const SERVER: Name = Name::new(1, 200, 1, 0);
const OTHER: Name = Name::new(1, 201, 1, 0);
/// Never over before an answer that is there already is looked at.
const LONG: Duration = Duration::from_secs(60);

/// A caller's link, and two mailboxes that pose as servers.
struct Ground {
    link: Link,
    server: Receiver,
    other: Receiver,
    answers: Sender,
    node: Arc<Node>,
    _directory: TempDir,
}

fn ground() -> Ground {
    let directory = tempfile::tempdir().unwrap();
    let node = Node::create(&directory.path().join("node"), 0o700).unwrap();
    let join = |name| Participant::join(&node, name).unwrap();
    let caller = join(CALLER);
    let server = join(SERVER).receiver(SERVER, Shape::default()).unwrap();
    let other = join(OTHER).receiver(OTHER, Shape::default()).unwrap();
    let replies = caller.receiver(CALLER.with_local(1), Shape::default()).unwrap();
    let answers = join(Name::NONE).sender(CALLER.with_local(1)).unwrap();
    Ground { link: Link::new(&caller, CALLER, replies), server, other, answers, node, _directory: directory }
}

/// A command as the server sees it.
struct Command {
    head: Head,
    envelope: CallEnvelope,
    argument: u32,
}

fn take(server: &mut Receiver) -> Command {
    let package = server.try_receive().expect("a command");
    let (envelope, arguments) = CallEnvelope::split(package.body()).unwrap();
    Command { head: *package.head(), envelope, argument: postcard::from_bytes(arguments).unwrap() }
}

impl Ground {
    fn begin(&mut self, to: Name, argument: u32, timeout: Duration) -> Result<u32, CallError> {
        self.link.begin(to, 16, 77, timeout, |body| {
            body.extend(postcard::to_stdvec(&argument)?);
            Ok(())
        })
    }

    fn answer(&mut self, command: &Command, body: &[u8]) {
        let Command { head, envelope, .. } = command;
        self.answer_as(head.to, envelope.incarnation, envelope.sequence, Options::default(), body);
    }

    fn answer_as(&mut self, from: Name, incarnation: u32, sequence: u32, options: Options, body: &[u8]) {
        let envelope = ReplyEnvelope { incarnation, sequence }.to_bytes();
        let label = Label { from, kind: Type::reply(16), id: sequence as u16, options, ..Label::default() };
        self.answers.send(&label, &[&envelope, body]).unwrap();
    }

    fn wait(&mut self, sequence: u32) -> Result<u32, CallError> {
        self.link.wait(sequence, |bytes| postcard::from_bytes(bytes))
    }
}

#[test]
fn answers_find_their_calls_in_any_order_also_where_numbers_wrap() {
    for first in [1, 65_533, u32::MAX - 2] {
        let mut ground = ground();
        ground.link.set_next_sequence(first);
        let calls: Vec<u32> = (0..REPLIES_KEPT as u32).map(|n| ground.begin(SERVER, n, LONG).unwrap()).collect();
        assert_eq!(calls[3], first.wrapping_add(3));
        let mut commands: Vec<Command> = calls.iter().map(|_| take(&mut ground.server)).collect();
        commands.reverse();
        for command in &commands {
            ground.answer(command, &postcard::to_stdvec(&(command.argument * 10)).unwrap());
        }
        for (n, call) in calls.iter().enumerate() {
            assert_eq!(ground.wait(*call).unwrap(), n as u32 * 10, "call {n} from {first} on");
        }
    }
}

#[test]
fn only_its_own_answer_ends_a_call() {
    let mut ground = ground();
    let call = ground.begin(SERVER, 1, LONG).unwrap();
    let Command { envelope: CallEnvelope { incarnation, sequence, .. }, .. } = take(&mut ground.server);
    let wrong = postcard::to_stdvec(&666u32).unwrap();
    let none = Options::default();
    ground.answer_as(OTHER, incarnation, sequence, none, &wrong);
    ground.answer_as(SERVER, incarnation.wrapping_sub(1), sequence, none, &wrong);
    ground.answer_as(SERVER, incarnation, sequence.wrapping_add(65_536), none, &wrong);
    let other_function = Label { from: SERVER, kind: Type::reply(17), ..Label::default() };
    let envelope = ReplyEnvelope { incarnation, sequence }.to_bytes();
    ground.answers.send(&other_function, &[&envelope, &wrong]).unwrap();
    ground.answers.send(&Label { from: SERVER, kind: Type::reply(16), ..Label::default() }, &[b"short"]).unwrap();
    ground.answer_as(SERVER, incarnation, sequence, none, &postcard::to_stdvec(&5u32).unwrap());
    ground.answer_as(SERVER, incarnation, sequence, none, &wrong);
    assert_eq!(ground.wait(call).unwrap(), 5, "the first that is meant for it");
    assert!(matches!(ground.wait(call), Err(CallError::BadReply(..))), "it is over");
}

#[test]
fn late_answers_are_counted_and_those_to_forgotten_calls_are_dropped() {
    let mut ground = ground();
    let late = ground.begin(SERVER, 1, Duration::from_millis(3)).unwrap();
    assert!(matches!(ground.wait(late), Err(CallError::Timeout(SERVER, _))));
    let forgotten = ground.begin(SERVER, 2, LONG).unwrap();
    ground.link.forget(forgotten);
    let mut seen = Vec::new();
    while let Some(package) = ground.server.try_receive() {
        seen.push(CallEnvelope::split(package.body()).unwrap().0);
    }
    let counts = |ground: &Ground| {
        let [tally] = ground.link.tallies() else { panic!("{:?}", ground.link.tallies()) };
        (tally.calls, tally.unanswered, tally.late)
    };
    assert_eq!(counts(&ground), (1, 1, 0), "one has ended, without an answer");
    let refused = postcard::to_stdvec(&Fault::RouterFull).unwrap();
    ground.answer_as(SERVER, seen[0].incarnation, seen[0].sequence, Options::ERROR, &refused);
    ground.link.collect();
    assert_eq!(counts(&ground), (1, 1, 0), "that one try was refused is no answer");
    for envelope in &seen {
        ground.answer_as(SERVER, envelope.incarnation, envelope.sequence, Options::default(), &[9]);
    }
    let repeats = seen.iter().filter(|envelope| envelope.age_us > 0).count();
    assert!(
        repeats <= 2 && seen.len() == repeats + 2,
        "three tries in all, fewer on a busy computer: {repeats} repeats"
    );
    let call = ground.begin(SERVER, 3, LONG).unwrap();
    let command = take(&mut ground.server);
    ground.answer(&command, &[30]);
    assert_eq!(ground.wait(call).unwrap(), 30);
    assert_eq!(counts(&ground), (2, 0, 1), "the late one was answered after all");
}

#[test]
fn faults_come_as_faults() {
    let mut ground = ground();
    let silent = Fault::NodeSilent { node: "arm".into() };
    for fault in [Fault::ModuleOff, Fault::Interrupted, Fault::Busy, Fault::Arguments("no".into()), silent] {
        let call = ground.begin(SERVER, 1, LONG).unwrap();
        let CallEnvelope { incarnation, sequence, .. } = take(&mut ground.server).envelope;
        ground.answer_as(SERVER, incarnation, sequence, Options::ERROR, &postcard::to_stdvec(&fault).unwrap());
        let got = ground.wait(call);
        assert!(matches!(&got, Err(CallError::Fault(SERVER, said)) if *said == fault), "{got:?}");
    }
}

#[test]
fn a_refused_try_says_nothing_of_its_repeats() {
    let mut ground = ground();
    let call = ground.begin(SERVER, 1, Duration::from_secs(6)).unwrap();
    let first = take(&mut ground.server).envelope;
    // The repeat goes out, then the refusal of the first try comes in.
    while ground.server.try_receive().is_none() {
        assert!(ground.link.poll(call).is_none());
    }
    for refusal in [Fault::Busy, Fault::NoMailbox, Fault::NodeSilent { node: "arm".into() }] {
        let mut body = Vec::new();
        assert!(refusal.answer(&first.to_bytes(), &mut body), "as a router answers");
        let (_, fault) = ReplyEnvelope::split(&body).unwrap();
        ground.answer_as(SERVER, first.incarnation, first.sequence, Options::ERROR, fault);
        assert!(ground.link.poll(call).is_none(), "{refusal}");
    }
    ground.answer_as(SERVER, first.incarnation, first.sequence, Options::default(), &[8]);
    assert_eq!(ground.wait(call).unwrap(), 8);
}

#[test]
fn a_server_that_hangs_does_not_keep_us_from_calling_others() {
    let mut ground = ground();
    for n in 0..REPLIES_KEPT as u32 {
        ground.begin(OTHER, n, LONG).unwrap();
    }
    assert!(matches!(ground.begin(OTHER, 9, LONG), Err(CallError::TooMany(OTHER))));
    let call = ground.begin(SERVER, 1, LONG).unwrap();
    let command = take(&mut ground.server);
    ground.answer(&command, &[4]);
    assert_eq!(ground.wait(call).unwrap(), 4);
    assert_eq!(take(&mut ground.other).argument, 0);
}

#[test]
fn arguments_that_cannot_be_written_leave_nothing_behind() {
    let mut ground = ground();
    let failed = ground.link.begin(SERVER, 16, 77, LONG, |_| Err(postcard::Error::SerializeSeqLengthUnknown));
    assert!(matches!(failed, Err(CallError::BadArguments(_))));
    assert!(ground.server.try_receive().is_none());
    let nobody = Name::new(1, 250, 1, 0);
    assert!(matches!(ground.begin(nobody, 1, LONG), Err(CallError::NotSent(_))));
    let call = ground.begin(SERVER, 1, Duration::MAX).unwrap();
    assert_eq!(take(&mut ground.server).envelope.valid_for_us, u32::MAX, "the longest there is");
    assert!(ground.link.poll(call).is_none());
}

#[test]
fn pendings_are_waited_for_in_any_order_and_dropped_ones_are_given_up() {
    let mut ground = ground();
    let calls: Vec<u32> = (0..3).map(|n| ground.begin(SERVER, n, LONG).unwrap()).collect();
    for _ in &calls {
        let command = take(&mut ground.server);
        ground.answer(&command, &postcard::to_stdvec(&Ok::<u32, u8>(command.argument)).unwrap());
    }
    let link = Caller::from(ground.link);
    let pending = |call| Pending::<Result<u32, u8>>::new(link.clone(), call, SERVER);
    let [first, second, third] = [pending(calls[0]), pending(calls[1]), pending(calls[2])];
    assert_eq!(third.wait_result().unwrap(), 2);
    drop(second);
    assert_eq!(first.wait_result().unwrap(), 0);
    assert!(link.borrow_mut().poll(calls[1]).is_none(), "given up");
}

#[test]
fn a_missing_mailbox_is_looked_for_again_only_when_something_came_or_went() {
    let mut ground = ground();
    let node = ground.node.clone();
    let (file, hidden) = (node.path().join(format!("{:08x}.mbx", SERVER.raw())), node.path().join("hidden"));
    std::fs::rename(&file, &hidden).unwrap();
    let send = |ground: &mut Ground| ground.link.send(SERVER, &Label::default(), &[b"x"]);
    assert!(matches!(send(&mut ground), Err(SendError::NoMailbox(SERVER))));
    // Back without a word to the registry, which only a test does: a look finds it.
    std::fs::rename(&hidden, &file).unwrap();
    assert!(matches!(send(&mut ground), Err(SendError::NoMailbox(SERVER))), "it did not look");
    let third = Name::new(1, 202, 1, 0);
    let late = Participant::join(&node, third).unwrap();
    assert!(matches!(ground.link.send(third, &Label::default(), &[]), Err(SendError::NoMailbox(_))));
    let mut late = late.receiver(third, Shape::default()).unwrap();
    send(&mut ground).unwrap();
    ground.link.send(third, &Label::default(), &[b"first"]).unwrap();
    assert_eq!(late.try_receive().unwrap().body(), b"first");
}

/// Tools that start at once join one after the other, and may take the first name that is free in another order.
#[test]
fn the_later_owner_of_a_name_has_the_later_incarnation() {
    let mut ground = ground();
    let name = Name::new(1, 90, 2, 0);
    let [first, second] = [(); 2].map(|()| Participant::join(&ground.node, Name::NONE).unwrap());
    let mut once = Deduplicator::new(0, &[]);
    for participant in [&second, &first, &second] {
        let replies = participant.receiver(name.with_local(1), Shape::default()).unwrap();
        let mut link = Link::new(participant, name, replies);
        link.begin(SERVER, 16, 77, LONG, |_| Ok(())).unwrap();
        let package = ground.server.try_receive().unwrap();
        let (envelope, _) = CallEnvelope::split(package.body()).unwrap();
        let request = Request {
            from: package.head().from,
            principal: Principal::Unknown,
            incarnation: envelope.incarnation,
            sequence: envelope.sequence,
            valid_for_ns: u64::from(envelope.valid_for_us) * 1000,
            age_ns: 0,
            repeat: false,
            redelivered: false,
            idempotent: false,
        };
        assert_eq!(once.validate(&request, 1), Verdict::Run, "{request:?}");
        once.done(&request, 1, false, &[]);
        link.close();
    }
}

#[test]
fn a_call_to_all_systems_has_the_first_answer_and_no_fault_of_one_of_them() {
    let mut ground = ground();
    let everywhere = Name::new(rohrpost_mailbox::ALL_SYSTEMS, 200, 1, 0);
    // What goes there some client takes.
    ground.node.set_routes_beyond(OTHER, &[(everywhere, everywhere)]).unwrap();
    let sequence = ground.begin(everywhere, 7, LONG).unwrap();
    let command = take(&mut ground.other);
    let (incarnation, fault) = (command.envelope.incarnation, postcard::to_stdvec(&Fault::NoMailbox).unwrap());
    ground.answer_as(Name::new(2, 200, 1, 0), incarnation, sequence, Options::ERROR, &fault);
    // It has not called the first of these; the last comes too late.
    for (system, class, answer) in [(3, 201, 1_u32), (3, 200, 8), (4, 200, 9)] {
        let answer = postcard::to_stdvec(&answer).unwrap();
        ground.answer_as(Name::new(system, class, 1, 0), incarnation, sequence, Options::default(), &answer);
    }
    assert_eq!(ground.wait(sequence).unwrap(), 8);
}
