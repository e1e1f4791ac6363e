//! `rohrpost stream` on a simulated robot: streams by name, records by the description of their module, and the value
//! at a time.

use crate::completions::offered;
use crate::conforming::unhex;
use crate::harness::{NoSettings, OUTPUT, Place, RECORDED_CLASSES, Robot, classes, program, run_if_launched, wait};
use crate::process::{Running, Said};
use rohrpost::interfaces::WheelsInterface;
use rohrpost::types::Odometry;
use rohrpost::{Context, Module, ModuleError, Stream};
use serde_json::Value;
use std::f64::consts::{PI, TAU};

/// Not a test: a module that launch starts. Run as a test it ends at once.
#[test]
fn reader() {
    run_if_launched::<Reader>();
}

/// Reads odometry as modules do.
#[rohrpost::interface(class = "reader")]
trait Reading {
    /// Its value at this time, or why there is none.
    #[command(16, idempotent)]
    fn odometry_at(&mut self, stamp_ns: u64) -> Result<Odometry, String>;
}

struct Reader {
    odometry: Stream<Odometry>,
}

impl Module for Reader {
    type Settings = NoSettings;
    type Interfaces = ReadingInterface;

    fn new(_: NoSettings, context: &mut Context) -> Result<Self, ModuleError> {
        Ok(Self { odometry: context.stream(WheelsInterface::ODOMETRY, "odometry.0")? })
    }
}

impl Reading for Reader {
    fn odometry_at(&mut self, stamp_ns: u64) -> Result<Odometry, String> {
        let value = self.odometry.at(stamp_ns).map_err(|error| error.to_string())?;
        value.map_err(|why| why.to_string())
    }
}

/// A robot that drives about, and a module that reads its odometry.
const ROBOT: &str = r#"
[[module]]
name = "motor.0"
aliases = ["odometry.0", "laser.0", "camera.0", "depth.0"]
builtin = "sim"
settings = { map = "MAP", camera-rate-hz = 2, depth-rate-hz = 1 }
[module.stream.odometry]
record = "128 B"
keep = 4096
[module.stream.image]
record = "1 MiB"
keep = 4
[module.stream.points]
record = "2500 KiB"
keep = 2

[[module]]
name = "pilot.0"
builtin = "pilot"
calls = ["laser.0", "motor.0"]
settings = { laser = "laser.0", motor = "motor.0", cruise-m-s = 0.6, seed = 16 }

[[module]]
name = "reader.0"
program = PROGRAM
"#;

const ODOMETRY: [&str; 2] = ["odometry.0", "odometry"];

fn launched() -> (Place, Running, Robot) {
    let map = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/building.map");
    let program = program("streams_described::reader");
    let text = ROBOT.replace("MAP", map).replace("PROGRAM", &program);
    Place::running(&[&RECORDED_CLASSES, &classes("camera 112, depth 104, reader 94"), &text, OUTPUT])
}

fn interp(place: &Place, stream: &[&str], more: &[&str]) -> Said {
    place.say(&[&["stream", "interp"], stream, more].concat())
}

/// A value between two records that differ, once the robot drives.
fn value_on_the_way(place: &Place) -> Value {
    wait("the robot drives", || {
        let said = interp(place, &ODOMETRY, &["--at", "-0.12s", "--json"]);
        let found: Value = serde_json::from_str(&said.out).ok().filter(|_| said.code == Some(0))?;
        let pose = |side: &str| found[side]["value"]["pose"].clone();
        (pose("before")["x_m"] != pose("after")["x_m"]).then_some(found)
    })
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("no number: {value}"))
}

#[test]
fn a_value_agrees_with_the_records_around_it_and_with_what_a_module_gets() {
    let (place, mut launch, _robot) = launched();
    let found = value_on_the_way(&place);
    let stamp_ns = |of: &Value| of["stamp_ns"].as_u64().unwrap();
    let (at_ns, before, after) = (stamp_ns(&found), &found["before"], &found["after"]);
    assert!(stamp_ns(before) < at_ns && at_ns < stamp_ns(after), "{found:#}");
    let share = (at_ns - stamp_ns(before)) as f64 / (stamp_ns(after) - stamp_ns(before)) as f64;
    assert!((number(&found["share"]) - share).abs() < 1e-9, "{found:#}");
    for path in ["/pose/x_m", "/pose/y_m", "/pose/heading_rad", "/twist/speed_m_s", "/twist/turn_rate_rad_s"] {
        let of = |of: &Value| number(of["value"].pointer(path).unwrap());
        let mut step = of(after) - of(before);
        if path.ends_with("heading_rad") {
            step = (step + PI).rem_euclid(TAU) - PI;
        }
        let off = number(found["value"].pointer(path).unwrap()) - of(before) - share * step;
        // A heading may have been turned once round.
        let off = off - (off / TAU).round() * TAU;
        assert!(off.abs() < 1e-9, "{path} is off by {off}: {found:#}");
    }
    // The same time in other words, and the stream by its number.
    let (ns, seconds) = (at_ns.to_string(), format!("{}.{:09}", at_ns / 1_000_000_000, at_ns % 1_000_000_000));
    let again = interp(&place, &["odometry.0", "1"], &["--at", &ns, "--json"]).json();
    assert_eq!((&again["value"], stamp_ns(&again)), (&found["value"], at_ns));
    let text = interp(&place, &ODOMETRY, &["--at", &seconds]).ok();
    let lines: Vec<&str> = text.lines().collect();
    let way = format!(" of the way from #{} to #{}", before["sequence"], after["sequence"]);
    assert!(lines[0].starts_with("{pose: {x_m: ") && lines[1].starts_with(&format!("at {seconds}, 0.")), "{text}");
    assert!(
        lines[1].ends_with(&way) && lines[2].starts_with("before  #") && lines[3].starts_with("after   #"),
        "{text}"
    );
    let read = place.say(&[&["stream", "read"], &ODOMETRY[..], &["--at", &ns]].concat()).ok();
    assert_eq!(lines[2..], read.lines().collect::<Vec<_>>());
    // A module gets the very same.
    let typed = place.say(&["call", "reader.0", "odometry_at", &ns, "--json"]).json();
    assert_eq!(typed, found["value"]);
    place.end(&mut launch);
}

#[test]
fn a_time_without_a_value_says_exactly_why_and_one_to_come_is_waited_for() {
    let (place, mut launch, _robot) = launched();
    let found = value_on_the_way(&place);
    let (at, ns) = ("--at", found["stamp_ns"].to_string());
    let [before_ns, after_ns] = ["before", "after"].map(|side| found[side]["stamp_ns"].as_u64().unwrap());
    let gap_ns = after_ns - before_ns;
    let gap = format!("that time lies in a gap of {}.{:09} s", gap_ns / 1_000_000_000, gap_ns % 1_000_000_000);
    for (stream, more, words) in [
        (ODOMETRY, &[at, "1.0"][..], "odometry.0 odometry: the record before that time is not there"),
        (ODOMETRY, &[at, "+1h"], "odometry.0 odometry: not yet: nearer records may come until stamps are at most 3600"),
        (ODOMETRY, &[at, "+1h", "--wait", "50ms"], "not yet"),
        (ODOMETRY, &[at, &ns, "--gap", "1us"], &gap),
        (ODOMETRY, &[at, &ns, "--epoch", "99"], "no two records of epoch 99 are around that time"),
        (["odometry.0", "odometer"], &[at, &ns], "odometry.0 has no stream `odometer`; it has: odometry"),
        (["odometry.0", "7"], &[at, &ns], "odometry.0 has no stream 7; it has 1"),
        (["motor.0", "motion"], &[at, &ns], "is data and no stream; `rohrpost echo motor.0 motion` prints it"),
    ] {
        interp(&place, &stream, more).fails_with([words]);
    }
    let said = interp(&place, &ODOMETRY, &[at, "+1h", "--json"]);
    let refusal: Value = serde_json::from_str(&said.out).unwrap();
    assert_eq!((said.code, &refusal["answer"]), (Some(1), &"not yet".into()));
    assert!(refusal["by_ns"].as_u64() <= Some(3_600_000_000_000), "{refusal}");
    let awaited = interp(&place, &ODOMETRY, &[at, "+0.3s", "--wait", "60s", "--json"]).json();
    assert!(awaited["stamp_ns"].as_u64() > found["stamp_ns"].as_u64(), "{awaited}");
    place.write("a", b"hello");
    place.say(&["stream", "write", "odometry.0", "40", "a", "a"]).ok();
    interp(&place, &["odometry.0", "40"], &[at, "-0s"])
        .fails_with(["odometry.0 40: no module has left a description of it here"]);
    place.end(&mut launch);
}

#[test]
fn records_are_told_as_the_module_describes_them_and_a_picture_by_its_size_and_head() {
    let (place, mut launch, _robot) = launched();
    let read = |stream: &[&str], more: &[&str]| place.say(&[&["stream", "read"], stream, more].concat());
    value_on_the_way(&place);
    let newest = read(&ODOMETRY, &["--json"]).json();
    let from = ["--from", &newest["sequence"].to_string(), "--next", "1"];
    assert_eq!(read(&["odometry.0", "1"], &[&from[..], &["--json"]].concat()).json()["value"], newest["value"]);
    let line = read(&ODOMETRY, &from).ok();
    let words = format!("#{}  ", newest["sequence"]);
    assert!(line.starts_with(&words) && line.contains(" B  {pose: {x_m: "), "{line}");
    // The same as the type itself reads from the bytes.
    let bytes = read(&ODOMETRY, &[&from[..], &["--hex", "--json"]].concat()).json();
    let bytes = unhex(bytes["hex"].as_str().unwrap());
    let odometry: Odometry = rohrpost::wire::from_bytes(&bytes).unwrap();
    let value = &newest["value"];
    assert!((odometry.pose.x_m - number(&value["pose"]["x_m"])).abs() < 1e-12, "{value}");
    assert!((odometry.twist.speed_m_s - number(&value["twist"]["speed_m_s"])).abs() < 1e-12, "{value}");

    wait("the camera sees", || read(&["camera.0", "image"], &[]).code.filter(|code| *code == 0));
    let line = read(&["camera.0", "image"], &[]).ok();
    assert!(line.contains("{width_px: 640, height_px: 480, ") && line.contains(", … 921592 more]"), "{line}");
    assert!(line.len() < 300, "{line}");
    let json = read(&["camera.0", "image"], &["--json", "--bytes", "4"]).json();
    let pixels = &json["value"]["pixels"];
    assert_eq!((&pixels["len_bytes"], pixels["hex"].as_str().map(str::len)), (&(640 * 480 * 3).into(), Some(8)));

    let listing = place.say(&["stream", "list", "--json"]).json();
    let mut items: Vec<String> = listing["streams"]
        .as_array()
        .unwrap()
        .iter()
        .map(|stream| format!("{} {}", stream["stream"].as_str().unwrap(), stream["item"].as_str().unwrap()))
        .collect();
    items.sort();
    assert_eq!(items, ["camera.0 image", "depth.0 points", "laser.0 scan", "odometry.0 odometry"]);
    for list in [&["stream", "list"][..], &["list", "--streams"]] {
        place.say(list).ok_with(["odometry.0  odometry       1  "]);
    }
    let info = place.say(&["stream", "info", "camera.0", "image"]).ok();
    assert!(info.starts_with("stream camera.0 1, image, node main\n"), "{info}");
    let top = place.say(&["top", "--json"]).json();
    assert!(top["streams"].as_array().unwrap().iter().any(|stream| stream["item"] == "points"), "{top}");
    assert_eq!(offered(&place, &["rohrpost", "stream", "interp", "odometry.0", ""]), ["odometry"]);
    place.end(&mut launch);
}
