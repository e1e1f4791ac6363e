//! `rohrpost mailbox`: a mailbox with a stopped receiver, seen from outside.

use crate::harness::{OUTPUT, PATIENCE, Place, Robot, assert_has, halt, probe, until};
use crate::process::Running;
use crate::versions::write_version;
use nix::sys::signal::Signal;
use rohrpost::Name;
use rohrpost_mailbox::{LAYOUT_VERSION, Label, Node, Participant, Priority, SendError, Type};
use serde_json::Value;
use std::path::PathBuf;
use std::process::{Command, Stdio};

/// As the harness' configuration has them.
const TOOL: Priority = Priority(16);
const PROBE: Priority = Priority(96);

/// Not a test: a process that begins to write a package and never ends. Run as a test it ends at once.
#[test]
fn filler() {
    let Some(path) = std::env::var_os("ROHRPOST_TEST_FILLS") else { return };
    let node = Node::open(path.as_ref()).unwrap();
    let participant = Participant::join(&node, Name::new(1, PROBE.0, 7, 0)).unwrap();
    let mut sender = participant.sender(Name::new(1, PROBE.0, 0, 0)).unwrap();
    let _loan = sender.loan(PROBE).unwrap();
    println!("@lent");
    std::thread::sleep(PATIENCE);
}

fn fill(robot: &Robot) -> Running {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", "mailbox::filler", "--nocapture"]).env("ROHRPOST_TEST_FILLS", robot.node.path());
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut filler = Running::start(command);
    filler.wait_for("@lent");
    filler
}

fn file_of(robot: &Robot, name: &str) -> PathBuf {
    robot.node.path().join(format!("{:08x}.mbx", robot.name(name).raw()))
}

#[test]
fn a_full_mailbox_of_a_stopped_receiver_shows_its_senders_and_losses() {
    let keys = "stop-within = \"200 ms\"\n[module.mailbox.commands]\nslots = 4\nmax-age = \"90 s\"";
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", keys)]);
    let looked = place.say(&["mailbox", "probe.0", "--json"]).json();
    assert_eq!((&looked["waiting"], &looked["receiver"]["stopped"]), (&0.into(), &false.into()));
    let pid = robot.pid("probe.0");
    halt(pid);
    let me = Participant::join(&robot.node, Name::NONE).unwrap();
    let mut sender = me.sender(robot.name("probe.0")).unwrap();
    let label = Label { priority: TOOL, kind: Type::command(16), ..Label::default() };
    (0..4).for_each(|_| sender.send(&label, &[b"nonsense"]).unwrap());
    assert!(matches!(sender.send(&label, &[]), Err(SendError::Full(_))));
    // Both before one dies: else the other takes its place in the node's table, and its number is lost.
    let (mut dead, alive) = (fill(&robot), fill(&robot));
    let dead_pid = dead.pid();
    dead.kill();

    let looked = place.say(&["mailbox", "probe.0", "--json"]).json();
    for (key, value) in [
        ("mailbox", Value::from("1.probe.0.0")),
        ("module", "probe.0".into()),
        ("purpose", "commands".into()),
        ("slots", 4.into()),
        ("full", "displace".into()),
        ("max_age_s", 90.0.into()),
        ("retired", false.into()),
        ("waiting", 2.into()),
        ("adoptions", 0.into()),
    ] {
        assert_eq!(looked[key], value, "{key}: {looked:#}");
    }
    let receiver = &looked["receiver"];
    assert_eq!((&receiver["pid"], &receiver["module"]), (&pid.into(), &"probe.0".into()));
    assert_eq!((&receiver["alive"], &receiver["stopped"]), (&true.into(), &true.into()));
    // A package being written has displaced another, which is only counted when the write is done or given up.
    let tool = looked["classes"].as_array().unwrap().iter().find(|class| class["class"] == "tool").unwrap();
    assert_eq!((&tool["priority"], &tool["lost_by_cause"]["refused"]), (&16.into(), &1.into()));
    let slots = looked["slot_states"].as_array().unwrap();
    let of = |state: &str| slots.iter().filter(|slot| slot["state"] == state).collect::<Vec<_>>();
    assert_eq!((slots.len(), of("ready").len(), of("filling").len()), (4, 2, 2), "{looked:#}");
    for ready in of("ready") {
        assert_eq!((&ready["class"], &ready["redelivered"]), (&"tool".into(), &false.into()));
    }
    for (filler, lives) in [(dead_pid, false), (alive.pid(), true)] {
        let slot = slots.iter().find(|slot| slot["by"]["pid"] == filler).unwrap();
        assert_eq!((&slot["by"]["alive"], &slot["by"]["module"]), (&lives.into(), &"probe.7".into()));
        assert_eq!((&slot["victim"]["class"], &slot["victim"]["replaced"]), (&"tool".into(), &false.into()));
    }

    let text = place.say(&["mailbox", "probe.0"]).ok();
    assert_has(
        &text,
        [
            "mailbox 1.probe.0.0: commands of probe.0, node main\n",
            &format!("probe.0, process {pid}, which is stopped\n"),
            "4 x 1024 B",
            "displace: a more important package replaces",
            "what has waited 90.0 s\n",
            "1 refused",
            "ready    tool (16)",
            &format!("by probe.7, process {dead_pid}, which is dead; displaced a package of tool (16)\n"),
            &format!("by probe.7, process {}; displaced a package of tool (16)\n", alive.pid()),
        ],
    );
    launch.stop();
}

#[test]
fn waits_are_drawn_and_a_dead_receiver_is_named() {
    let restart = "restart = { policy = \"always\", backoff = \"60 s\" }";
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", restart)]);
    (1..=3).for_each(|count: u32| drop(place.say(&["call", "probe.0", "count", &count.to_string()]).ok()));
    let looked = place.say(&["mailbox", "probe.0", "--json"]).json();
    let tool = looked["classes"].as_array().unwrap().iter().find(|class| class["class"] == "tool").unwrap();
    let bars = tool["waited"].as_array().unwrap();
    let packages: u64 = bars.iter().map(|bar| bar["packages"].as_u64().unwrap()).sum();
    assert_eq!(Some(packages), tool["received"].as_u64(), "{tool:#}");
    assert!(packages >= 3 && bars.windows(2).all(|pair| pair[0]["to_s"] == pair[1]["from_s"]), "{tool:#}");
    place.say(&["mailbox", "probe.0"]).ok_with(["tool waited\n", "████\n", "0-31  free\n"]);

    let pid = robot.pid("probe.0");
    crate::harness::signal(pid, Signal::SIGKILL);
    let line = format!("nobody; the last was probe.0, process {pid}, which is dead\n");
    until("the tool sees its death", || place.say(&["mailbox", "probe.0"]).ok().contains(&line));
    launch.stop();
}

#[test]
fn mailboxes_that_are_not_there_or_not_ours_are_told_with_what_would_be_right() {
    let (place, mut launch, robot) = Place::running(&[OUTPUT, &probe("probe.0", "", "")]);
    for (name, words) in [
        ("probe.0.77", "probe.0 has no mailbox `probe.0.77`; it has probe.0, probe.0.1, probe.0.2"),
        (
            "probe.5",
            "node main has no mailbox `probe.5`; did you mean `probe.0`? `rohrpost list --mailboxes` lists all",
        ),
        ("porbe.0", "there is no class `porbe`; did you mean `probe`?"),
        ("prob", "`prob` is no mailbox name; write class.instance"),
    ] {
        place.say(&["mailbox", name]).fails_with([words]);
    }
    let file = file_of(&robot, "probe.0");
    write_version(&file, 99);
    let said = place.say(&["mailbox", "probe.0"]);
    said.fails_with([&format!("another version (layout 99, this program {LAYOUT_VERSION})")]);
    write_version(&file, LAYOUT_VERSION);
    // Beside the mailbox, as a foreign file.
    std::fs::write(robot.node.path().join("01600900.mbx"), b"a letter").unwrap();
    place.say(&["mailbox", "probe.9"]).fails_with(["mailbox probe.9: its file is no mailbox, or damaged"]);
    assert!(place.say(&["list", "-m"]).ok().contains("1.probe.0.0"), "the others are listed all the same");
    launch.stop();
}
