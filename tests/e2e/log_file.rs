//! `rohrpost log --file`: lines of output from recordings, without a robot.

use crate::harness::{Place, head};
use crate::recordings::{self, channel, session};
use rohrpost::Name;
use rohrpost::common::OutputLevel;
use rohrpost::output::OutputLine;
use rohrpost::schema::{Members, Schema, Type};
use rohrpost::wire::append;
use rohrpost_recording::{Message, Session};
use std::collections::BTreeMap;

const MODULES: &str = r#"
[nodes.main]
[[module]]
name = "output.0"
builtin = "output"
[[module]]
name = "motor.0"
program = "true"
aliases = ["pilot.1"]
[[module]]
name = "pilot.0"
program = "true"
"#;

fn config() -> String {
    head("pilot 140, motor 200, output 32, tool 16") + MODULES
}

/// 2023-11-14, 22:13:20.
const BEGIN_NS: u64 = 1_700_000_000_000_000_000;

/// A line, so many seconds after the beginning.
type Said<'a> = (u64, u8, OutputLevel, &'a str);

/// A recording of these lines, and of something else. Its file.
fn recorded(place: &Place, stem: &str, config: &str, lines: &[Said<'_>]) -> String {
    let configuration = BTreeMap::from([("saved.toml".into(), "odd = 1".into()), ("test.toml".into(), config.into())]);
    let session = Session { node: "main".into(), configuration, ..Session::default() };
    let mut writer = recordings::begin(place, stem, session);
    let lines_channel = channel(&mut writer, "output.0", "line", &OutputLine::schema());
    let speed = channel(&mut writer, "motor.0", "speed", &Type::U8);
    for (number, (second, class, level, text)) in (0..).zip(lines) {
        let time_ns = BEGIN_NS + second * 1_000_000_000;
        let module = Name::new(1, *class, 0, 0).raw();
        let mut data = Vec::new();
        let errno = (*level == OutputLevel::Error).then_some(5);
        let line = OutputLine { time_ns, module, level: *level, lost: 0, suppressed: 0, errno, text: (*text).into() };
        append(&mut data, &line).unwrap();
        let message = Message { arrival_ns: time_ns, stamp_ns: time_ns, epoch: 1, sequence: number, data: &data };
        writer.write(lines_channel, &message).unwrap();
        writer.write(speed, &Message { data: &[7], ..message }).unwrap();
    }
    recordings::end(place, stem, writer).to_str().unwrap().to_owned()
}

const FIRST: [Said<'static>; 3] = [
    (0, 32, OutputLevel::Info, "is on"),
    (2, 140, OutputLevel::Warn, "a wall"),
    (90, 200, OutputLevel::Error, "stalls\nsince long"),
];
const SECOND: [Said<'static>; 2] = [(1, 200, OutputLevel::Info, "is on"), (100, 140, OutputLevel::Debug, "turns")];

#[test]
fn lines_of_recordings_are_shown_as_those_of_a_robot() {
    let place = Place::new();
    let files = [recorded(&place, "b", &config(), &FIRST), recorded(&place, "a", &config(), &SECOND)];
    let files: Vec<&str> = files.iter().map(String::as_str).collect();
    let log = |arguments: &[&str]| place.say(&[&["log", "--file"], &files[..], arguments].concat()).ok();
    let all = [
        "22:13:20.000 info  main/output.0: is on",
        "22:13:21.000 info  main/motor.0: is on",
        "22:13:22.000 warn  main/pilot.0: a wall",
        "22:14:50.000 error main/motor.0: stalls\n\tsince long (errno 5: Input/output error)",
        "22:15:00.000 debug main/pilot.0: turns",
    ];
    for (arguments, shown, why) in [
        (&[][..], &[0, 1, 2, 3, 4][..], "by time, whatever the order of the files"),
        (&["--level", "warn"], &[2, 3], "warnings and errors"),
        (&["--module", "pilot.0"], &[2, 4], "a module"),
        (&["--module", "pilot.1"], &[1, 3], "an alias of another"),
        (&["--class", "motor", "--text", "STALLS"], &[3], "a class, and words"),
        (&["--text", "errno 5"], &[3], "a number of an error"),
        (&["--since", "15 s"], &[3, 4], "before the end of the recordings"),
        (&["--last", "2"], &[3, 4], "the last ones"),
        (&["--level", "info", "--last", "1"], &[3], "the last one of those"),
    ] {
        let expected: String = shown.iter().map(|at| format!("{}\n", all[*at])).collect();
        assert_eq!(log(arguments), expected, "{why}");
    }
    let json: serde_json::Value = serde_json::from_str(&log(&["--json", "--last", "1"])).unwrap();
    let keys = ["node", "module", "class", "level", "text"].map(|key| json[key].as_str().unwrap());
    assert_eq!(keys, ["main", "pilot.0", "pilot", "debug", "turns"]);
    assert!(json.get("errno").is_none() && json.get("errno_text").is_none(), "{json}");
    let json: serde_json::Value = serde_json::from_str(&log(&["--json", "--level", "error"])).unwrap();
    assert_eq!((&json["errno"], &json["errno_text"]), (&5.into(), &"Input/output error".into()));
    assert_eq!(json["text"], "stalls\nsince long");
}

#[test]
fn what_a_recording_lacks_is_told() {
    let place = Place::new();
    let file = recorded(&place, "a", &config(), &FIRST);
    let bytes = std::fs::read(&file).unwrap();
    let (open, strange) = (place.path("open.mcap"), place.path("odd.toml"));
    std::fs::write(&open, &bytes[..bytes.len() - 1]).unwrap();
    let said = place.say(&["log", "--file", open.to_str().unwrap(), "--level", "error"]).ok();
    let lines: Vec<&str> = said.lines().collect();
    assert!(lines[0].starts_with("… ") && lines[0].contains("open.mcap was not closed: "), "{said}");
    assert_eq!(lines[1..], ["22:14:50.000 error main/motor.0: stalls", "\tsince long (errno 5: Input/output error)"]);
    let other = config().replace("pilot", "driver").replace("\"test\"", "\"other\"");
    std::fs::write(&strange, &other).unwrap();
    let strange = strange.to_str().unwrap();
    let said = place.say(&["log", "--file", &file, "--config", strange, "--module", "driver.0"]).ok();
    assert_eq!(said, "22:13:22.000 warn  main/driver.0: a wall\n");
    let unread = recorded(&place, "c", "installation = 7", &FIRST);
    for (arguments, words) in [
        (&["log", "--file", &unread][..], "no recording has a configuration that is read here; name one with --config"),
        (&["log", "--file", &file, "--module", "pilot.7"], "the configuration has no module `pilot.7`; there are "),
        (&["log", "--file", &file, "--level", "pilot.0=warn"], "write --level warn --module pilot.0"),
        (&["log", "--file", strange], "is no MCAP file"),
    ] {
        place.say(arguments).fails_with([words]);
    }
    let said = place.say(&["log", "--file", &file, "--follow"]);
    assert!(said.code == Some(2) && said.err.contains("cannot be used with"), "{said:?}");
    let damaged = place.path("damaged.mcap");
    // In the second chunk, which has all messages; the first one has the channels.
    let heads = bytes.windows(4).enumerate().filter(|(_, word)| *word == b"zstd");
    let at = heads.map(|(at, _)| at + 4 + 8 + 20).nth(1).unwrap();
    std::fs::write(&damaged, [&bytes[..at], &[bytes[at] ^ 1], &bytes[at + 1..]].concat()).unwrap();
    let said = place.say(&["log", "--file", damaged.to_str().unwrap()]);
    assert!(said.code == Some(1) && said.err.contains("damaged at byte"), "{said:?}");
}

#[test]
fn a_recording_without_lines_says_so() {
    let place = Place::new();
    let mut writer = recordings::begin(&place, "a", session("", "test.toml", &config()));
    channel(&mut writer, "motor.0", "speed", &Type::U8);
    let file = recordings::end(&place, "a", writer);
    let said = place.say(&["log", "--file", file.to_str().unwrap()]).ok();
    assert!(said.starts_with("… ") && said.contains("has no lines of output; `output = true`"), "{said}");
}

/// As those before lines had numbers of errors.
#[test]
fn lines_of_another_version_are_refused_in_words() {
    let place = Place::new();
    let mut writer = recordings::begin(&place, "a", session("", "test.toml", &config()));
    let Type::Struct(mut older) = OutputLine::schema() else { panic!("a line is a struct") };
    let Members::Fields(fields) = &mut older.members else { panic!("with fields") };
    fields.retain(|field| field.name != "errno");
    let line = channel(&mut writer, "output.0", "line", &Type::Struct(older));
    let message = Message { arrival_ns: BEGIN_NS, stamp_ns: BEGIN_NS, epoch: 1, sequence: 0, data: &[0; 6] };
    writer.write(line, &message).unwrap();
    let file = recordings::end(&place, "a", writer);
    let said = place.say(&["log", "--file", file.to_str().unwrap()]).ok();
    let words = "output.0/line has lines of another version; `rohrpost record export --format json` shows them";
    assert!(said.contains(words) && said.lines().count() == 1, "{said}");
}
