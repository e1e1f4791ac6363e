//! A log as the time of a node: ticks come at the log's pace, none before it begins nor while it stands still, and from
//! its beginning again when it is played anew. What modules do before it begins is in their journals.

use crate::exact::count;
use crate::harness::{PATIENCE, Place, Robot, head, probe, until, wait};
use crate::probe::ProbingInterface;
use crate::process::Running;
use crate::recorded::{RECORD, launched};
use rohrpost::ToolLink;
use rohrpost::interfaces::{RecorderInterface, RecordingState};
use rohrpost_mailbox::{StreamId, SystemClock, TimeSource, monotonic_ns};
use rohrpost_modules::journal::JOURNAL_NUMBER;
use std::path::PathBuf;

/// When the log begins, s after 1970.
const BEGIN_S: u64 = 1_000_000_000;
/// Of the probe's ticks, in the node's time.
const PERIOD_NS: u64 = 250_000_000;

const CLASSES: &str = "player 170, odometry 160, laser 150, probe 96, mapper 95, logd 24, tool 16";
const TIME: &str = r#"
[nodes.main]
[time]
source = "log"
"#;

/// Writes the log that the player plays when it is started: one that lasts longer than any test.
fn write_log(place: &Place, begin_s: u64) {
    let line = |s: u64| format!("ODOM 0 0 0 0 0 0 {s}.0 host 0\n");
    place.write("next.log", (begin_s..begin_s + 50_000).map(line).collect::<String>());
    // A player that runs goes on with the one that it has.
    std::fs::rename(place.path("next.log"), place.path("long.log")).unwrap();
}

/// A robot with a probe and a player of a log.
fn robot(place: &Place, speed: f64, player_keys: &str) -> (Running, Robot, PathBuf) {
    write_log(place, BEGIN_S);
    let player = format!(
        "[[module]]\nname = \"player.0\"\naliases = [\"odometry.0\", \"laser.0\"]\nbuiltin = \"carmen\"\n\
         settings = {{ file = \"long.log\", speed = {speed:?} }}\n{player_keys}\n"
    );
    let config =
        place.write("test.toml", [&head(CLASSES), TIME, &probe("probe.0", "rate-hz = 4.0", ""), &player].concat());
    let (launch, robot) = place.launched_from(&config);
    (launch, robot, config)
}

/// A tick of the probe: which one, and when.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Beat {
    number: u64,
    stamp_ns: u64,
}

/// The probe's last tick, if there was one.
fn beat(robot: &Robot, tool: &mut ToolLink) -> Option<Beat> {
    let newest = robot.newest(tool, "probe.0", ProbingInterface::BEAT);
    newest.ok().map(|(stamp_ns, number)| Beat { number, stamp_ns })
}

/// The same, when the probe has done all that was due before.
fn settled(robot: &Robot, tool: &mut ToolLink) -> Option<Beat> {
    for _ in 0..2 {
        tool.status(robot.name("probe.0")).unwrap();
    }
    beat(robot, tool)
}

#[test]
fn ticks_come_at_the_pace_of_the_log() {
    for (speed, periods) in [(1.0, 8), (10.0, 80)] {
        let place = Place::new();
        let (mut launch, robot, _) = robot(&place, speed, "");
        let mut tool = robot.tool(PATIENCE);
        let record = SystemClock::open(&robot.node).record().unwrap();
        assert_eq!((record.source, record.pace_ppb), (TimeSource::Log, (speed * 1e9) as u64));
        let first = wait("a first tick", || beat(&robot, &mut tool));
        assert!(first.stamp_ns >= BEGIN_S * 1_000_000_000, "{first:?}");
        let last = wait("ticks", || {
            beat(&robot, &mut tool).filter(|last| last.stamp_ns >= first.stamp_ns + periods * PERIOD_NS)
        });
        let (ticks, passed) = (last.number - first.number, (last.stamp_ns - first.stamp_ns).div_ceil(PERIOD_NS));
        // A busy computer leaves some out. By the computer's clock there would be a tenth at ten times the pace.
        assert!((passed / 5..=passed).contains(&ticks), "{ticks} ticks in {passed} periods at {speed}");
        tool.close();
        place.end(&mut launch);
    }
}

#[test]
fn there_is_no_tick_while_the_log_stands_still_and_they_go_on_after_a_step_back() {
    let place = Place::new();
    let (mut launch, robot, _) = robot(&place, 10.0, "restart = \"always\"");
    let (mut tool, clock) = (robot.tool(PATIENCE), SystemClock::open(&robot.node));
    wait("a first tick", || beat(&robot, &mut tool));
    place.say(&["call", "player.0", "off"]).ok();
    assert_eq!(clock.record().unwrap().pace_ppb, 0);
    let (before, at_ns) = (settled(&robot, &mut tool).unwrap(), clock.now().ns);
    // Time for 20 ticks, if it passed.
    let since_ns = monotonic_ns();
    until("half a second of the computer", || monotonic_ns() - since_ns > 2 * PERIOD_NS);
    assert_eq!((settled(&robot, &mut tool), clock.now().ns), (Some(before), at_ns));
    place.say(&["call", "player.0", "on"]).ok();
    let after = wait("ticks go on", || beat(&robot, &mut tool).filter(|beat| beat.number >= before.number + 3));
    assert!(after.stamp_ns >= at_ns);
    let epoch = clock.record().unwrap().epoch;
    // So far back that it does not come to the present before it is looked at.
    write_log(&place, BEGIN_S - 50_000);
    let pid = robot.pid("player.0");
    place.say(&["restart", "player.0"]).ok();
    robot.wait_restarted("player.0", pid);
    let again = wait("ticks from the beginning", || {
        beat(&robot, &mut tool).filter(|beat| beat.stamp_ns < after.stamp_ns && beat.number > after.number + 1)
    });
    assert_eq!(clock.record().unwrap().epoch, epoch + 1, "{again:?}");
    tool.close();
    place.end(&mut launch);
}

#[test]
fn before_the_log_begins_there_is_no_time_and_tools_say_so() {
    let place = Place::new();
    let (mut launch, robot, _) = robot(&place, 2.0, "start = \"off\"");
    let mut tool = robot.tool(PATIENCE);
    assert_eq!(settled(&robot, &mut tool), None);
    let record = SystemClock::open(&robot.node).record().unwrap();
    assert_eq!((record.source, record.pace_ppb, record.is_known()), (TimeSource::Log, 0, false));
    let top = || place.say(&["top", "--once"]).ok();
    assert!(top().contains("no time yet   log\n"), "{}", top());
    let json = place.say(&["top", "--json", "--interval", "0.1"]).json();
    assert_eq!(json["time_known"], false, "{json}");
    let told = place.say(&["time"]);
    assert!(told.code == Some(1) && told.out.contains("main: it has no time yet: that of the log"), "{told:?}");
    place.say(&["ping", "probe.0", "--count", "1"]).ok_with(["the time of this node stands still"]);
    place.say(&["call", "player.0", "on"]).ok();
    wait("a first tick", || beat(&robot, &mut tool));
    assert!(top().contains("log x 2\n"), "{}", top());
    tool.close();
    place.end(&mut launch);
}

#[test]
fn what_a_module_does_before_the_log_begins_is_recorded_and_repeated() {
    let place = Place::new();
    let more = "restart = \"always\"\n[[module]]\nname = \"mapper.0\"\nbuiltin = \"mapper\"\n\
                calls = [\"laser.0\", \"odometry.0\"]\nsettings = { laser = \"laser.0\", odometry = \"odometry.0\" }\n\
                [[module]]\nname = \"logd.0\"\nbuiltin = \"logd\"\nstop-within = \"60 s\"\n\
                [record]\ndirectory = \"recordings\"\nexact = [\"mapper.0\"]\nleave-free = \"0 B\"\n\
                flush = \"20 ms\"\n";
    let (mut launch, robot, _) = robot(&place, 10.0, &format!("start = \"off\"\n{more}"));
    // The recorder has found the mapper's journal long before the log begins.
    let mut tool = robot.tool(PATIENCE);
    let journal = StreamId { name: robot.name("mapper.0"), number: JOURNAL_NUMBER };
    let newest = || robot.node.inspect_stream(journal).unwrap()?.newest.map(|newest| newest.sequence);
    for _ in 0..3 {
        let before = newest();
        for order in ["off", "on"] {
            place.say(&["call", "mapper.0", order]).ok();
        }
        wait("the journal goes on", || newest().filter(|now| Some(*now) > before));
        // It has had a turn since.
        tool.status(robot.name("logd.0")).unwrap();
    }
    place.say(&["call", "player.0", "on"]).ok();
    let file = place.path("recordings/main-0001.mcap");
    until("the journal is recorded", || count(&file, "mapper.0", |_| true) > 0);
    tool.close();
    launch.stop();
    let words = ["replay", "--exact", "--run-recorded", "--json", file.to_str().unwrap(), "mapper.0"];
    let told = place.start(&words).said();
    let run: serde_json::Value = serde_json::from_str(&told.out).unwrap_or_else(|_| panic!("{told:?}"));
    assert_eq!((told.code, &run["result"]), (Some(0), &"identical".into()), "{told:?}");
    place.assert_empty();
}

/// Then there is no time at which anything could arrive, but the recorder does its work: it looks, and says how it is.
#[test]
fn before_a_log_begins_modules_are_found_and_nothing_is_recorded() {
    let (place, mut launch, robot) = launched(&["[time]\nsource = \"log\"\n", RECORD].concat());
    let mut tool = robot.tool(PATIENCE);
    // Published with each look.
    let state: RecordingState = wait("the recorder says how it is", || {
        let said = robot.newest(&mut tool, "logd.0", RecorderInterface::STATE);
        // Two feeders have two items each; and there are the collector's lines.
        said.ok().map(|(_, state)| state).filter(|state| state.channels == 5)
    });
    assert_eq!((state.written, state.lost, state.waiting), (0, 0, 0), "{state:?}");
    tool.close();
    place.end(&mut launch);
}
