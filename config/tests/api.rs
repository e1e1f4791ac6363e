//! What other crates rely on when they use an installation.

use rohrpost_config::{
    ClockSetPolicy, Installation, JOURNAL, Level, LineFormat, Node, OverflowPolicy, Program, Reach, RecordedItems,
    RestartPolicy, Sampling, Scheduling, Start, StreamSpec, TimeSource, Watchdog, explain,
};
use rohrpost_mailbox::{Class, Name};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

const FULL: &str = include_str!("full.toml");
const DEMO: &str = include_str!("../demo.toml");
const RECORD: &str = include_str!("record.toml");

fn parse(text: &str) -> Installation {
    Installation::parse(text, Path::new("conf/full.toml")).unwrap_or_else(|errors| panic!("{errors}"))
}

#[test]
fn every_key_arrives() {
    let full = parse(FULL);
    assert_eq!((full.name.as_str(), full.system.name.as_str(), full.system.id), ("two-computers", "ottfried", 7));
    assert_eq!(full.folder, Path::new("conf"));
    assert_eq!(full.scheduling(Class(159)), Scheduling::Normal { nice: 0 });
    assert_eq!(full.scheduling(Class(160)), Scheduling::Fifo { priority: 1 });
    let address = Some([10, 0, 0, 1].into());
    let base = Node { name: "base".into(), reach: Reach::Lan, address, mode: 0o770, tools: 0..=15, line: 21 };
    assert_eq!(full.node("base"), Some(&base));
    assert_eq!(full.time, TimeSource::Master { masters: vec![1, 0], interval: Duration::from_millis(500) });
    assert_eq!(full.when_set, ClockSetPolicy::NewEpoch);
    let network = full.network.unwrap();
    assert_eq!((network.port, network.mtu, network.datagram_bytes_max, network.bulk_below), (4000, 9000, 8972, 33));
    assert_eq!((network.rate_bytes_s, network.quota_bytes), (10 << 20, 1 << 20));
    assert_eq!(full.parameters, Some(PathBuf::from("conf/tuned.toml")));
    let output = &full.output;
    assert_eq!((output.rate, output.burst, output.ring, output.journal), (50, 80, 500, true));
    assert_eq!(output.file, Some(PathBuf::from("conf/robot.log")));
    assert_eq!((output.file_size, output.files, output.format), (1 << 20, 2, LineFormat::Json));

    let motor = full.module(Name::new(7, 200, 0, 0)).unwrap();
    let words = ["./drivers/base", "--port", "/dev/ttyS0"].map(String::from);
    assert_eq!(motor.program, Program::Command(words.into()));
    assert_eq!((motor.start, motor.restart.policy), (Start::Off, RestartPolicy::Always));
    assert_eq!((motor.restart.at_most, motor.restart.within), (3, Duration::from_secs(300)));
    assert_eq!((motor.ready_within, motor.stop_within), (Duration::from_secs(3), Duration::from_millis(500)));
    assert_eq!(motor.spin, Duration::from_micros(20));
    let ms = Duration::from_millis;
    assert_eq!(motor.watchdog, Some(Watchdog { limit: ms(1500), grace: ms(50) }));
    let mapper = full.module(Name::new(7, 96, 0, 0)).unwrap();
    assert_eq!(mapper.watchdog, Some(Watchdog { limit: ms(300), grace: Duration::ZERO }));
    let limits = [150, 200].map(|class| mapper.call_limits.of(Name::new(7, class, 0, 0)));
    assert_eq!(limits, [Some(ms(200)), None]);
    let commands = motor.mailboxes.commands;
    assert_eq!((commands.slots, commands.size, commands.full, commands.claims), (16, 200, OverflowPolicy::Reject, 2));
    assert_eq!(commands.max_age, Some(Duration::from_millis(300)));
    let scan = StreamSpec { record_bytes: 2048, keep: 256, readers: 4, late: Duration::from_millis(50) };
    let image = StreamSpec { record_bytes: 8 << 20, keep: 8, ..StreamSpec::default() };
    assert_eq!(motor.streams, BTreeMap::from([("image".into(), image), ("scan".into(), scan)]));
    let line = |text: &str| 1 + FULL.lines().position(|line| line == text).unwrap();
    assert_eq!(full.document().stream_line(motor, "image"), line("[module.stream.image]"));
    assert_eq!(full.document().stream_line(motor, "points"), motor.line, "it has no section");

    assert_eq!(full.flows[0].deadline, Duration::from_millis(50));
    assert_eq!(full.flows[1].deadline, full.flows[1].period, "without a deadline, the next package's time");
    assert_eq!(full.gui.show[0].rate, None);
    assert_eq!(full.gui.show[1].rate, Some(0.5));
}

#[test]
fn what_is_recorded_is_found_by_module_and_item_and_is_called() {
    let full = parse(RECORD);
    let record = full.record.as_ref().unwrap();
    assert_eq!((record.directory.as_path(), record.drawn), (Path::new("conf/recordings"), Some(5.0)));
    assert_eq!((record.output, record.rotate_size, record.leave_free), (Some(Level::Warn), 100 << 20, 1 << 30));
    let ms = Duration::from_millis;
    assert_eq!((record.rotate_after, record.flush, record.sync), (ms(600_000), ms(200), ms(1000)));
    let name = |text: &str| full.classes.parse_module(text).unwrap();
    let sampling = |items: Option<&RecordedItems>| items.map(|items| items.sampling);
    for (module, item, stream, datum) in [
        ("laser.0", "scan", Some(Sampling::Each), Some(Sampling::Rate(2.5))),
        ("motor.0", "image", Some(Sampling::Every(10)), Some(Sampling::Rate(2.5))),
        ("mapper.0", "pose", None, Some(Sampling::Each)),
        ("mapper.0", "map", None, Some(Sampling::Rate(2.5))),
    ] {
        let found = (sampling(record.stream(name(module), item)), sampling(record.datum(name(module), item)));
        assert_eq!(found, (stream, datum), "{module}/{item}");
        assert_eq!(sampling(record.in_place(name(module), item)), stream, "`*` of `data` is not meant for {item}");
    }
    let named = parse(&RECORD.replace("data = [", "data = [\"motor.0/image\", "));
    let record = named.record.as_ref().unwrap();
    assert_eq!(sampling(record.in_place(name("motor.0"), "image")), None, "`data` names it more exactly");
    assert_eq!(sampling(record.in_place(name("laser.0"), "scan")), Some(Sampling::Each));
    let recorder = full.module(name("logd.0")).unwrap();
    let mut calls: Vec<String> = recorder.calls.iter().map(|name| full.classes.format(*name)).collect();
    calls.sort();
    assert_eq!(calls, ["laser.0", "mapper.0", "motor.0", "output.0"], "subscribing is a command");
    assert_eq!(parse(FULL).record, None);
}

#[test]
fn a_recorder_gives_way_to_no_ordinary_program_and_has_time_for_its_disk() {
    let of = |text: &str| {
        let installation = parse(text);
        let recorder = installation.module(installation.classes.parse_module("logd.0").unwrap()).unwrap();
        assert_eq!(installation.scheduling(recorder.name.class()), Scheduling::Normal { nice: 12 });
        (installation.scheduling_of(recorder), recorder.stop_within)
    };
    assert_eq!(of(RECORD), (Scheduling::Normal { nice: 0 }, Duration::from_secs(60)));
    let said = RECORD.replace("builtin = \"logd\"", "builtin = \"logd\"\nstop-within = \"3 s\"");
    assert_eq!(of(&said).1, Duration::from_secs(3));
}

#[test]
fn memory_of_a_node_is_that_of_its_mailboxes_streams_and_journals() {
    let full = parse(FULL);
    let without = FULL.replace("stream.scan", "settings.scan").replace("stream.image", "settings.image");
    let streams: u64 = full.modules.iter().flat_map(|module| module.streams.values()).map(StreamSpec::memory).sum();
    assert!(streams > 17 * (8 << 20), "8 records, 8 readers, and one that is being written: {streams}");
    assert_eq!(full.memory_on("base"), parse(&without).memory_on("base") + streams);
    assert_eq!(full.memory_on("desk"), parse(&without).memory_on("desk"));
    let without = RECORD.replace("exact = [\"motor.0\"]", "");
    assert_eq!(parse(RECORD).memory_on("base"), parse(&without).memory_on("base") + JOURNAL.memory());
}

#[test]
fn modules_are_found_by_every_name_they_answer_to() {
    let full = parse(FULL);
    let found = |text: &str| {
        let name = full.classes.parse_name(text).unwrap();
        full.module(name).map(|module| full.classes.format(module.name))
    };
    for (text, module) in [
        ("motor.0", Some("motor.0")),
        ("laser.0", Some("motor.0")),
        ("7.laser.0.2", Some("motor.0")),
        ("laser.1", None),
        ("1.laser.0.2", None),
    ] {
        assert_eq!(found(text).as_deref(), module, "{text}");
    }
    assert_eq!(full.modules_on("desk").count(), 3, "with its router");
    let level = |text: &str| full.output_level(full.classes.parse_name(text).unwrap());
    assert_eq!(level("7.laser.0.2"), Level::Trace, "by a mailbox of an alias");
    assert_eq!(level("motor.0"), Level::Trace, "it is one process with its alias");
    assert_eq!((level("mapper.0"), level("output.0")), (Level::Debug, Level::Warn));
    let node = |text: &str| full.node_of(full.classes.parse_name(text).unwrap());
    assert_eq!([node("motor.0"), node("laser.0"), node("mapper.0")], [Some("base"), Some("base"), Some("desk")]);
    assert_eq!([node("tool.3"), node("tool.16"), node("laser.1")], [Some("base"), Some("desk"), None]);
}

#[derive(Debug, Deserialize, PartialEq)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
struct MapperSettings {
    laser: String,
    odometry: String,
    resolution_m: f64,
}

#[test]
fn settings_become_types_or_name_their_line() {
    let settings = |text: &str| {
        let demo = parse(text);
        let name = demo.classes.parse_module("mapper.0").unwrap();
        demo.document().settings_as::<MapperSettings>(demo.module(name).unwrap()).map_err(|error| error.to_string())
    };
    let right = MapperSettings { laser: "laser.0".into(), odometry: "odometry.0".into(), resolution_m: 0.05 };
    assert_eq!(settings(DEMO), Ok(right));
    let with = |settings: &str| {
        let old = "settings = { laser = \"laser.0\", odometry = \"odometry.0\", resolution-m = 0.05 }\n";
        assert!(DEMO.contains(old));
        DEMO.replace(old, settings)
    };
    let line = 1 + DEMO.lines().position(|line| line.contains("resolution-m")).unwrap();
    for (text, at, why) in [
        ("settings = {\n    laser = 3,\n}\n", line + 1, "invalid type: integer `3`, expected a string"),
        ("settings = { resolution = 1 }\n", line, "unknown field `resolution`, expected one of `laser`, "),
        ("settings = { laser = \"laser.0\" }\n", line, "missing field `odometry`"),
        ("", line - 4, "missing field `laser`"),
    ] {
        let error = settings(&with(text)).unwrap_err();
        let expected = format!("conf/full.toml:{at}: settings of module `mapper.0`: {why}");
        assert!(error.starts_with(&expected), "{error}\nis not {expected}");
    }
}

#[test]
fn digest_counts_what_must_be_equal_and_nothing_else() {
    let digest = |text: &str| parse(text).digest();
    let full = digest(FULL);
    // Written down: a change here means that robots with older programs refuse the new ones.
    assert_eq!(full.to_string(), "a7d34094d7d21776-71f39a834cb71034");
    for (old, new, common, system, why) in [
        ("# Every key", "# Other words", true, true, "a comment"),
        ("Drives the wheels", "Turns the wheels", true, true, "a text"),
        ("stop-within = \"500 ms\"", "stop-within = \"0.5 s\"", true, true, "a spelling"),
        ("size = \"60 KiB\"", "size = \"50 KiB\"", true, true, "a node's own mailbox"),
        ("record = \"8 MiB\"", "record = \"6 MiB\"", true, true, "a node's own stream"),
        ("laser = [\"mapper\"]", "laser = [\"mapper\", \"tool\"]", true, true, "what a node's own modules admit"),
        ("id = 150", "id = 151", false, false, "another priority, and with it other names"),
        ("10.0.0.2", "10.0.0.3", true, false, "another address"),
        ("tools = [16, 31]", "tools = [16, 32]", true, false, "other tool instances"),
        ("aliases = [\"laser.0\"]", "aliases = [\"laser.0\", \"laser.1\"]", true, false, "another alias"),
    ] {
        assert!(FULL.contains(old), "{old}");
        let changed = digest(&FULL.replacen(old, new, 1));
        assert_eq!((changed.common == full.common, changed.system == full.system), (common, system), "{why}");
    }
}

#[test]
fn missing_programs_matter_where_they_should_run() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("full.toml");
    fs::write(&path, FULL).unwrap();
    let full = Installation::load(&path).unwrap();
    assert_eq!(full.missing_programs("desk", folder.path()), []);
    let missing = full.missing_programs("base", folder.path());
    assert_eq!(missing.len(), 1);
    assert!(!missing[0].optional);
    let line = 1 + FULL.lines().position(|line| line == "[[module]]").unwrap();
    let expected = format!(
        "{}:{line}: module `motor.0`: `./drivers/base` is no program at {}/drivers/base; build or install it, or \
         correct `program`",
        path.display(),
        folder.path().display()
    );
    assert_eq!(missing[0].to_string(), expected);
}

#[test]
fn a_file_that_is_not_there_says_so() {
    let errors = Installation::load(Path::new("no/such.toml")).unwrap_err();
    assert_eq!(
        errors.to_string(),
        "no/such.toml: cannot be read (No such file or directory (os error 2)); name an installation's file, such as \
         config/demo.toml"
    );
}

#[test]
fn one_node_is_explained_alone() {
    let full = parse(FULL);
    let page = explain(&full, Some("desk"));
    assert!(page.contains("Node `desk`") && !page.contains("Node `base`"));
    assert!(explain(&full, Some("roof")).contains("There is no node `roof`; the nodes are base, desk."));
}

/// Half a file, a file without one of its lines, and a file with two lines in one: errors perhaps, but no panic, and
/// each error in an existing line.
#[test]
fn damaged_files_give_errors_and_nothing_worse() {
    let lines: Vec<&str> = FULL.lines().collect();
    for cut in 0..lines.len() {
        let joined = |parts: &[&[&str]]| parts.concat().join("\n");
        let (before, after) = lines.split_at(cut);
        for text in [joined(&[before]), joined(&[before, &after[1..]]), joined(&[before, &after[..1], after])] {
            if let Err(errors) = Installation::parse(&text, Path::new("damaged.toml")) {
                let last = text.lines().count().max(1);
                assert!(!errors.problems().is_empty(), "{text}");
                assert!(errors.problems().iter().all(|p| p.line.is_some_and(|line| line <= last)), "{errors}\n{text}");
            }
        }
    }
}

/// Time of the processor for this thread, whatever else the computer does.
fn processor_ns() -> u64 {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    told.split(' ').next().and_then(|text| text.parse().ok()).unwrap_or_default()
}

#[test]
fn ten_times_as_many_lines_that_are_no_toml_take_about_ten_times_as_long() {
    // As many in sum, and enough of them for a clock that goes by ticks.
    let times = [200, 2000].map(|count| {
        let text: String = (0..count).map(|line| format!("key-{line} = = {line}\n")).collect();
        let before = processor_ns();
        for _ in 0..20_000 / count {
            let errors = Installation::parse(&text, Path::new("robot.toml")).unwrap_err();
            assert!(errors.problems().len() >= count, "{}", errors.problems().len());
        }
        processor_ns() - before
    });
    assert!(times[1] < 3 * times[0], "{times:?} ns");
}

#[test]
fn two_that_each_command_a_name_of_one_process_alone_do_not_command_the_other_s() {
    let installation = parse(
        "installation = \"alone\"\n[system]\nname = \"robot\"\nid = 1\n[classes]\nmotor = { id = 220 }\n\
         left = { id = 210 }\nright = { id = 209 }\nlaser = { id = 150 }\ntool = { id = 16 }\n[nodes.main]\n\
         [[module]]\nname = \"motor.1\"\naliases = [\"motor.2\", \"laser.0\"]\nprogram = \"wheels\"\n\
         [[module]]\nname = \"left.0\"\nprogram = \"left\"\ncalls = [{ to = \"motor.1\", alone = true }]\n\
         [[module]]\nname = \"right.0\"\nprogram = \"right\"\ncalls = [{ to = \"motor.2\", alone = true }]\n",
    );
    let name = |text: &str| installation.classes.parse_module(text).unwrap();
    for (from, to, may) in [
        ("left.0", "motor.1", true),
        ("left.0", "motor.2", false),
        ("right.0", "motor.1", false),
        ("right.0", "motor.2", true),
        ("left.0", "laser.0", true),
        ("right.0", "laser.0", true),
    ] {
        assert_eq!(installation.access_against(name(from), name(to)).is_none(), may, "{from} to {to}");
    }
}
