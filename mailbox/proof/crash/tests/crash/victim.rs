//! What the victims do: each sets its scene, arms the step that will kill it, and does one operation.

use crate::ground::{Ground, HIGH, LATEST, LOW, MAILBOX, OTHER_SHAPE, SHAPE, send};
use crate::streams;
use nix::sys::resource::{Resource, setrlimit};
use rohrpost_mailbox_crash::{
    Interest, Label, Loan, Name, Node, Participant, Priority, TimeKeeper, TimeSource, Type, Watches, step,
};
use std::path::Path;
use std::time::Duration;

/// Not a test of its own: the processes that `Ground::run` starts come here.
#[test]
fn victim() {
    let Ok(role) = std::env::var("ROHRPOST_VICTIM") else { return };
    setrlimit(Resource::RLIMIT_CORE, 0, 0).unwrap();
    let ground = Ground::at(Path::new(&std::env::var("ROHRPOST_GROUND").unwrap()));
    let fatal = std::env::var("ROHRPOST_FATAL").unwrap().parse().unwrap();
    act(&role, &ground, || step::arm(fatal));
    // What is dropped from here on is no part of the operation.
    step::arm(u64::MAX);
}

fn act(role: &str, ground: &Ground, arm: impl Fn()) {
    if let Some(role) = role.strip_prefix("stream: ") {
        return streams::act(role, ground, arm);
    }
    match role {
        "create node" => {
            arm();
            drop(Node::create(ground.path(), 0o700).unwrap());
        }
        "join" => {
            let node = ground.node();
            arm();
            let participant = Participant::join(&node, Name::new(1, 200, 1, 0)).unwrap();
            die_with(participant);
        }
        "create" | "adopt" | "replace" => {
            let participant = ground.join();
            let shape = if role == "replace" { OTHER_SHAPE } else { SHAPE };
            arm();
            let receiver = participant.receiver(MAILBOX, shape).unwrap();
            die_with(receiver);
        }
        "send" | "displace" => {
            let mut sender = ground.sender();
            arm();
            send(&mut sender, HIGH, 100).unwrap();
            die_with(sender);
        }
        "send the newest" => {
            let mut sender = ground.sender();
            send(&mut sender, LOW, 100).unwrap();
            arm();
            send(&mut sender, LOW, 101).unwrap();
            die_with(sender);
        }
        "send anew what was received" => {
            let mut receiver = ground.join().receiver(MAILBOX, LATEST).unwrap();
            let mut sender = ground.sender();
            send(&mut sender, LOW, 100).unwrap();
            drop(receiver.try_receive().unwrap());
            arm();
            send(&mut sender, LOW, 101).unwrap();
            die_with((sender, receiver));
        }
        "watch" => {
            let participant = ground.join();
            arm();
            die_with(Watches::new(&participant).unwrap());
        }
        "sleep in poll" => {
            let mut receiver = ground.receiver();
            let (_far, near) = std::os::unix::net::UnixStream::pair().unwrap();
            let mut watches = Watches::new(receiver.participant()).unwrap();
            watches.add(&near, Interest::Read).unwrap();
            arm();
            watches.wait_any(&mut [&mut receiver], Duration::from_millis(1), || false);
            die_with((receiver, watches));
        }
        "be refused" => {
            let mut sender = ground.sender();
            arm();
            assert!(send(&mut sender, LOW, 100).is_err());
            die_with(sender);
        }
        "drop a loan" => {
            let mut sender = ground.sender();
            arm();
            drop(sender.loan(HIGH).unwrap());
        }
        "send into a retired mailbox" => {
            let old = ground.receiver();
            let mut sender = ground.sender();
            let owner = old.participant().clone();
            drop(old);
            let receiver = owner.receiver(MAILBOX, OTHER_SHAPE).unwrap();
            arm();
            send(&mut sender, HIGH, 100).unwrap();
            die_with((sender, receiver));
        }
        "publish into a retired mailbox" => {
            let old = ground.receiver();
            let mut sender = ground.sender();
            let mut loan = sender.loan(HIGH).unwrap();
            let label = write(&mut loan, 100);
            let owner = old.participant().clone();
            drop(old);
            let receiver = owner.receiver(MAILBOX, OTHER_SHAPE).unwrap();
            arm();
            loan.send(&label, 8).unwrap();
            die_with((sender, receiver));
        }
        "receive" => {
            let mut receiver = ground.receiver();
            arm();
            drop(receiver.try_receive().unwrap());
            die_with(receiver);
        }
        "receive nothing" => {
            let mut receiver = ground.receiver();
            arm();
            assert!(receiver.receive_timeout(Duration::from_millis(1)).is_none());
            die_with(receiver);
        }
        "receive stale" => {
            let shape = rohrpost_mailbox_crash::Shape { max_age: Some(Duration::from_nanos(1)), ..SHAPE };
            let mut receiver = ground.join().receiver(MAILBOX, shape).unwrap();
            ground.send(LOW, 0..3);
            arm();
            assert!(receiver.try_receive().is_none());
            die_with(receiver);
        }
        "search after a death" => {
            let mut receiver = ground.receiver();
            assert!(ground.run("die displacing", u64::MAX).is_some());
            ground.node().announce_death();
            arm();
            drop(receiver.try_receive());
            die_with(receiver);
        }
        "say what it is for" => {
            let receiver = ground.receiver();
            receiver.set_about(b"old").unwrap();
            arm();
            receiver.set_about(b"new").unwrap();
            die_with(receiver);
        }
        "close" => {
            let receiver = ground.receiver();
            arm();
            receiver.close();
        }
        "remove an orphan" => {
            let node = ground.node();
            arm();
            assert!(node.remove_orphan(MAILBOX).unwrap());
        }
        "clean up" => {
            let node = ground.node();
            arm();
            assert!(node.remove_if_dead().unwrap());
        }
        "begin time" => {
            let node = ground.node();
            arm();
            TimeKeeper::begin(&node, TimeSource::Simulation, 5_000_000_000, 2.0).unwrap();
        }
        "change pace" => {
            let mut keeper = TimeKeeper::begin(&ground.node(), TimeSource::Simulation, 5_000_000_000, 2.0).unwrap();
            arm();
            keeper.set_pace(3.0);
        }
        // Parts of other victims' scenes: they always die.
        "die with a package" => {
            let mut receiver = ground.receiver();
            let _package = receiver.try_receive().unwrap();
            std::process::abort();
        }
        "die displacing" => {
            let mut sender = ground.sender();
            let _loan = sender.loan(HIGH).unwrap();
            std::process::abort();
        }
        other => panic!("there is no victim {other}"),
    }
}

/// Leaves without dropping, as if killed right after the operation.
pub(crate) fn die_with<T>(what: T) {
    std::mem::forget(what);
}

/// Fills a loan as `send` does.
pub(crate) fn write(loan: &mut Loan<'_>, id: u32) -> Label {
    let body = loan.body();
    body[..4].copy_from_slice(&id.to_le_bytes());
    body[4..8].copy_from_slice(&(!id).to_le_bytes());
    Label { priority: Priority(0), kind: Type::command(16), ..Label::default() }
}
