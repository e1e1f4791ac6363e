//! What another user left where this user's nodes are: no tool uses it, and none waits for it.

use crate::harness::{OUTPUT, Place};
use rohrpost_testbed::report::skipped;
use std::fs;
use std::os::unix::fs::{PermissionsExt, chown};

#[test]
fn a_node_of_another_user_is_told_and_not_obeyed() {
    if !nix::unistd::geteuid().is_root() {
        return skipped("root alone can be somebody else; the other tests ran without its rights");
    }
    let (place, mut launch, robot) = Place::running(&[OUTPUT]);
    // As in /dev/shm, where any user may have made it.
    fs::set_permissions(place.memory(), fs::Permissions::from_mode(0o1777)).unwrap();
    chown(robot.node.path(), Some(12_345), None).unwrap();
    let said = format!("node directory {} belongs to user 12345, not to us", robot.node.path().display());
    for arguments in [&["list"][..], &["stop", "output.0"]] {
        place.say(arguments).fails_with([&said]);
    }
    for arguments in ["doctor", "clean"] {
        let told = place.say(&[arguments]).out;
        assert!(told.contains(&said), "{arguments}: {told}");
    }
    chown(robot.node.path(), Some(0), None).unwrap();
    place.say(&["list"]).ok();
    place.end(&mut launch);
}

#[test]
fn a_pipe_among_the_files_of_a_node_keeps_no_tool_waiting() {
    let (place, mut launch, robot) = Place::running(&[OUTPUT]);
    let config = robot.node.path().join(rohrpost_modules::runtime::CONFIG_FILE);
    let put_pipe = |name: &str| {
        let path = robot.node.path().join(name);
        fs::remove_file(&path).unwrap();
        nix::unistd::mkfifo(&path, nix::sys::stat::Mode::S_IRWXU).unwrap();
    };
    put_pipe("children");
    place.say(&["list"]).ok();
    let noted = fs::read(&config).unwrap();
    put_pipe(rohrpost_modules::runtime::CONFIG_FILE);
    place.say(&["list"]).fails_with(["it is a named pipe, not a file"]);
    fs::remove_file(&config).unwrap();
    fs::write(&config, noted).unwrap();
    place.end(&mut launch);
}
