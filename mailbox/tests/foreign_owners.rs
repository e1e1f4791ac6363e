//! What other users have put where a node's directory or its files are. Root alone can be somebody else.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod common;

use common::{Ground, MAILBOX, shape, tell};
use rohrpost_mailbox::{Name, Node, NodeError, Participant, SendError, SystemClock, TimeKeeper, TimeSource};
use std::fs;
use std::os::unix::fs::{MetadataExt, chown, symlink};
use std::path::Path;

/// Another user.
const THEM: u32 = 12_345;

#[test]
fn role() {
    let Some((_, ground)) = common::role() else { return };
    tell(Node::open(ground.path()).map_or_else(|error| error.to_string(), |_| "opened".into()));
}

fn give(path: &Path, owner: u32) {
    chown(path, Some(owner), None).unwrap();
}

/// Says so if this user cannot be another one, too.
fn is_root() -> bool {
    let is_root = nix::unistd::geteuid().is_root();
    if !is_root {
        rohrpost_test_report::skipped("root alone can be somebody else; the other tests ran without its rights");
    }
    is_root
}

#[test]
fn a_directory_of_another_user_is_left_alone() {
    if !is_root() {
        return;
    }
    let ground = Ground::new();
    let (directory, around) = (ground.path().to_owned(), ground.path().parent().unwrap().to_owned());
    drop(ground.node());
    for foreign in [&directory, &around] {
        give(foreign, THEM);
        for error in [Node::open(&directory).err(), Node::create(&directory, 0o777).err()] {
            let error = error.unwrap_or_else(|| panic!("{} is used", foreign.display()));
            assert!(matches!(&error, NodeError::Foreign(path, THEM) if path == foreign), "{error}");
        }
        assert_eq!(fs::metadata(&directory).unwrap().mode() & 0o777, 0o700, "nothing is changed");
        give(foreign, 0);
    }
    Node::open(&directory).unwrap();
    let link = around.join("link");
    symlink(&directory, &link).unwrap();
    assert!(Node::open(&link).is_err(), "never through a link");
}

#[test]
fn a_node_of_another_user_is_used_where_the_environment_names_its_folder() {
    if !is_root() {
        return;
    }
    let ground = Ground::new();
    let around = ground.path().parent().unwrap();
    drop(ground.node());
    [ground.path(), around, &ground.path().join("node")].iter().for_each(|path| give(path, THEM));
    for (named, opened) in [(None, false), (Some(around), true), (around.parent(), false)] {
        let process = ground.start_with("open", |command| {
            command.env_remove("ROHRPOST_DIR").envs(named.map(|named| ("ROHRPOST_DIR", named)));
        });
        let said = process.hear();
        assert_eq!(said == "opened", opened, "{named:?}: {said}");
        assert!(opened || said.contains("belongs to user 12345, not to us"), "{said}");
        process.finish();
    }
}

#[test]
fn a_file_of_another_user_is_used_only_if_the_mode_lets_others_write() {
    if !is_root() {
        return;
    }
    for (mode, is_used) in [(0o700, false), (0o750, false), (0o770, true)] {
        let ground = Ground::new();
        let node = Node::create(ground.path(), mode).unwrap();
        let me = Participant::join(&node, Name::NONE).unwrap();
        drop(me.receiver(MAILBOX, shape(4)).unwrap());
        drop(TimeKeeper::begin(&node, TimeSource::Simulation, 7, 1.0).unwrap());
        node.put_file("config", b"words").unwrap();
        for file in ["time", "config", &format!("{:08x}.mbx", MAILBOX.raw())] {
            give(&ground.path().join(file), THEM);
        }
        assert_eq!(SystemClock::open(&node).record().is_some(), is_used, "{mode:o}");
        assert_eq!(node.look_at(MAILBOX).is_some(), is_used, "{mode:o}");
        match me.sender(MAILBOX) {
            Err(SendError::Bad(_, why)) => assert!(!is_used && why.contains("belongs to user 12345"), "{why}"),
            other => assert!(is_used && other.is_ok(), "{mode:o}"),
        }
        match node.read_file("config") {
            Err(NodeError::Foreign(path, THEM)) => assert!(!is_used && path.ends_with("config"), "{mode:o}"),
            read => assert!(is_used && read.unwrap().unwrap() == b"words", "{mode:o}"),
        }
        assert_eq!(me.receiver(MAILBOX, shape(4)).is_ok(), is_used, "{mode:o}");
        give(&ground.path().join("node"), THEM);
        assert_eq!(Node::open(ground.path()).is_ok(), is_used, "{mode:o}");
    }
}
