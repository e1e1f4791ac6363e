//! Directories, owners, places in the table, and files that are not what they should be.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::{Ground, LOW, MAILBOX, OTHER, label, shape, stay, tell, until};
use rohrpost_mailbox::{
    CreateError, ModuleState, Name, Node, NodeError, PARTICIPANTS_MAX, Participant, SendError, Shape,
};
use std::fs;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

#[test]
fn role() {
    let Some((role, ground)) = common::role() else { return };
    let node = ground.node();
    let _held: Box<dyn std::any::Any> = match role.as_str() {
        "own" => Box::new(ground.join().receiver(MAILBOX, shape(4)).unwrap()),
        "replace with too little memory" => {
            nix::sys::resource::setrlimit(nix::sys::resource::Resource::RLIMIT_FSIZE, 100_000, 100_000).unwrap();
            // SAFETY: the signal that tells of the limit is ignored, so that the call fails as on a full /dev/shm.
            unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_IGN) };
            let error = ground.join().receiver(MAILBOX, shape(1000)).err().unwrap();
            tell(error);
            return;
        }
        "launch" => Box::new(node.launch_lock().unwrap()),
        "live" => {
            let participant = Participant::join(&node, Name::new(1, 16, 2, 7)).unwrap();
            participant.set_state(ModuleState::On);
            participant.set_restarts(3);
            Box::new(participant)
        }
        other => panic!("no role {other}"),
    };
    tell("there");
    stay();
}

fn file_of(ground: &Ground, name: Name) -> PathBuf {
    ground.path().join(format!("{:08x}.mbx", name.raw()))
}

#[test]
fn whatever_comes_and_goes_raises_the_epoch() {
    let (ground, node) = Ground::made();
    let mut last = node.registry_epoch();
    let mut raised = |what: &str| {
        assert_ne!(node.registry_epoch(), last, "{what}");
        last = node.registry_epoch();
    };
    let receiver = ground.join().receiver(MAILBOX, shape(4)).unwrap();
    raised("new");
    drop(receiver);
    let receiver = ground.join().receiver(MAILBOX, shape(4)).unwrap();
    raised("taken over: its maker may have died before it could say so");
    drop(receiver);
    let receiver = ground.join().receiver(MAILBOX, shape(8)).unwrap();
    raised("replaced");
    receiver.close();
    raised("gone");
    drop(ground.join().receiver(OTHER, shape(4)).unwrap());
    raised("new");
    node.remove_orphan(OTHER).unwrap();
    raised("removed");
}

#[test]
fn a_second_owner_is_refused_and_told_the_first_one() {
    let ground = Ground::new();
    let first = ground.start("own");
    assert_eq!(first.hear(), "there");
    for shape in [shape(4), shape(5)] {
        let error = ground.join().receiver(MAILBOX, shape).err().unwrap();
        assert!(matches!(error, CreateError::Owned(MAILBOX, pid) if pid == first.id()), "{error}");
    }
    assert_eq!(ground.look().owner, Some(first.id()));
    assert!(!ground.node().remove_orphan(MAILBOX).unwrap());
    first.kill();
    assert_eq!(ground.look().owner, None);
    assert_eq!(ground.join().receiver(MAILBOX, shape(4)).unwrap().name(), MAILBOX);
    assert_eq!(ground.look().adoptions, 1);
}

#[test]
fn without_memory_for_its_successor_a_mailbox_stays() {
    let ground = Ground::new();
    drop(ground.join().receiver(MAILBOX, shape(4)).unwrap());
    let mut sender = ground.sender();
    sender.send(&label(LOW, 1), &[]).unwrap();
    let greedy = ground.start("replace with too little memory");
    let error = greedy.hear();
    assert!(error.contains("bytes of shared memory"), "{error}");
    greedy.finish();
    sender.send(&label(LOW, 2), &[]).unwrap();
    let mut receiver = ground.join().receiver(MAILBOX, shape(4)).unwrap();
    assert_eq!([1, 2].map(|_| receiver.try_receive().unwrap().head().id), [1, 2]);
    let unfinished = |name: &str| name == "unfinished" || name.ends_with(".new");
    let names = fs::read_dir(ground.path()).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    assert_eq!(names.filter(|name| unfinished(name)).count(), 0, "nothing unfinished lies about");
}

#[test]
fn names_and_shapes_that_cannot_be_are_refused() {
    let (ground, me) = Ground::joined();
    let reserved = me.receiver(Name::new(0, 200, 1, 0), shape(4)).err().unwrap();
    assert!(matches!(reserved, CreateError::Reserved(_)), "{reserved}");
    assert!(matches!(me.receiver(MAILBOX, shape(0)), Err(CreateError::Shape(MAILBOX, _))));
    assert!(ground.node().mailboxes().unwrap().is_empty());
}

#[test]
fn two_nodes_do_not_see_each_other() {
    let (one, two) = (Ground::new(), Ground::new());
    let _receiver = one.join().receiver(MAILBOX, shape(4)).unwrap();
    let stranger = two.join();
    assert!(matches!(stranger.sender(MAILBOX), Err(SendError::NoMailbox(_))));
    let _same_name = stranger.receiver(MAILBOX, shape(4)).unwrap();
    stranger.sender(MAILBOX).unwrap().send(&label(LOW, 1), &[]).unwrap();
    assert_eq!((one.look().depth, two.look().depth), (0, 1));
}

#[test]
fn nobody_else_may_enter() {
    let ground = Ground::new();
    let _receiver = ground.join().receiver(MAILBOX, shape(4)).unwrap();
    let mode = |path: &std::path::Path| fs::metadata(path).unwrap().mode() & 0o777;
    assert_eq!(mode(ground.path()), 0o700);
    for file in fs::read_dir(ground.path()).unwrap() {
        assert_eq!(mode(&file.unwrap().path()), 0o600);
    }
    fs::set_permissions(ground.path(), fs::Permissions::from_mode(0o777)).unwrap();
    let _node = ground.node();
    assert_eq!(mode(ground.path()), 0o700, "put right at the next start");
}

#[test]
fn a_wider_mode_lets_others_use_the_files_too() {
    let ground = Ground::new();
    let path = ground.path().join("shared");
    let node = Node::create(&path, 0o770).unwrap();
    let participant = Participant::join(&node, Name::NONE).unwrap();
    let _receiver = participant.receiver(MAILBOX, shape(4)).unwrap();
    let mode = |name: &str| fs::metadata(path.join(name)).unwrap().mode() & 0o777;
    assert_eq!(fs::metadata(&path).unwrap().mode() & 0o777, 0o770);
    assert_eq!((mode("node"), mode(&format!("{:08x}.mbx", MAILBOX.raw()))), (0o660, 0o660));
}

#[test]
fn files_that_are_no_mailboxes_are_told_from_those_that_are() {
    let whole = {
        let ground = Ground::new();
        let _receiver = ground.join().receiver(MAILBOX, shape(4)).unwrap();
        fs::read(file_of(&ground, MAILBOX)).unwrap()
    };
    let damaged = |at: usize, byte: u8| {
        let mut bytes = whole.clone();
        bytes[at] = byte;
        bytes
    };
    let garbage: Vec<u8> = (0..20_000u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    let foreign = "its file is no mailbox, or damaged; end its owner, and remove the file with `rohrpost clean`";
    let version = format!(
        "it was made by another version (layout 99, this program {}); build both from the same version",
        rohrpost_mailbox::LAYOUT_VERSION
    );
    for (what, bytes) in [
        ("empty", vec![]),
        ("a few bytes", whole[..100].to_vec()),
        ("cut off", whole[..whole.len() - 1].to_vec()),
        ("garbage", garbage),
        ("zeroes", vec![0; 20_000]),
        ("another version", damaged(8, 99)),
        ("another name", damaged(12, 1)),
        ("too many slots", damaged(17, 0xff)),
        ("too large bodies", damaged(22, 0xff)),
        ("an unknown policy", damaged(24, 7)),
        ("no claims", damaged(28, 0)),
    ] {
        let (ground, me) = Ground::joined();
        fs::write(file_of(&ground, MAILBOX), bytes).unwrap();
        let error = me.sender(MAILBOX).err().unwrap();
        let why = if what == "another version" { &version } else { foreign };
        assert_eq!(error.to_string(), format!("mailbox 1.200.1.0: {why}"), "{what}");
        assert!(ground.node().look_at(MAILBOX).is_none(), "{what}");
        let mut receiver = me.receiver(MAILBOX, shape(4)).unwrap();
        me.sender(MAILBOX).unwrap().send(&label(LOW, 1), &[]).unwrap();
        assert!(receiver.try_receive().is_some(), "{what} is replaced");
        fs::write(file_of(&ground, OTHER), b"garbage").unwrap();
        assert!(ground.node().remove_orphan(OTHER).unwrap(), "or removed");
    }
}

#[test]
fn garbage_in_the_slots_is_survived() {
    let ground = Ground::new();
    drop(ground.join().receiver(MAILBOX, shape(4)).unwrap());
    let mut bytes = fs::read(file_of(&ground, MAILBOX)).unwrap();
    for byte in bytes.iter_mut().skip(128) {
        *byte = byte.wrapping_mul(31).wrapping_add(0xa5);
    }
    // Not retired, or it would just be replaced.
    bytes[140..144].fill(0);
    fs::write(file_of(&ground, MAILBOX), bytes).unwrap();
    let mut receiver = ground.join().receiver(MAILBOX, shape(4)).unwrap();
    while receiver.try_receive().is_some() {}
    let mut sender = ground.sender();
    for _ in 0..100 {
        let _ = sender.send(&label(LOW, 1), &[b"whatever"]);
        let _ = receiver.try_receive();
    }
    let _ = ground.look();
}

#[test]
fn odd_things_in_the_directory_stop_nothing() {
    let (ground, me) = Ground::joined();
    for name in ["1.mbx", "+1c80100.mbx", "zzz.mbx", "01C80101.mbx", "notes.txt"] {
        fs::write(ground.path().join(name), b"odd").unwrap();
    }
    assert!(ground.node().mailboxes().unwrap().is_empty());
    let pipe = file_of(&ground, OTHER);
    let path = std::ffi::CString::new(pipe.to_str().unwrap()).unwrap();
    // SAFETY: a valid C string that outlives the call.
    assert_eq!(unsafe { libc::mkfifo(path.as_ptr(), 0o600) }, 0);
    assert!(ground.node().look_at(OTHER).is_none(), "does not wait for a writer");
    assert!(matches!(me.sender(OTHER), Err(SendError::Bad(OTHER, _))));
    std::os::unix::fs::symlink("/etc/passwd", file_of(&ground, MAILBOX)).unwrap();
    let error = me.sender(MAILBOX).err().unwrap();
    assert!(error.to_string().contains("a link stands where the file of the mailbox belongs"), "{error}");
    assert!(ground.node().look_at(MAILBOX).is_none(), "never through a link");
    let before = fs::read("/etc/passwd").unwrap();
    let receiver = me.receiver(MAILBOX, shape(4)).unwrap();
    assert!(fs::symlink_metadata(file_of(&ground, MAILBOX)).unwrap().is_file(), "the link itself gives way");
    assert_eq!(fs::read("/etc/passwd").unwrap(), before);
    receiver.close();
    drop(me);
    assert!(ground.node().remove_if_dead().unwrap());
}

#[test]
fn the_table_of_participants_has_an_end() {
    let ground = Ground::new();
    let mut all: Vec<_> = (0..PARTICIPANTS_MAX).map(|_| ground.join()).collect();
    let error = Participant::join(&ground.node(), Name::NONE).err().unwrap();
    assert!(matches!(error, NodeError::Crowded(_)), "{error}");
    assert_eq!(ground.node().participants().len(), PARTICIPANTS_MAX);
    let gone = all.swap_remove(100).incarnation();
    let incarnation = ground.join().incarnation();
    assert!(incarnation != gone && all.iter().all(|other| other.incarnation() != incarnation));
}

#[test]
fn the_living_are_listed_and_the_dead_are_not() {
    let ground = Ground::new();
    let process = ground.start("live");
    assert_eq!(process.hear(), "there");
    let listed = ground.node().participants();
    let one = &listed[0];
    assert_eq!((listed.len(), one.module, one.pid), (1, Name::new(1, 16, 2, 0), process.id()));
    assert_eq!((one.state, one.restarts), (Some(ModuleState::On), 3));
    process.kill();
    assert!(ground.node().participants().is_empty());
}

#[test]
fn a_node_is_launched_once() {
    let ground = Ground::new();
    assert_eq!(ground.node().launcher(), None);
    let process = ground.start("launch");
    assert_eq!(process.hear(), "there");
    let error = ground.node().launch_lock().err().unwrap();
    assert!(matches!(error, NodeError::Launched(_, pid) if pid == process.id()), "{error}");
    assert_eq!(ground.node().launcher(), Some(process.id()));
    process.kill();
    let lock = ground.node().launch_lock().unwrap();
    assert_eq!(ground.node().launcher(), Some(std::process::id()));
    drop(lock);
    assert_eq!(ground.node().launcher(), None);
}

#[test]
fn looking_changes_nothing() {
    let (ground, mut receiver, mut sender) = Ground::ends(shape(4));
    (0..3).for_each(|id| sender.send(&label(LOW, id), &[]).unwrap());
    let _in_hand = receiver.try_receive().unwrap();
    let before = fs::read(file_of(&ground, MAILBOX)).unwrap();
    let first = ground.look();
    for _ in 0..100 {
        let info = ground.look();
        assert_eq!((info.depth, info.sent, info.owner, info.shape), (3, 3, first.owner, shape(4)));
    }
    assert_eq!(fs::read(file_of(&ground, MAILBOX)).unwrap(), before);
}

#[test]
fn only_the_dead_are_removed() {
    let ground = Ground::new();
    for role in ["own", "launch", "live"] {
        let process = ground.start(role);
        assert_eq!(process.hear(), "there");
        assert!(!ground.node().remove_if_dead().unwrap(), "{role}");
        assert_eq!(ground.node().mailboxes().unwrap().len(), 1, "and its mailboxes neither");
        process.kill();
    }
    let late = Node::open(ground.path()).unwrap();
    assert!(ground.node().remove_if_dead().unwrap());
    assert!(matches!(Node::open(ground.path()), Err(NodeError::Missing(_))));
    // A process that opened the node before finds that it is another now.
    assert!(Participant::join(&late, Name::NONE).is_err());
    let _again = ground.join();
    assert!(matches!(Participant::join(&late, Name::NONE), Err(NodeError::Missing(_))));
    assert!(matches!(late.launch_lock(), Err(NodeError::Missing(_))));
}

#[test]
fn removing_and_joining_at_once_leave_no_ghosts() {
    let ground = Ground::new();
    let path = ground.path().to_owned();
    let attempts = Arc::new(AtomicU32::new(0));
    let remover = std::thread::spawn({
        let attempts = attempts.clone();
        move || {
            let removed = || Node::open(&path).is_ok_and(|node| node.remove_if_dead().unwrap_or(false));
            let mut removals = 0;
            until("often enough removed", || {
                removals += u32::from(removed());
                attempts.fetch_add(1, Ordering::AcqRel);
                removals == 50
            });
        }
    });
    let mut joined = 0;
    while !remover.is_finished() {
        let before = attempts.load(Ordering::Acquire);
        until("the remover has had its chance", || {
            attempts.load(Ordering::Acquire) >= before + joined % 3 || remover.is_finished()
        });
        let Ok(node) = Node::create(ground.path(), 0o700) else { continue };
        let Ok(me) = Participant::join(&node, Name::NONE) else { continue };
        joined += 1;
        // Once joined, nobody takes the node away.
        let mut receiver = me.receiver(MAILBOX, Shape::default()).unwrap();
        let mut sender = me.sender(MAILBOX).unwrap();
        sender.send(&label(LOW, 1), &[]).unwrap();
        assert!(receiver.try_receive().is_some());
    }
    remover.join().unwrap();
    assert!(joined > 0);
}

#[test]
fn words_beside_a_mailbox_are_whole_and_go_with_it() {
    let (ground, node) = Ground::made();
    let receiver = ground.join().receiver(MAILBOX, shape(4)).unwrap();
    assert_eq!(node.about(MAILBOX), None);
    for words in [&b"first"[..], b"", b"of another length"] {
        receiver.set_about(words).unwrap();
        assert_eq!(node.about(MAILBOX).as_deref(), Some(words));
    }
    drop(receiver);
    assert!(node.about(MAILBOX).is_some(), "the mailbox stays, and so do they");
    let receiver = ground.join().receiver(MAILBOX, shape(5)).unwrap();
    assert!(node.about(MAILBOX).is_some(), "replaced, not removed");
    receiver.close();
    assert_eq!(node.about(MAILBOX), None);
    let receiver = ground.join().receiver(MAILBOX, shape(5)).unwrap();
    receiver.set_about(&vec![0; (1 << 20) + 1]).unwrap();
    assert_eq!(node.about(MAILBOX), None, "too long to be read");
    drop(receiver);
    assert!(node.remove_orphan(MAILBOX).unwrap());
    let left = fs::read_dir(ground.path()).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    assert_eq!(left.filter(|name| name.contains("about")).count(), 0);
}
