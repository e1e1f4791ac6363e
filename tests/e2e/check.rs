//! `rohrpost check`, for people and programs.

use crate::harness::{Place, RECORDED_CLASSES};

/// Built-in modules with a mistake in each.
const WRONG: &str = r#"[[module]]
name = "motor.0"
builtin = "sim"
aliases = ["laser.0", "odometry.0", "mapper.1"]
settings = { map = "building.map", beems = 181 }
[[module]]
name = "laser.1"
builtin = "sim"
settings = { map = "building.map", laser-rate-hz = 1000 }
[[module]]
name = "pilot.0"
builtin = "pilot"
calls = ["laser.0"]
[module.settings]
laser = "laser.0"
motor = "motor.0"
[[module]]
name = "pilot.1"
builtin = "pilot"
calls = ["laser.0", "motor.0"]
[module.settings]
laser = "odometry.0"
motor = "moter.0"
[[module]]
name = "mapper.0"
builtin = "mapper"
calls = ["laser.0", "odometry.0"]
settings = { laser = "laser.7", odometry = "odometry.0", resolution-m = 5 }
[[module]]
name = "pilot.2"
builtin = "pilot"
settings = { motor = "motor.0" }
stream = { picture = { keep = 4 } }
[gui]
show = [
    { from = "laser.0", data = "scan" },
    { from = "laser.0", data = "scam" },
    { from = "mapper.0", data = "grid" },
]
"#;

/// Lines of it, and what is told of them.
const SAID: [(usize, &str); 12] = [
    (
        1,
        "module `motor.0`: alias `mapper.1`: the builtin has no interface of class `mapper`; it has motor, odometry, \
     laser, camera, depth",
    ),
    (
        5,
        "module `motor.0`: settings: unknown field `beems`, expected one of `map`, `arena`, `cell-m`, `seed`, \
     `laser-rate-hz`, `laser-noise-m`, `odometry-rate-hz`, `camera-rate-hz`, `depth-rate-hz`, `scanner`, `beams`, \
     `range-max-m`, `dead-man-ms`",
    ),
    (9, "module `laser.1`: settings: `laser-rate-hz` is 1000 Hz, out of range: 0.01..=100 Hz"),
    (16, "module `pilot.0`: settings: `motor` is `motor.0`, which `calls` does not name; add \"motor.0\" to `calls`"),
    (22, "module `pilot.1`: settings: `laser` is `odometry.0`, but this module calls functions of class `laser`"),
    (
        23,
        "module `pilot.1`: settings: `motor` names no module: `moter.0`: there is no class `moter`; did you mean \
     `motor`?",
    ),
    (28, "module `mapper.0`: settings: `resolution-m` is 5; use 0.005 to 1"),
    (28, "module `mapper.0`: settings: `laser` is `laser.7`, which no [[module]] defines; add one, or name another"),
    (32, "module `pilot.2`: settings: missing field `laser`"),
    (33, "module `pilot.2`: the builtin has no stream `picture`; it has none; drop the section"),
    (37, "[gui] show: `laser.0` has no data `scam`; did you mean `scan`?"),
    (38, "[gui] show: `mapper.0` has no data `grid`; it has map, pose"),
];

/// Writes `wrong.toml` with these modules; what is to be told of their lines.
fn wrong(place: &Place, modules: &str, told: &[(usize, &str)]) -> Vec<String> {
    let file = place.config_of("wrong", "[nodes.main]", &[&RECORDED_CLASSES, modules]);
    let text = std::fs::read_to_string(file).unwrap();
    let before = text.strip_suffix(modules).unwrap().lines().count();
    told.iter().map(|(line, said)| format!("wrong.toml:{}: {said}", before + line)).collect()
}

#[test]
fn settings_of_builtin_modules_are_checked_before_anything_runs() {
    let place = Place::new();
    let expected = wrong(&place, WRONG, &SAID);
    let told = place.say(&["check", "wrong.toml"]).fails();
    assert_eq!(told.trim_end().lines().collect::<Vec<_>>(), expected);
    // Launch reports the same, and starts nothing.
    assert_eq!(place.say(&["launch", "wrong.toml"]).fails(), told);
    place.assert_empty();

    let said = place.say(&["check", "wrong.toml", "--json"]);
    let json: serde_json::Value = serde_json::from_str(&said.out).unwrap();
    assert_eq!((said.code, &json["right"]), (Some(1), &false.into()));
    let errors = json["errors"].as_array().unwrap();
    let lines = errors.iter().map(|error| {
        let (file, message) = (error["file"].as_str().unwrap(), error["message"].as_str().unwrap());
        format!("{file}:{}: {message}", error["line"])
    });
    assert_eq!(lines.collect::<Vec<_>>(), expected);
}

#[test]
fn what_is_to_be_recorded_of_builtin_modules_is_checked_before_anything_runs() {
    let place = Place::new();
    let modules = r#"[[module]]
name = "laser.0"
builtin = "sim"
settings = { map = "building.map" }
[[module]]
name = "mapper.0"
builtin = "mapper"
calls = ["laser.0", "odometry.0"]
settings = { laser = "laser.0", odometry = "odometry.0" }
[[module]]
name = "odometry.0"
program = "./wheels"
[[module]]
name = "logd.0"
builtin = "logd"
settings = { folder = "recordings" }
[record]
directory = "recordings"
streams = ["laser.0/scna", "mapper.0/pose", "odometry.0/anything", "mapper.0/*"]
data = ["mapper.0/grid", "laser.0/scan"]
"#;
    let said = [
        (16, "module `logd.0`: it has no settings; write `folder` into [record]"),
        (19, "[record]: `laser.0` has no stream `scna`; did you mean `scan`?"),
        (19, "[record]: `mapper.0` has no stream `pose`; these are data, name them in `data`"),
        (20, "[record]: `mapper.0` has no data `grid`; it has map, pose"),
    ];
    let expected = wrong(&place, modules, &said);
    let told = place.say(&["check", "wrong.toml"]).fails();
    assert_eq!(told.trim_end().lines().collect::<Vec<_>>(), expected);
}

#[test]
fn what_a_file_means_can_be_read_by_programs() {
    let place = Place::new();
    // All keys; the builtin mapper does not know its settings.
    let full = include_str!("../../config/tests/full.toml").replace("builtin = \"mapper\"", "program = \"./mapper\"");
    place.write("full.toml", &full);
    let json = place.say(&["check", "full.toml", "--json"]).json();
    assert_eq!((&json["right"], &json["installation"]["name"]), (&true.into(), &"two-computers".into()));
    let base = &json["installation"]["nodes"][0];
    assert_eq!((&base["name"], &base["mode"]), (&"base".into(), &"0770".into()));
    let router = &base["modules"][0];
    assert_eq!((&router["name"], &router["restart"]["policy"]), (&"router.0".into(), &"always".into()), "by itself");
    let installation = &json["installation"];
    assert_eq!(
        (&installation["network"]["port"], &installation["network"]["security"]),
        (&4000.into(), &"none".into())
    );
    assert_eq!(installation["time"]["masters"], serde_json::json!(["desk", "base"]));
    let motor = &base["modules"][1];
    assert_eq!((&motor["name"], &motor["scheduling"]["fifo"]), (&"motor.0".into(), &25.into()));
    assert_eq!(motor["mailboxes"]["commands"]["max_age_ms"], 300.0);
    assert_eq!((&motor["streams"]["scan"]["late_ms"], &motor["streams"]["image"]["keep"]), (&50.0.into(), &8.into()));
    assert_eq!(json["missing_programs"][0]["module"], "motor.0");
    let access = serde_json::json!([
        { "class": "laser", "module": null, "callers": ["mapper"] },
        { "class": null, "module": "motor.0", "callers": ["mapper", "tool"] },
    ]);
    assert_eq!(installation["access"], access);
    let number = |module: &serde_json::Value| module["number"].as_u64().unwrap();
    let system = installation["system"]["id"].as_u64().unwrap();
    assert_eq!(number(motor), system << 24 | motor["priority"].as_u64().unwrap() << 16);
    assert_eq!((&motor["required"], &motor["optional"]), (&true.into(), &false.into()));
    let larger = full.replace("record = \"8 MiB\"\nkeep = 8", "record = \"1 GiB\"\nkeep = 1000000");
    place.write("larger.toml", larger);
    let notes = place.say(&["check", "larger.toml", "--json"]).json()["notes"].to_string();
    assert!(notes.contains("node base needs 1000009.1 GiB of shared memory, and this computer has "), "{notes}");
    // The opposite of its own declaration.
    place.write("sealed.toml", full.replace("security = \"none\"", "security = \"keys\""));
    let json_of_sealed = place.say(&["check", "sealed.toml", "--json"]).json();
    assert_eq!(json_of_sealed["installation"]["network"]["security"], "keys");
    let json = place.say(&["check", "full.toml", "--json", "--node", "desk"]).json();
    assert_eq!(json["installation"]["nodes"].as_array().unwrap().len(), 1, "one node only");
    // People and programs get the same reason why a picture may wait.
    let demo = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/demo.toml");
    let json = place.say(&["check", demo, "--json"]).json();
    let modules = json["installation"]["nodes"][0]["modules"].as_array().unwrap();
    let gui = modules.iter().find(|module| module["name"] == "gui.0").unwrap();
    let calls = gui["calls"].as_array().unwrap();
    let output = calls.iter().find(|call| call["to"] == "output.0").unwrap();
    assert_eq!(output["although"], "a picture may wait");
    assert!(place.say(&["check", demo]).ok().contains("output.0 is less important: a picture may wait"));
}

#[test]
fn a_call_to_a_less_important_module_needs_a_reason() {
    let place = Place::new();
    let config = |call: &str| {
        let module = crate::harness::probe("probe.0", "", &format!("calls = [{call}]"));
        place.config(&[crate::harness::OUTPUT, &module]).to_str().unwrap().to_owned()
    };
    let told = place.say(&["check", &config("\"output.0\"")]).fails();
    assert!(told.contains("`probe.0`, of priority 96, calls `output.0`, of priority 32"), "{told}");
    let remedy = told.split('`').find(|part| part.starts_with("{ to")).unwrap().to_owned();
    place.say(&["check", &config(&remedy)]).ok();
}

#[test]
fn time_slots_are_drawn_and_the_worst_of_each_flow_is_said() {
    let place = Place::new();
    let demo = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/demo-tdma.toml");
    let page = place.say(&["check", demo]).ok();
    let drawn: Vec<&str> = page.lines().filter(|line| line.contains('█')).collect();
    assert!(drawn.iter().all(|line| line.chars().count() <= 80), "{drawn:#?}");
    let owners: Vec<_> = drawn.iter().filter_map(|line| line.split_whitespace().next()).collect();
    assert_eq!(owners, ["sync", "base", "brain", "desk", "█"], "a row each, and what the signs mean");

    let json = place.say(&["check", demo, "--json"]).json();
    let tdma = &json["installation"]["tdma"];
    assert_eq!((&tdma["cycle_ms"], &tdma["slots"][1]["node"]), (&5.0.into(), &"brain".into()));
    let flows = json["installation"]["flows"].as_array().unwrap();
    for flow in flows {
        let worst = flow["at_worst"]["latency_ms"].as_f64().unwrap();
        assert!(worst > 5.0 && worst < flow["deadline_ms"].as_f64().unwrap(), "a cycle at least: {flow}");
        let (from, to) = (flow["from"].as_str().unwrap(), flow["to"].as_str().unwrap());
        let carries = flow["carries"].as_str().unwrap();
        assert!(page.contains(&format!("  {from} → {to} {carries} ")), "{page}");
    }
    let nodes = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/demo-nodes.toml");
    let json = place.say(&["check", nodes, "--json"]).json();
    assert!(json["installation"]["tdma"].is_null(), "it sends as packages come");
}

#[test]
fn a_deadline_that_slots_cannot_keep_is_refused_with_what_would() {
    let place = Place::new();
    let demo = |length: &str| include_str!("../../config/demo-tdma.toml").replacen("\"1.2 ms\"", length, 1);
    place.copy("config/building.map");
    place.write("short.toml", demo("\"450 us\""));
    let told = place.say(&["check", "short.toml"]).fails();
    // Each flow asks for what it needs; the last one waits for all the others.
    let remedies: Vec<&str> = told.lines().filter_map(|line| line.split_once("`length = ")).map(|(_, to)| to).collect();
    assert!(told.contains("lengthen that of `base` at 1 ms (line 47) by") && remedies.len() > 1, "{told}");
    let longest = remedies.iter().map(|remedy| remedy.trim_end_matches('`')).max().unwrap();
    place.write("short.toml", demo(longest));
    place.say(&["check", "short.toml"]).ok();
}
