//! Files that are cut off, damaged, of another version or not ours at all, wherever a node keeps one: each is told or
//! passed over, and stops nobody. Those of mailboxes are in `registry`.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::{Ground, LOW, MAILBOX, label, shape};
use rohrpost_mailbox::{
    CreateError, LAYOUT_VERSION, Name, Node, NodeError, Participant, SystemClock, TimeKeeper, TimeSource, Watches,
};
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::Path;

/// What may stand in a file's place.
#[derive(Debug, Clone)]
enum Thing {
    Bytes(Vec<u8>),
    Directory,
    Pipe,
    Link,
}

impl Thing {
    fn put(&self, at: &Path) {
        match self {
            Self::Bytes(bytes) => fs::write(at, bytes).unwrap(),
            Self::Directory => fs::create_dir(at).unwrap(),
            Self::Pipe => {
                let path = std::ffi::CString::new(at.as_os_str().as_bytes()).unwrap();
                // SAFETY: a valid C string that outlives the call.
                assert_eq!(unsafe { libc::mkfifo(path.as_ptr(), 0o600) }, 0);
            }
            Self::Link => std::os::unix::fs::symlink("/etc/passwd", at).unwrap(),
        }
    }

    fn is_still(&self, at: &Path) -> bool {
        let kind = fs::symlink_metadata(at).unwrap().file_type();
        match self {
            Self::Bytes(bytes) => kind.is_file() && fs::read(at).unwrap() == *bytes,
            Self::Directory => kind.is_dir(),
            Self::Pipe => kind.is_fifo(),
            Self::Link => kind.is_symlink(),
        }
    }
}

fn garbage(bytes: u32) -> Vec<u8> {
    (0..bytes).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect()
}

#[test]
fn what_is_no_node_is_refused_and_left_as_it_is() {
    let whole = {
        let ground = Ground::new();
        let _node = ground.node();
        fs::read(ground.path().join("node")).unwrap()
    };
    let mut of_another_version = whole.clone();
    of_another_version[8..12].copy_from_slice(&99u32.to_ne_bytes());
    let damaged = "its file `node` is damaged, or not Rohrpost's; stop what runs there and remove the directory";
    let version = format!("another version of Rohrpost (layout 99, this program has {LAYOUT_VERSION})");
    for (what, thing, words) in [
        ("a few bytes", Thing::Bytes(b"hello".to_vec()), damaged),
        ("its first line", Thing::Bytes(whole[..64].to_vec()), damaged),
        ("all but its last byte", Thing::Bytes(whole[..whole.len() - 1].to_vec()), damaged),
        ("garbage", Thing::Bytes(garbage(40_000)), damaged),
        ("another version's", Thing::Bytes(of_another_version.clone()), &version),
        ("another version's, shorter", Thing::Bytes(of_another_version[..64].to_vec()), &version),
        ("a pipe", Thing::Pipe, damaged),
        ("a directory", Thing::Directory, damaged),
        ("a link", Thing::Link, damaged),
    ] {
        let ground = Ground::new();
        fs::create_dir(ground.path()).unwrap();
        let file = ground.path().join("node");
        thing.put(&file);
        for error in [Node::open(ground.path()).err(), Node::create(ground.path(), 0o700).err()] {
            let error = error.unwrap_or_else(|| panic!("{what} is taken for a node")).to_string();
            assert!(error.contains(words) && error.contains(ground.path().to_str().unwrap()), "{what}: {error}");
        }
        assert!(thing.is_still(&file), "{what}");
    }
    // As their maker leaves them that dies in the act.
    for bytes in [vec![], vec![0; 4096], vec![0; whole.len()]] {
        let ground = Ground::new();
        fs::create_dir(ground.path()).unwrap();
        fs::write(ground.path().join("node"), bytes).unwrap();
        assert!(Node::open(ground.path()).is_ok_and(|node| node.participants().is_empty()));
        drop(ground.join());
    }
}

#[test]
fn a_file_that_is_written_whole_overwrites_nothing_but_itself() {
    let ground = Ground::new();
    let node = Node::create(ground.path(), 0o770).unwrap();
    let victim = ground.path().with_file_name("of a user");
    fs::write(&victim, "kept").unwrap();
    for name in ["notes", "notes.new"] {
        let at = ground.path().join(name);
        for thing in [Thing::Pipe, Thing::Bytes(garbage(3_000_000))] {
            thing.put(&at);
            assert!(name == "notes.new" || node.read_file("notes").is_err(), "{thing:.40?} is read");
            node.put_file("notes", b"words").unwrap();
            assert_eq!(node.read_file("notes").unwrap().unwrap(), b"words");
            fs::remove_file(ground.path().join("notes")).unwrap();
        }
        std::os::unix::fs::symlink(&victim, &at).unwrap();
        assert!(name == "notes.new" || node.read_file("notes").is_err(), "a link is followed");
        node.put_file("notes", b"words").unwrap();
        assert_eq!(fs::read_to_string(&victim).unwrap(), "kept", "{name}");
        let made = fs::symlink_metadata(ground.path().join("notes")).unwrap();
        assert!(made.is_file() && made.mode() & 0o777 == 0o660, "{name}: {:o}", made.mode());
        fs::remove_file(ground.path().join("notes")).unwrap();
    }
    assert_eq!(node.read_file("notes").unwrap(), None);
}

#[test]
fn whatever_stands_beside_the_mailboxes_stops_nobody_and_goes_with_the_node() {
    let things = [
        Thing::Bytes(vec![]),
        Thing::Bytes(b"hello".to_vec()),
        Thing::Bytes(garbage(40_000)),
        Thing::Bytes(vec![0xff; 40_000]),
        Thing::Directory,
        Thing::Pipe,
        Thing::Link,
    ];
    let about = format!("{:08x}.about", MAILBOX.raw());
    for name in ["traffic.0", "traffic.0.new", "time", "bell.0", "unfinished", &about] {
        for thing in &things {
            let (ground, node) = Ground::made();
            thing.put(&ground.path().join(name));
            let what = format!("{thing:.40?} at {name}");
            let is_error = |error: &NodeError| matches!(error, NodeError::Io(path, _) if path.ends_with(name));
            // Readers.
            assert!(node.traffic().is_empty() && node.mailboxes().unwrap().is_empty(), "{what}");
            let _ = (node.about(MAILBOX), SystemClock::open(&node).now());
            // Participants. Only what they cannot put aside is told, and where it is.
            match Participant::join(&node, Name::NONE) {
                Err(error) => {
                    assert!(matches!(thing, Thing::Directory) && name.starts_with("traffic"), "{what}: {error}")
                }
                Ok(me) => {
                    let mut receiver = match me.receiver(MAILBOX, shape(4)) {
                        Ok(receiver) => receiver,
                        Err(error) => {
                            let is_it = matches!(&error, CreateError::File(MAILBOX, path, _) if path.ends_with(name));
                            assert!(
                                is_it && matches!(thing, Thing::Directory) && name == "unfinished",
                                "{what}: {error}"
                            );
                            continue;
                        }
                    };
                    let mut sender = me.sender(MAILBOX).unwrap();
                    sender.send(&label(LOW, 1), &[b"all the same"]).unwrap();
                    assert_eq!(receiver.try_receive().unwrap().body(), b"all the same", "{what}");
                    assert_eq!(node.traffic().len(), 1, "{what}");
                    match receiver.set_about(b"for tests") {
                        Ok(()) => assert_eq!(node.about(MAILBOX).unwrap(), b"for tests", "{what}"),
                        Err(error) => assert!(is_error(&error) && name == about, "{what}: {error}"),
                    }
                    if let Err(error) = Watches::new(&me) {
                        assert!(matches!(thing, Thing::Directory) && name == "bell.0", "{what}: {error}");
                    }
                    receiver.close();
                }
            }
            match TimeKeeper::begin(&node, TimeSource::Simulation, 7_000_000_000, 1.0) {
                Ok(_keeper) => assert!(SystemClock::open(&node).now().ns >= 7_000_000_000, "{what}"),
                Err(error) => assert!(is_error(&error) && name == "time", "{what}: {error}"),
            }
            assert!(node.remove_if_dead().unwrap() && !ground.path().exists(), "{what}");
        }
    }
}
