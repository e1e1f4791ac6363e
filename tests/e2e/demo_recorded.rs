//! `rohrpost demo --record`: one file with all of the demo.

use crate::harness::{Place, signal, wait};
use nix::sys::signal::Signal;
use rohrpost_recording::{Info, info};

const LOG: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../modules/robot/tests/data/small.log");

/// Streams, data and output of the demo.
const TOPICS: [&str; 7] = [
    "camera.0/image",
    "depth.0/points",
    "laser.0/scan",
    "mapper.0/map",
    "mapper.0/pose",
    "odometry.0/odometry",
    "output.0/line",
];

/// What is drawn of each, and whether it is reduced: of the camera's pictures, which are longer than 64 KiB, each
/// fourth pixel.
const DRAWN: [(&str, &str, bool); 5] = [
    ("camera.0/image", "foxglove.RawImage", true),
    ("depth.0/points", "foxglove.PointCloud", true),
    ("laser.0/scan", "foxglove.PointCloud", false),
    ("mapper.0/pose", "foxglove.PoseInFrame", false),
    ("output.0/line", "foxglove.Log", false),
];

/// Whether something is drawn of each.
fn is_drawn(told: &Info) -> bool {
    DRAWN.iter().all(|(topic, type_name, is_reduced)| {
        told.channels.iter().any(|channel| {
            let is_it = channel.type_name == *type_name && channel.drawn_of.as_deref() == Some(*topic);
            is_it && channel.messages > 0 && channel.is_reduced == *is_reduced
        })
    })
}

/// The demo, until it has recorded something of all, and drawn it; its last words.
fn recorded(place: &Place, further: &[&str]) -> String {
    let arguments = [&["demo", "--no-gui", "--quiet", "--record", "out.mcap"], further].concat();
    let mut demo = place.start(&arguments);
    wait("all is recorded", || {
        demo.assert_runs();
        let said = place.say(&["call", "logd.0", "channels", "0", "--json"]);
        let page: serde_json::Value = serde_json::from_str(&said.out).ok()?;
        let channels = page["channels"].as_array()?;
        let has =
            |topic: &&str| channels.iter().any(|its| its["topic"] == **topic && its["written"].as_u64() > Some(0));
        let drawn = || info(&place.path("out.mcap.part/main-0001.mcap")).is_ok_and(|told| is_drawn(&told));
        (TOPICS.iter().all(has) && drawn()).then_some(())
    });
    demo.stop()
}

#[test]
fn all_of_a_demo_is_in_one_file() {
    let place = Place::new();
    let said = recorded(&place, &[]);
    let line = said.lines().last().unwrap();
    let file = place.path("out.mcap");
    let told = info(&file).unwrap();
    // On a busy computer.
    let lost = if told.lost > 0 { format!(", {} lost", told.lost) } else { String::new() };
    let begin = format!("recording: out.mcap: {} messages{lost}, ", told.messages);
    assert!(line.starts_with(&begin) && line.ends_with("rohrpost record info out.mcap)"), "{said}");
    assert_eq!(told.closed_because.as_deref(), Some("ended"), "{told:?}");
    for topic in TOPICS {
        let channel = told.channels.iter().find(|channel| channel.topic == topic);
        assert!(channel.is_some_and(|channel| channel.messages > 0), "{topic}: {told:?}");
    }
    assert!(is_drawn(&told), "{told:?}");
    let said = place.say(&["record", "info", "out.mcap"]);
    said.ok_with(["foxglove.RawImage protobuf, drawn of camera.0/image, reduced to 64 KiB"]);
    assert!(told.configuration["demo.toml"].contains("[record]"));
    assert!(!place.path("out.mcap.part").exists());
    let before = std::fs::read(&file).unwrap();
    for (arguments, words) in [
        (&["--record", "out.mcap"][..], "out.mcap: is there already; --overwrite replaces it"),
        (&["--record", "."], "names no file"),
        (&["--record", "..", "--overwrite"], "names no file"),
        (&["--record", "none/out.mcap"], "none/out.mcap.part: cannot make this folder"),
        (&["--record", "new.mcap", "--nodes", "3"], "--record records a demo of one node"),
    ] {
        place.say(&[&["demo", "--no-gui", "--quiet"], arguments].concat()).fails_with([words]);
    }
    assert_eq!(std::fs::read(&file).unwrap(), before);
    std::fs::create_dir(place.path("new.mcap.part")).unwrap();
    let said = place.say(&["demo", "--no-gui", "--quiet", "--record", "new.mcap"]);
    said.fails_with(["new.mcap.part: another demo records there, or was killed"]);
    recorded(&place, &["--overwrite"]);
    assert!(info(&file).unwrap().first_ns > told.last_ns, "it is another one");
    let said = place.say(&["replay", "out.mcap", "--rate", "20", "--no-gui", "--quiet"]).ok();
    assert!(said.starts_with("played "), "what is drawn is left out without a word: {said}");
    place.assert_empty();
}

/// Then there is no time before the log begins, and nothing is recorded.
#[test]
fn a_log_is_recorded_as_well() {
    let place = Place::new();
    let arguments = ["demo", "--log", LOG, "--speed", "50", "--no-gui", "--quiet", "--record", "log.mcap"];
    let said = place.say(&arguments).ok();
    assert!(said.lines().last().unwrap().starts_with("recording: log.mcap: "), "{said}");
    let told = info(&place.path("log.mcap")).unwrap();
    let has = |topic: &str| told.channels.iter().any(|channel| channel.topic == topic && channel.messages > 0);
    assert!(has("laser.0/scan") && has("mapper.0/map") && told.is_closed, "{told:?}");
    place.assert_empty();
}

/// A recorder that is killed goes on with another file; at the end there is one.
#[test]
fn a_recorder_that_was_started_again_leaves_one_file_too() {
    let place = Place::new();
    let mut demo = place.start(&["demo", "--no-gui", "--quiet", "--record", "out.mcap"]);
    let written = || {
        let said = place.say(&["call", "logd.0", "recording", "--json"]);
        let state: serde_json::Value = serde_json::from_str(&said.out).ok()?;
        (state["written"].as_u64() > Some(20)).then_some(())
    };
    wait("something is recorded", || {
        demo.assert_runs();
        written()
    });
    let list = place.say(&["list", "--json"]).json();
    let modules = list["modules"].as_array().unwrap();
    let recorder = modules.iter().find(|module| module["module"] == "logd.0").unwrap();
    signal(recorder["pid"].as_u64().unwrap() as u32, Signal::SIGKILL);
    wait("another file has something", || {
        place.path("out.mcap.part/main-0002.mcap").exists().then_some(())?;
        written()
    });
    let said = demo.stop();
    assert!(said.contains(", in which the recorder was started again ("), "{said}");
    let told = info(&place.path("out.mcap")).unwrap();
    assert!(told.is_closed && told.messages > 40, "{told:?}");
    assert!(told.others.iter().any(|(name, _)| name == "rohrpost.merged"), "{told:?}");
    assert!(!place.path("out.mcap.part").exists());
    place.assert_empty();
}
