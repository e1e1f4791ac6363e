//! Without memory, descriptors or rights: each gives a clear error, and what is there goes on.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::small_memory::{may_mount, with_small_memory};
use common::{Ground, LOW, MAILBOX, OTHER, label, shape, stay, tell, unfinished};
use nix::sys::resource::{Resource, getrlimit, setrlimit};
use rohrpost_mailbox::{CreateError, Name, Node, NodeError, Participant, Receiver, SendError, Shape, sys::room};
use std::fs;
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::time::{Duration, Instant};

#[test]
fn role() {
    let Some((role, ground)) = common::role() else { return };
    match role.split_once(' ').unwrap_or((&role, "")) {
        ("fill", _) => fill_a_small_memory(&ground),
        ("open", _) => open_until_there_is_no_descriptor(&ground),
        ("intrude", _) => intrude(&ground),
        ("own", number) => {
            let me = ground.join();
            let _all: Vec<_> = names(number.parse().unwrap()).map(|name| made(&me, name)).collect();
            tell("there");
            stay();
        }
        (other, _) => panic!("no role {other}"),
    }
}

/// A mailbox, made as soon as it is this process's turn: on a busy computer others may change the registry for longer
/// than anybody waits, and are said to. The test kills this process when none of them gets on.
fn made(me: &Arc<Participant>, name: Name) -> Receiver {
    loop {
        match me.receiver(name, SMALL) {
            Err(CreateError::Node(NodeError::Busy(_))) => {}
            made => return made.unwrap(),
        }
    }
}

/// Waits until a node has so many mailboxes, for as long as there are ever more.
fn wait_for_mailboxes(node: &Node, wanted: usize) {
    let (mut count, mut since) = (0, Instant::now());
    while count < wanted {
        let there = node.mailboxes().unwrap().len();
        if there > count {
            (count, since) = (there, Instant::now());
        }
        assert!(since.elapsed() < common::PATIENCE, "no more than {count} mailboxes of {wanted}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

const SMALL: Shape = Shape { slots: 1, body_bytes_max: 40, ..DEFAULT };
const DEFAULT: Shape = Shape {
    slots: 32,
    body_bytes_max: 1024,
    full: rohrpost_mailbox::OverflowPolicy::Displace,
    max_age: None,
    claims: 1,
};

/// Mailboxes of one process of several.
fn names(process: u8) -> impl Iterator<Item = Name> {
    (0..4).flat_map(move |class| (0..250).map(move |instance| Name::new(1, 1 + process * 4 + class, instance, 0)))
}

#[test]
fn without_memory_nothing_is_half_made_and_what_is_there_goes_on() {
    if !may_mount() {
        return rohrpost_test_report::skipped("a full /dev/shm; no mounts are allowed here");
    }
    let ground = Ground::new();
    let around = ground.path().parent().unwrap().to_owned();
    // For the node (5 pages), two tables of what is sent (9 each), a few mailboxes (2 each), and directories.
    let full = ground.start_with("fill", |command| with_small_memory(command, &around, 60));
    assert_eq!(full.hear(), "well");
    full.finish();
    assert!(!ground.path().exists(), "what it made was seen by itself alone");
}

/// In a process that sees a small memory of its own at the ground.
fn fill_a_small_memory(ground: &Ground) {
    let (node, me) = (ground.node(), ground.join());
    let mut all: Vec<_> = (names(0)).map_while(|name| me.receiver(name, SMALL).ok()).collect();
    let there = node.mailboxes().unwrap();
    assert_eq!(there.len(), all.len());
    for shape in [SMALL, DEFAULT] {
        let error = me.receiver(OTHER, shape).err().unwrap();
        let words = format!(
            "bytes of shared memory: No space left on device (os error 28); is it full (df {})?",
            node.path().display()
        );
        assert!(matches!(&error, CreateError::Memory { .. }) && error.to_string().ends_with(&words), "{error}");
    }
    // Neither has a process that wants to take part.
    let error = Participant::join(&node, Name::NONE).err().unwrap();
    assert!(matches!(&error, NodeError::Memory { .. }) && error.to_string().contains("is it full (df "), "{error}");
    let error = Node::create(&ground.path().with_file_name("other"), 0o700).err().unwrap();
    assert!(matches!(&error, NodeError::Memory { .. }), "{error}");
    // The process that could not make it removes what there is of it; what the error tells to look at is there all the
    // same.
    std::fs::remove_dir_all(ground.path().with_file_name("other")).unwrap();
    let said = error.to_string();
    let named = said.split_once("(df ").and_then(|(_, rest)| rest.strip_suffix(")?")).unwrap();
    assert!(Path::new(named).is_dir(), "{said}");
    assert_eq!((unfinished(ground.path()), node.mailboxes().unwrap()), (vec![], there));
    // What is there works to its last byte, and anew.
    for receiver in &mut all {
        let mut sender = me.sender(receiver.name()).unwrap();
        for _ in 0..3 {
            sender.send(&label(LOW, 1), &[&[7; 40]]).unwrap();
            assert_eq!(receiver.try_receive().unwrap().body(), [7; 40]);
        }
    }
    let last = all.pop().unwrap();
    let name = last.name();
    drop(last);
    all.push(me.receiver(name, SMALL).unwrap());
    all.pop().unwrap().close();
    let mut again = me.receiver(OTHER, SMALL).unwrap();
    me.sender(OTHER).unwrap().send(&label(LOW, 2), &[]).unwrap();
    assert!(again.try_receive().is_some());
    // What was begun in vain is in nobody's way.
    all.into_iter().for_each(|receiver| assert_eq!(receiver.close(), 0));
    let other = Node::create(&ground.path().with_file_name("other"), 0o700).unwrap();
    assert!(other.remove_if_dead().unwrap());
    tell("well");
}

#[test]
fn without_descriptors_the_error_names_the_limit_and_the_other_mailboxes_go_on() {
    let ground = Ground::new();
    let process = ground.start("open");
    assert_eq!(process.hear(), "well");
    process.finish();
    assert_eq!(unfinished(ground.path()), [] as [PathBuf; 0]);
}

/// Runs out of descriptors at each place where one is needed.
fn open_until_there_is_no_descriptor(ground: &Ground) {
    let (me, highest) = (ground.join(), getrlimit(Resource::RLIMIT_NOFILE).unwrap().1);
    for limit in 40..44 {
        setrlimit(Resource::RLIMIT_NOFILE, limit, highest).unwrap();
        let mut all = Vec::new();
        let error = names(0).find_map(|name| match me.receiver(name, SMALL) {
            Ok(receiver) => {
                all.push(receiver);
                None
            }
            Err(error) => Some(error),
        });
        let error = error.unwrap();
        assert!(matches!(&error, CreateError::Descriptors(_)), "{error}");
        assert!(error.to_string().contains("no file descriptor left") && error.to_string().contains("ulimit -n"));
        assert!(all.len() > 10 && all.len() as u64 <= limit);
        // One more may be had, but not what else they need.
        let spare: Vec<_> = std::iter::from_fn(|| fs::File::open("/dev/null").ok()).collect();
        assert!(matches!(Node::open(ground.path()), Err(NodeError::Descriptors(_))));
        assert!(matches!(Participant::join(me.node(), Name::NONE), Err(NodeError::Descriptors(_))));
        let told = me.sender(all[0].name()).err().unwrap();
        assert!(matches!(&told, SendError::Bad(..)) && told.to_string().contains("Too many open files"), "{told}");
        drop(spare);
        for receiver in &mut all {
            me.sender(receiver.name()).unwrap().send(&label(LOW, 1), &[]).unwrap();
            assert!(receiver.try_receive().is_some());
        }
        let name = all.pop().map(|last| last.name()).unwrap();
        all.push(me.receiver(name, SMALL).unwrap());
        for receiver in all {
            assert_eq!(receiver.close(), 0);
        }
    }
    tell("well");
}

/// With no more rights than any user; the parent has made what is there unreadable even for itself.
fn intrude(ground: &Ground) {
    // A user that no mode keeps out takes the rights of nobody.
    if nix::unistd::geteuid().is_root() {
        nix::unistd::setgid(65534.into()).unwrap();
        nix::unistd::setuid(65534.into()).unwrap();
    }
    let error = Node::open(ground.path()).err().unwrap();
    assert!(matches!(&error, NodeError::Denied(_)), "{error}");
    assert!(error.to_string().contains("be the user that owns the node"), "{error}");
    tell("kept out");
    let mut answer = String::new();
    io::stdin().read_line(&mut answer).unwrap();
    let node = Node::open(ground.path()).unwrap();
    let me = Participant::join(&node, Name::NONE).unwrap();
    assert_eq!(node.mailboxes().unwrap(), [MAILBOX], "it is there for all to see");
    assert!(node.look_at(MAILBOX).is_none());
    let told = [
        node.inspect(MAILBOX).err().unwrap().to_string(),
        me.sender(MAILBOX).err().unwrap().to_string(),
        me.receiver(MAILBOX, shape(4)).err().unwrap().to_string(),
    ];
    for told in &told {
        assert!(told.starts_with("mailbox 1.200.1.0: ") && told.contains("Permission denied"), "{told}");
    }
    assert!(me.receiver(OTHER, shape(4)).is_ok(), "a file that may not be read is in nobody's way");
    tell("well");
}

#[test]
fn without_rights_errors_tell_the_owner_and_the_closed_mailbox() {
    let ground = Ground::new();
    let around = ground.path().parent().unwrap();
    let mode = |path: &Path, mode: u32| fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
    let receiver = ground.join().receiver(MAILBOX, shape(4)).unwrap();
    mode(&ground.path().join(format!("{:08x}.mbx", MAILBOX.raw())), 0o000);
    drop(receiver);
    mode(around, 0o755);
    mode(ground.path(), 0o000);
    let intruder = ground.start_with("intrude", |command| {
        command.stdin(std::process::Stdio::piped());
    });
    assert_eq!(intruder.hear(), "kept out");
    mode(ground.path(), 0o777);
    mode(&ground.path().join("node"), 0o666);
    intruder.answer("come in");
    assert_eq!(intruder.hear(), "well");
    intruder.finish();
}

#[test]
fn ten_thousand_mailboxes_are_made_listed_used_and_removed() {
    const PROCESSES: u8 = 10;
    /// Each takes two pages, each process a little more.
    const BYTES: u64 = 10_000 * 2 * 4096 + (10 << 20);
    let memory = Path::new("/dev/shm");
    let has_room = room(memory).is_ok_and(|room| room.free > 2 * BYTES);
    let directory = if has_room { tempfile::tempdir_in(memory) } else { tempfile::tempdir() };
    let ground = Ground::within(directory.unwrap());
    let node: Arc<Node> = ground.node();
    let limit = getrlimit(Resource::RLIMIT_NOFILE).unwrap();
    let enough = |command: &mut Command| {
        let raise = move || {
            let wanted = limit.1.min(2048);
            setrlimit(Resource::RLIMIT_NOFILE, wanted, limit.1).map_err(io::Error::from)
        };
        // SAFETY: one system call, which may be made between fork and exec.
        unsafe { command.pre_exec(raise) };
    };
    // All at once: they wait for each other at the registry.
    let owners: Vec<_> = (0..PROCESSES).map(|number| ground.start_with(&format!("own {number}"), enough)).collect();
    wait_for_mailboxes(&node, 10_000);
    owners.iter().for_each(|owner| assert_eq!(owner.hear(), "there"));
    let all = node.mailboxes().unwrap();
    let expected: Vec<Name> = (0..PROCESSES).flat_map(names).collect();
    assert_eq!((all.len(), &all), (10_000, &expected));
    let pids: Vec<u32> = owners.iter().map(common::Process::id).collect();
    for (at, name) in all.iter().enumerate() {
        let seen = node.look_at(*name).unwrap();
        assert_eq!((seen.name, seen.depth, seen.owner), (*name, 0, Some(pids[at / 1000])));
    }
    let me = ground.join();
    for name in all.iter().step_by(97) {
        let mut sender = me.sender(*name).unwrap();
        sender.send(&label(LOW, 1), &[&[1; 40]]).unwrap();
        assert_eq!(node.look_at(*name).unwrap().depth, 1);
    }
    owners.into_iter().for_each(common::Process::kill);
    for name in &all {
        assert!(node.remove_orphan(*name).unwrap());
    }
    assert!(node.mailboxes().unwrap().is_empty());
    drop(me);
    assert!(node.remove_if_dead().unwrap() && !ground.path().exists());
}
