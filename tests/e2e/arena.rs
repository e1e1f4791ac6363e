//! The arena as its user meets it: mistakes that it tells, sockets that others left, bodies and bytes that come and go.

use crate::harness::{Place, repository, until, wait};
use crate::process::Running;
use nix::sys::signal::Signal;
use std::os::unix::net::UnixDatagram;
use std::path::PathBuf;

/// The supervised robot in an arena.
fn configured(place: &Place) -> PathBuf {
    place.copy("config/building.map");
    let text = std::fs::read_to_string(repository("config/demo-supervised.toml")).unwrap();
    let text = text.replace("map = \"building.map\"", "map = \"building.map\", arena = \"arena.sock\"");
    place.write("robot.toml", text)
}

fn opened(place: &Place) -> Running {
    let mut arena = place.start(&["arena", "robot.toml"]);
    arena.wait_for("the arena is open");
    arena
}

#[test]
fn what_keeps_an_arena_from_opening_is_told_with_its_remedy() {
    let place = Place::new();
    configured(&place);
    let text = std::fs::read_to_string(place.path("robot.toml")).unwrap();
    place.write("bare.toml", text.replace(", arena = \"arena.sock\"", ""));
    place.say(&["arena", "bare.toml"]).fails_with(["bare.toml: no module", "write `arena = \"arena.sock\"`"]);
    place.write("far.toml", text.replace("arena.sock", "nowhere/arena.sock"));
    place.say(&["arena", "far.toml"]).fails_with(["nowhere/arena.sock: cannot make this socket: No such file"]);
    place.write("torn.toml", text.replace("map = \"building.map\"", "map = \"robot.toml\""));
    place.say(&["arena", "torn.toml"]).fails_with(["robot.toml: "]);
    place.write("touches.jsonl", "");
    place.say(&["arena", "robot.toml", "--touches", "touches.jsonl"]).fails_with(["touches.jsonl: File exists"]);
    let mut arena = opened(&place);
    place.say(&["arena", "robot.toml"]).fails_with(["arena.sock: an arena runs there; end it first"]);
    // A killed one leaves its socket, which is in nobody's way.
    arena.kill();
    assert!(place.path("arena.sock").exists());
    let mut arena = opened(&place);
    arena.stop();
    assert!(!place.path("arena.sock").exists(), "it removes its own");
    place.say(&["arena", "robot.toml", "--seconds", "0"]).ok_with(["0 touches count against the robot, of 0 in all"]);
}

/// Neither a body that comes before the arena, nor bytes of strangers, nor an arena that dies is the end of the robot.
#[test]
fn body_and_arena_come_and_go_and_strangers_move_nothing() {
    let place = Place::new();
    let config = configured(&place);
    let (mut launch, robot) = place.launched_from(&config);
    let silent = "arena.sock is silent: start the arena (`rohrpost arena FILE`)";
    until("list says what to do", || place.say(&["list"]).out.contains(silent));
    let is_driven = || place.say(&["call", "wormhole.0", "state"]).out.contains("Active").then_some(());
    let mut arena = opened(&place);
    wait("the program drives", is_driven);
    let stranger = UnixDatagram::unbound().unwrap();
    for bytes in [&b""[..], b"x", &[0xff; 32], &[0xff; 4096]] {
        stranger.send_to(bytes, place.path("arena.sock")).unwrap();
    }
    arena.kill();
    until("list says it again", || place.say(&["list"]).out.contains(silent));
    let mut next = opened(&place);
    wait("the program drives again", is_driven);
    robot.kill("motor.1");
    wait("with another body, too", is_driven);
    launch.stop();
    next.assert_runs();
    next.signal(Signal::SIGTERM);
    assert!(next.end().success() && next.out().contains("0 touches count against the robot"), "{}", next.out());
    place.assert_empty();
}
