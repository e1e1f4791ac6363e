//! Exact replay: the demo's modules repeat what they did on a loaded and disturbed node, and whatever differs is found.

use crate::harness::{Place, RECORDED_CLASSES, Robot, halt, json_lines, signal, times, until};
use crate::load::Load;
use crate::process::{Running, Said};
use crate::recordings::messages_so_far;
use crate::seer::{NOTHING, OTHER_BUILD, OTHER_QUESTIONS, entry};
use nix::sys::signal::Signal;
use rohrpost_modules::journal::Piece;
use serde_json::Value;
use std::io::{Read, Write};
use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Set where the replays of a run are to be more than two: 20 in the long proof.
const REPLAYS: &str = "ROHRPOST_EXACT_REPLAYS";
const LOGD: &str = r#"
[[module]]
name = "logd.0"
builtin = "logd"
stop-within = "60 s"
"#;

const DEMO: &str = r#"
[time]
source = "simulation"
speed = 4.0
[[module]]
name = "motor.0"
aliases = ["odometry.0", "laser.0"]
builtin = "sim"
settings = { map = "building.map", seed = 1 }
stop-within = "60 s"
[module.stream.odometry]
record = "128 B"
keep = 1024
[[module]]
name = "mapper.0"
builtin = "mapper"
calls = ["laser.0", "odometry.0"]
settings = { laser = "laser.0", odometry = "odometry.0" }
stop-within = "60 s"
[[module]]
name = "pilot.0"
builtin = "pilot"
calls = ["laser.0", "motor.0"]
settings = { laser = "laser.0", motor = "motor.0", cruise-m-s = 0.6, seed = 16 }
stop-within = "60 s"
[record]
directory = "recordings"
exact = ["motor.0", "mapper.0", "pilot.0"]
leave-free = "0 B"
flush = "20 ms"
"#;

pub(crate) fn launched(place: &Place, modules: &str) -> (Running, Robot) {
    let config = place.config(&[&RECORDED_CLASSES, LOGD, modules]);
    place.copy("config/building.map");
    place.write("vision.map", "far");
    place.launched_from(&config)
}

/// Seers with these sources, all with journals.
fn seers(place: &Place, sources: &[&str]) -> (Running, Robot) {
    seers_recorded(place, sources, "")
}

/// The same, with this in the section `[record]` too.
pub(crate) fn seers_recorded(place: &Place, sources: &[&str], more: &str) -> (Running, Robot) {
    let entries: String = sources.iter().enumerate().map(|(number, source)| entry(number, source)).collect();
    let names: Vec<String> = (0..sources.len()).map(|number| format!("seer.{number}")).collect();
    let record = format!(
        "[record]\ndirectory = \"recordings\"\nexact = {names:?}\nleave-free = \"0 B\"\nflush = \"20 ms\"\n{more}"
    );
    launched(place, &format!("{entries}{record}"))
}

pub(crate) fn recording(place: &Place, number: u32) -> PathBuf {
    place.path(&format!("recordings/main-{number:04}.mcap"))
}

/// What each run of each module came to.
pub(crate) fn replayed(place: &Place, file: &Path, modules: &[&str]) -> Vec<Value> {
    let said = replay(place, file, modules, &[]);
    json_lines(&said.out)
}

fn replay(place: &Place, file: &Path, modules: &[&str], variables: &[(&str, &str)]) -> Said {
    let words = ["replay", "--exact", "--run-recorded", "--json", file.to_str().unwrap()];
    let mut command = place.command(&[&words, modules].concat());
    command.envs(variables.iter().copied());
    Running::start(command).said()
}

/// Messages of a journal in a file that is being written, if they are so.
pub(crate) fn count(file: &Path, module: &str, is_so: impl Fn(&[u8]) -> bool) -> usize {
    let topic = format!("{module}/journal");
    messages_so_far(file, |channel, message| (channel.topic == topic && is_so(message.data)).then_some(())).len()
}

fn journaled(file: &Path, module: &str) -> usize {
    count(file, module, |_| true)
}

/// Runs of a module of which the beginning is recorded.
fn begun(file: &Path, module: &str) -> usize {
    count(file, module, |value| Piece::read(value).is_some_and(|piece| piece.offset == 0))
}

pub(crate) fn wait_journaled(file: &Path, module: &str, more: usize) {
    let before = journaled(file, module);
    until(format!("{module} goes on"), || journaled(file, module) >= before + more);
}

#[test]
fn simulator_pilot_and_mapper_of_a_loaded_and_disturbed_run_repeat_exactly() {
    let place = Place::new();
    let (mut launch, robot) = launched(&place, DEMO);
    let file = recording(&place, 1);
    ["motor.0", "mapper.0", "pilot.0"].iter().for_each(|module| wait_journaled(&file, module, 5));
    let load = Load::begin();
    place.say(&["param", "set", "pilot.0", "cruise-m-s", "0.4"]).ok();
    place.say(&["param", "set", "pilot.0", "cruise-m-s", "9"]).fails();
    place.say(&["param", "set", "motor.0", "laser-rate-hz", "15"]).ok();
    place.say(&["call", "mapper.0", "counts"]).ok();
    place.say(&["call", "mapper.0", "publish_all"]).ok();
    for module in ["mapper.0", "pilot.0"] {
        place.say(&["call", module, "off"]).ok();
        place.say(&["call", module, "on"]).ok();
    }
    // The pilot hears nothing for a while, and its commands are late.
    let motor = robot.pid("motor.0");
    halt(motor);
    std::thread::sleep(Duration::from_millis(300));
    signal(motor, Signal::SIGCONT);
    let pilot = robot.pid("pilot.0");
    signal(pilot, Signal::SIGKILL);
    robot.wait_restarted("pilot.0", pilot);
    ["motor.0", "mapper.0", "pilot.0"].iter().for_each(|module| wait_journaled(&file, module, 20));
    drop(load);
    launch.stop();

    // The book shows a command of the pilot as it is told.
    let listed = place.say(&["replay", "--exact", "--list", file.to_str().unwrap(), "pilot.0"]).ok();
    for line in include_str!("../../docs/src/exact.md").lines().filter(|line| line.contains("it sends a command: ")) {
        let (front, behind) = line.split_once(" bytes ").unwrap();
        let (front, behind) = (front.split_once("it sends").unwrap().1, behind.rsplit_once(" to ").unwrap().1);
        let is_it = |told: &&str| told.contains(front) && told.ends_with(&format!(" to {behind}"));
        assert!(listed.lines().any(|told| is_it(&told)), "{line}");
    }

    for _ in 0..times(REPLAYS, 2) {
        let runs = replayed(&place, &file, &[]);
        let mut modules: Vec<&str> = runs.iter().map(|run| run["module"].as_str().unwrap()).collect();
        modules.sort_unstable();
        assert_eq!(modules, ["mapper.0", "motor.0", "pilot.0", "pilot.0"], "{runs:#?}");
        for run in &runs {
            assert_eq!(run["result"], "identical", "{runs:#?}");
            assert!(run["events"].as_u64() > Some(10) && run["outputs"].as_u64() > Some(5), "{run:#}");
        }
    }
    let text = place.say(&["replay", "--exact", "--run-recorded", file.to_str().unwrap(), "mapper.0"]).ok();
    assert!(text.starts_with("mapper.0: identical: "), "{text}");
    let listed = place.say(&["replay", "--exact", file.to_str().unwrap(), "mapper.0", "--list"]).ok();
    let events = text.split_whitespace().nth(2).unwrap();
    let last = listed.lines().rfind(|line| !line.starts_with(' ')).unwrap();
    assert!(last.starts_with(&format!("{events} at ")) && listed.contains("it publishes data: "), "{text}\n{last}");
}

#[test]
fn rules_that_are_kept_repeat_and_those_that_are_broken_are_found_or_refused() {
    let place = Place::new();
    let sources = ["clock", "hash-order", "taken-in", "map", "descriptor", "thread", "link"];
    let (mut launch, _robot) = seers(&place, &sources);
    let file = recording(&place, 1);
    ["seer.0", "seer.1", "seer.2", "seer.3"].iter().for_each(|module| wait_journaled(&file, module, 5));
    launch.stop();

    let runs = replayed(&place, &file, &[]);
    let of = |number: usize| runs.iter().find(|run| run["module"] == format!("seer.{number}")).unwrap();
    for number in [0, 2, 3] {
        let run = of(number);
        assert_eq!(run["result"], "identical", "{run:#}");
        assert!(run["outputs"].as_u64() > Some(5), "{run:#}");
    }
    // Made, switched on, and the first tick.
    let (hashed, why) = (of(1), &of(1)["why"]);
    assert_eq!((&hashed["result"], &hashed["events"], &why["event"]), (&"differs".into(), &3.into(), &"ticks".into()));
    for side in ["recorded", "replayed"] {
        let text = why[side].as_str().unwrap();
        assert!(text.starts_with("it publishes data: vision of "), "{text}");
    }
    for (number, events, words) in [(4, 1, "Context::watch"), (5, 1, "in another thread"), (6, 3, "Context::link")] {
        let run = of(number);
        assert_eq!((&run["result"], &run["events"]), (&"refused".into(), &events.into()), "{run:#}");
        assert!(run["why"].as_str().unwrap().contains(words), "{run:#}");
    }
    place.write("vision.map", "near");
    let run = &replayed(&place, &file, &["seer.3"])[0];
    assert_eq!(run["result"], "refused");
    assert!(run["why"].as_str().unwrap().contains("vision.map is not the file that it was"), "{run:#}");
    let other = place.path("other");
    std::fs::create_dir(&other).unwrap();
    std::fs::write(other.join("vision.map"), "far").unwrap();
    let command = ["replay", "--exact", "--run-recorded", file.to_str().unwrap(), "seer.3", "--folder"];
    let text = place.say(&[&command[..], &[other.to_str().unwrap()]].concat()).ok();
    assert!(text.starts_with("seer.3: identical: "), "{text}");
}

#[test]
fn a_descriptor_is_repeated_without_it_and_what_is_read_past_the_journal_is_found() {
    let place = Place::new();
    let listener = UnixListener::bind(place.path("port")).unwrap();
    let (mut launch, _robot) = seers(&place, &["port", "beside"]);
    let file = recording(&place, 1);
    let mut ports = [0, 1].map(|_| listener.accept().unwrap().0);
    for round in 0..20 {
        for port in &mut ports {
            let (sent, mut back) = ([round, 7], [0; 2]);
            port.write_all(&sent).unwrap();
            port.read_exact(&mut back).unwrap();
            assert_eq!(back, sent);
        }
    }
    ["seer.0", "seer.1"].iter().for_each(|module| wait_journaled(&file, module, 5));
    launch.stop();
    drop((listener, ports));
    std::fs::remove_file(place.path("port")).unwrap();

    let run = &replayed(&place, &file, &["seer.0"])[0];
    assert_eq!((&run["result"], &run["is_whole"]), (&"identical".into(), &true.into()), "{run:#}");
    assert!(run["outputs"].as_u64() >= Some(40), "{run:#}");
    let run = &replayed(&place, &file, &["seer.1"])[0];
    let why = &run["why"];
    assert_eq!((&run["result"], &why["event"]), (&"differs".into(), &"finds descriptor 0 ready".into()), "{run:#}");
    // For the stamp of what it publishes.
    assert_eq!(why["recorded"], "it reads the clock", "{run:#}");
    assert!(why["replayed"].as_str().unwrap().starts_with("it fails: \"Bad file descriptor"), "{run:#}");
    let listed = place.say(&["replay", "--exact", file.to_str().unwrap(), "seer.0", "--list"]).ok();
    let told = ["it takes something in (`take_in`): at most 16 bytes", "it gives bytes out (`give_out`): 2 bytes 0007"];
    assert!(told.iter().all(|line| listed.contains(line)), "{listed}");
}

#[test]
fn another_build_is_told_by_the_first_thing_that_it_does_otherwise() {
    let place = Place::new();
    let (mut launch, robot) = seers(&place, &["clock", "clock", "clock"]);
    let file = recording(&place, 1);
    wait_journaled(&file, "seer.0", 2);
    assert_eq!(place.say(&["call", "seer.0", "add", "7"]).ok().trim(), "7");
    wait_journaled(&file, "seer.0", 2);
    place.say(&["call", "seer.1", "fail"]).ok();
    until("it failed", || robot.state("seer.1") == "error");
    let panicking = robot.pid("seer.2");
    place.say(&["call", "seer.2", "panic"]);
    robot.wait_restarted("seer.2", panicking);
    wait_journaled(&file, "seer.2", 2);
    // Not a success, since one is in error.
    launch.signal(Signal::SIGINT);
    launch.end();

    for run in replayed(&place, &file, &[]) {
        assert_eq!((&run["result"], &run["is_whole"]), (&"identical".into(), &true.into()), "{run:#}");
    }
    let said = replay(&place, &file, &["seer.0"], &[(OTHER_BUILD, "1")]);
    assert_eq!(said.code, Some(1));
    let run: Value = serde_json::from_str(&said.out).unwrap();
    assert_eq!((&run["result"], &run["events"], &run["outputs"]), (&"differs".into(), &3.into(), &0.into()), "{run:#}");
    let said = replay(&place, &file, &["seer.0"], &[(OTHER_QUESTIONS, "tick")]);
    let run: Value = serde_json::from_str(&said.out).unwrap();
    assert_eq!(
        (&run["result"], &run["events"], &run["why"]["event"]),
        (&"differs".into(), &1.into(), &"is made".into())
    );
    let [recorded, replayed] = ["recorded", "replayed"].map(|side| run["why"][side].as_str().unwrap());
    assert_eq!(recorded, "it wants to tick: once in 5000000 ns");
    assert_eq!(replayed, "it wants to tick: once in 6000000 ns");
}

#[test]
fn a_build_that_asks_for_another_mailbox_or_for_other_records_is_told_with_both_questions() {
    let place = Place::new();
    let (mut launch, _robot) = seers(&place, &["asking"]);
    let file = recording(&place, 1);
    wait_journaled(&file, "seer.0", 2);
    launch.stop();

    let run = &replayed(&place, &file, &[])[0];
    assert_eq!((&run["result"], &run["is_whole"]), (&"identical".into(), &true.into()), "{run:#}");
    for (otherwise, question, recorded, replayed) in [
        (
            "mailbox",
            "it makes a mailbox: mailbox 3, ",
            "4 slots of 100 bytes, for data",
            "5 slots of 100 bytes, for data",
        ),
        ("rewind", "it goes back in a followed stream: followed stream ", "0", "1"),
        ("rewind-to", "it goes back in a followed stream: followed stream 1, to sequence ", "7", "8"),
    ] {
        let said = replay(&place, &file, &["seer.0"], &[(OTHER_QUESTIONS, otherwise)]);
        let run: Value = serde_json::from_str(&said.out).unwrap();
        assert_eq!((&run["result"], &run["why"]["event"]), (&"differs".into(), &"is made".into()), "{run:#}");
        let told = ["recorded", "replayed"].map(|side| run["why"][side].as_str().unwrap());
        assert_eq!(told, [recorded, replayed].map(|its| format!("{question}{its}")));
    }
}

#[test]
fn a_module_that_fails_or_panics_while_it_is_made_is_told_with_its_reason() {
    let place = Place::new();
    let (mut launch, robot) = seers(&place, &["map", "map"]);
    let file = recording(&place, 1);
    let modules = ["seer.0", "seer.1"];
    modules.iter().for_each(|module| wait_journaled(&file, module, 2));
    place.write("vision.map", NOTHING);
    modules.iter().for_each(|module| signal(robot.pid(module), Signal::SIGKILL));
    modules.iter().for_each(|module| until("it began again", || begun(&file, module) > 1));
    launch.signal(Signal::SIGINT);
    launch.end();

    for (module, reason) in [("seer.0", "it fails: \"it sees nothing in its map\""), ("seer.1", "it panics: ")] {
        let runs = replayed(&place, &file, &[module]);
        assert!(runs[0]["why"].as_str().unwrap().contains("vision.map is not the file that it was"), "{runs:#?}");
        assert!(runs.len() > 1, "{runs:#?}");
        for run in &runs[1..] {
            assert_eq!((&run["result"], &run["is_whole"]), (&"identical".into(), &true.into()), "{run:#}");
            assert!(run["why"].as_str().unwrap().starts_with(reason), "{run:#}");
        }
    }
}

#[test]
fn a_journal_that_began_before_its_recording_is_refused_until_the_files_are_merged() {
    let place = Place::new();
    let (mut launch, _robot) = seers(&place, &["clock"]);
    let [first, second] = [1, 2].map(|number| recording(&place, number));
    wait_journaled(&first, "seer.0", 3);
    place.say(&["call", "logd.0", "off"]).ok();
    place.say(&["call", "logd.0", "on"]).ok();
    wait_journaled(&second, "seer.0", 3);
    launch.stop();

    let run = &replayed(&place, &first, &[])[0];
    assert_eq!((&run["result"], &run["is_whole"]), (&"identical".into(), &false.into()), "{run:#}");
    let run = &replayed(&place, &second, &[])[0];
    assert_eq!((&run["result"], &run["events"]), (&"refused".into(), &0.into()), "{run:#}");
    assert!(run["why"].as_str().unwrap().contains("before the recording did"), "{run:#}");
    let all = place.path("all.mcap");
    let [one, other, to] = [&first, &second, &all].map(|path| path.to_str().unwrap());
    place.say(&["record", "merge", one, other, "-o", to]).ok();
    let run = &replayed(&place, &all, &[])[0];
    assert_eq!((&run["result"], &run["is_whole"]), (&"identical".into(), &true.into()), "{run:#}");
    let said = place.say(&["replay", "--exact", all.to_str().unwrap(), "seer.7"]);
    said.fails_with(["no journal of seer.7; name the module in [record]"]);
}
