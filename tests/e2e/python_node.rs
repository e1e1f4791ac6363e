//! Modules in Python on the node: the gripper of the book beside a simulated robot, and what goes wrong in Python.

use crate::harness::{Place, Robot, assert_has, head, json_lines, python, repository, signal, until};
use crate::process::Running;
use nix::sys::signal::Signal;
use std::os::unix::fs::symlink;
use std::path::PathBuf;

const FAULTY: &str = include_str!("python/faulty.py");
const MEDDLING: &str = include_str!("python/meddling.py");
/// Streams of the faulty program, with room for records that lie in place.
const STREAMS: &str = "[module.stream.wide]\nrecord = \"64 KiB\"\n[module.stream.object]\nrecord = \"64 KiB\"\n";
const OVER: &str = "of it: BufferError: the record of these bytes is in hand no more";
const PAGE: &str = include_str!("../../docs/src/python.md");
const CLASSES: &str = "motor 200, odometry 160, laser 150, camera 120, gripper 110, output 32, tool 16";
const CONFIG: &str = r#"
[nodes.main]
[[module]]
name = "output.0"
builtin = "output"
[[module]]
name = "gripper.0"
program = "./gripper.py"
calls = ["motor.0", "odometry.0", "camera.0"]
settings = { SETTINGS }
[module.stream.edge]
record = "1 MiB"
STREAMS
[[module]]
name = "motor.0"
aliases = ["odometry.0", "laser.0", "camera.0"]
builtin = "sim"
settings = { map = MAP, seed = 1, odometry-rate-hz = 20, camera-rate-hz = 20 }
[module.stream.image]
record = "1 MiB"
"#;

/// A robot with a gripper in Python. Dropped in this order.
struct Scene {
    launch: Running,
    robot: Robot,
    place: Place,
}

/// The package with its part in Rust, which Cargo has put beside this program.
pub(crate) fn package(place: &Place) -> PathBuf {
    let library = std::env::current_exe().unwrap().with_file_name("lib_node.so");
    let (path, sources) = (place.path("package"), repository("clients/python/src/rohrpost"));
    std::fs::create_dir_all(path.join("rohrpost")).unwrap();
    for entry in std::fs::read_dir(sources).unwrap().map(|entry| entry.unwrap()) {
        symlink(entry.path(), path.join("rohrpost").join(entry.file_name())).unwrap();
    }
    symlink(library, path.join("rohrpost/_node.abi3.so")).unwrap();
    path
}

/// With a section for each stream that this program has.
fn configured(map: &str, settings: &str, code: &str) -> String {
    let streams = if code == FAULTY { STREAMS } else { "" };
    head(CLASSES) + &CONFIG.replace("MAP", map).replace("SETTINGS", settings).replace("STREAMS", streams)
}

/// The book's gripper.
fn gripper() -> &'static str {
    PAGE.split("```python gripper.py\n").nth(1).unwrap().split("```").next().unwrap()
}

impl Scene {
    /// Launches it with this code, and settings of the gripper.
    fn launched(code: &str, settings: &str) -> Self {
        let place = Place::new();
        let package = package(&place);
        let map = format!("{:?}", repository("config/building.map"));
        let config = place.write("robot.toml", configured(&map, settings, code));
        place.program("gripper.py", code);
        let mut command = place.command(&["launch", config.to_str().unwrap()]);
        // Beside the sources nothing is to be written.
        command.env("PYTHONPATH", package).env("PYTHONDONTWRITEBYTECODE", "1");
        let mut launch = Running::start(command);
        let robot = place.robot(&config, "main", &mut launch);
        Self { launch, robot, place }
    }

    fn with_gripper() -> Self {
        let mut scene = Self::launched(gripper(), "speed-m-s = 0.06");
        scene.robot.wait_on(&mut scene.launch);
        scene
    }

    fn says(&self, arguments: &[&str]) -> crate::process::Said {
        self.place.say(arguments)
    }

    fn written(&self, stream: &str) -> u64 {
        let told = self.says(&["stream", "info", "gripper.0", stream, "--json"]).json();
        told["written"].as_u64().unwrap_or(0)
    }

    fn stop(mut self) {
        drop(self.robot);
        self.launch.stop();
        self.place.assert_empty();
    }
}

#[test]
fn the_gripper_of_the_book_is_a_module_like_any_other() {
    let scene = Scene::with_gripper();
    scene.says(&["list", "--json"]).ok_with(["\"gripper.0\""]);
    assert!(scene.says(&["status", "gripper.0"]).ok().contains("\ngripper.0  on "));
    assert_eq!(scene.says(&["call", "gripper.0", "close", "4"]).ok(), "{width_m: 0.02, force_n: 4}\n");
    let refused = scene.says(&["call", "gripper.0", "close", "40"]);
    assert_eq!(
        (refused.code, refused.out.trim()),
        (Some(1), "gripper.0 answers with an error: \"more than 20 N break it\"")
    );
    let said = scene.says(&["call", "gripper.0"]).ok();
    assert_has(
        &said,
        ["Holds things, and stops the robot while it takes them.", "close <force_n: f64>", "How it holds now."],
    );
    let held = scene.says(&["echo", "gripper.0", "grip", "--count", "1"]).ok();
    assert!(held.ends_with("{width_m: 0.02, force_n: 4}\n"), "{held}");
    // Parameters: as configured, set, and refused.
    assert_eq!(scene.says(&["param", "get", "gripper.0", "speed-m-s", "--json"]).json()[0]["value"], 0.06);
    assert_eq!(
        scene.says(&["param", "set", "gripper.0", "speed-m-s", "0.1"]).ok(),
        "gripper.0 speed-m-s: 0.06 -> 0.1 m/s\n"
    );
    assert!(scene.says(&["param", "set", "gripper.0", "speed-m-s", "0.3"]).fails().contains("out of range: 0..=0.2"));
    // It reads the camera's stream in place, and writes its own in place, which a tool in Rust reads.
    until("it has seen pictures", || scene.written("edge") > 3);
    let edge = scene.says(&["stream", "read", "gripper.0", "edge"]).ok();
    assert!(edge.contains("height_px: 16") && edge.contains("Rgb8"), "{edge}");
    // Killed, it is started again, and its stream goes on.
    let (pid, before) = (scene.robot.pid("gripper.0"), scene.written("edge"));
    signal(pid, Signal::SIGKILL);
    scene.robot.wait_restarted("gripper.0", pid);
    assert_eq!(scene.says(&["call", "gripper.0", "close", "5"]).ok(), "{width_m: 0.02, force_n: 5}\n");
    until("it sees pictures again", || scene.written("edge") > before);
    for (order, state) in [("off", "off"), ("on", "on")] {
        scene.says(&["call", "gripper.0", order]).ok();
        assert_eq!(scene.robot.state("gripper.0"), state);
    }
    scene.stop();
}

/// What a command answers, as text.
fn answers(scene: &Scene, command: &str) -> String {
    scene.says(&["call", "--json", "gripper.0", command]).ok()
}

#[test]
fn what_fails_in_python_puts_the_module_in_error_with_its_text_and_line() {
    let mut scene = Scene::launched(FAULTY, "mood = \"good\"");
    scene.robot.wait_on(&mut scene.launch);
    let line = |of: &str| FAULTY.lines().position(|line| line.contains(of)).unwrap() + 1;
    let again = || {
        scene.says(&["call", "gripper.0", "off"]).ok();
        scene.says(&["call", "gripper.0", "on"]).ok();
    };
    // Functions that others call.
    for (words, told) in [
        (&["fail", "broken"][..], format!("RuntimeError: broken (./gripper.py:{})", line("raise RuntimeError(why)"))),
        (
            &["fail", "missing"],
            format!(
                "FileNotFoundError: [Errno 2] No such file or directory: '/no/such/file' (./gripper.py:{})",
                line("open(\"/no/such/file\")")
            ),
        ),
        (&["leave"], format!("SystemExit: 3 (./gripper.py:{})", line("sys.exit(3)"))),
        (&["wrong"], "the result of `wrong` cannot be written: 300 is out of range: u8 is 0 to 255".into()),
    ] {
        let told = told.replace("./", scene.place.path("").to_str().unwrap());
        scene.says(&[&["call", "gripper.0"], words].concat()).fails_with([&format!("the module is in error: {told}")]);
        let status = scene.says(&["status", "gripper.0"]).out;
        assert!(status.contains("error") && status.contains(&told), "{status}");
        again();
    }
    // Lines have the number of the kernel's error that they tell of.
    let lines = scene.says(&["log", "--module", "gripper.0", "--json"]).ok();
    let lines = json_lines(&lines);
    for (errno, words) in [(2, "FileNotFoundError: "), (28, "no room: [Errno 28] No space left on device")] {
        let told = lines.iter().find(|line| line["text"].as_str().unwrap().starts_with(words));
        assert_eq!(told.map(|line| &line["errno"]), Some(&errno.into()), "{lines:?}");
    }
    // Those that run with a picture; a view that is kept.
    for (order, told) in [("fail", "RuntimeError: it is dark ("), ("keep", "Misuse: a view of record ")] {
        scene.says(&["call", "gripper.0", "order", order]).ok();
        until(format!("it is in error: {order}"), || scene.robot.state("gripper.0") == "error");
        let status = scene.says(&["status", "gripper.0"]).out;
        assert!(status.contains(told), "{status}");
        again();
    }
    scene.says(&["param", "set", "gripper.0", "gain", "7"]).fails_with(["the module refuses: not seven"]);
    assert_eq!(scene.says(&["param", "get", "gripper.0", "gain", "--json"]).json()[0]["value"], 2);
    assert_eq!(answers(&scene, "gains").trim(), "2", "the module has its old value again");
    // It still sees.
    let seen: u32 = answers(&scene, "sees").trim().parse().unwrap();
    until("it sees", || answers(&scene, "sees").trim().parse::<u32>().unwrap() > seen);
    scene.stop();
}

#[test]
fn threads_forks_and_the_end_are_told_by_exceptions() {
    let mut scene = Scene::launched(FAULTY, "mood = \"good\"");
    scene.robot.wait_on(&mut scene.launch);
    let own = "for a module's own functions, in its own thread, while it runs";
    assert!(answers(&scene, "elsewhere").contains(own), "{}", answers(&scene, "elsewhere"));
    let forked = answers(&scene, "forked");
    let (no_part, runs) = ("this process was forked from a module's", "a module runs in this process");
    assert!(forked.matches(no_part).count() == 2 && forked.matches(runs).count() == 2, "{forked}");
    assert_has(&forked, ["locks: 0, its parent's: True", "goes on: True"]);
    assert_eq!(answers(&scene, "strayed").trim(), "70", "a child that comes back is ended");
    let calls = answers(&scene, "calls");
    assert_has(
        &calls,
        [
            "stale: no exception, but None",
            "has no function `fly`; it has: drive, halt",
            "BadArguments: the arguments cannot be written: speed_m_s: expected a number (f64), got `fast`",
            "FunctionError: NotFinite",
            "Misconfigured: ",
            "Misuse: Remembered.grip: value: expected a number (f64), got `wide`",
            "Misuse: Remembered has no data `grab`; it has: grip",
            "but it is opened for {x_m: f64, y_m: f64, heading_rad: f64}",
            "is no stream; follow it as data",
            "is not filled in place",
        ],
    );
    scene.says(&["call", "gripper.0", "hears", "tick"]).ok();
    until("it hears", || answers(&scene, "heard_word").contains("tick, Misuse: -1 is no open"));
    let notes = answers(&scene, "notes");
    assert_has(
        &notes,
        ["Misuse: a record is being filled", "RuntimeError: no", "Misuse: a view of a record of `wide` that is", OVER],
    );
    scene.says(&["stream", "read", "gripper.0", "note"]).ok_with(["{words: \"filled\", more: [97, 98, 99, 100]}"]);
    assert_eq!((scene.written("note"), scene.written("wide"), scene.written("object")), (2, 0, 1));
    let looks = answers(&scene, "looks");
    assert_has(
        &looks,
        [
            "memoryview of ",
            "leave its `with` before",
            "ValueError: operation forbidden",
            "the same: True",
            "in between: Image, bytes of ",
            "half way: True",
            "was opened in another thread",
        ],
    );
    // `around`, `at` and `interpolated` of the present epoch, of this one, and of the next one: however far the records
    // are apart, of those that are too far apart, and of those that are just not.
    let (free, apart) = ("there, there, other epoch", "gap, gap, other epoch");
    let told: Vec<String> = serde_json::from_str(&looks).unwrap();
    let told: Vec<&str> = told.iter().map(String::as_str).filter(|line| line.ends_with("other epoch")).collect();
    assert_eq!(told, [free, free, free, free, apart, apart, free, free, free]);
    scene.stop();
}

#[test]
fn a_view_that_outlives_its_record_is_told_and_leads_nowhere_else() {
    let mut scene = Scene::launched(FAULTY, "mood = \"good\"");
    scene.robot.wait_on(&mut scene.launch);
    let keeps = answers(&scene, "keeps");
    assert_has(
        &keeps,
        [
            "slice: Misuse: a view of record ",
            "still there: True",
            "whole: Misuse: a view of record ",
            "failed: ValueError: its own",
            "object: no exception, but None",
            OVER,
            "circle: no exception, but None",
            "write: TypeError: cannot modify read-only memory",
            "twice: Misuse: a record of `image` of camera.0 is in hand; leave its `with` before another is read",
            "again: Record(value=Image(width_px=",
            "picky 0: BadReply: ",
            "picky 1: BadReply: ",
            "`odometry` of odometry.0: its class does not take it: ValueError: too far",
            "laser: dict",
            "meanwhile: {'Misuse: `image` of camera.0 was opened in another thread, that of its module, which alone \
         may read it'}",
        ],
    );
    scene.stop();
}

#[test]
fn a_record_is_let_go_by_its_own_with_alone_and_by_that_for_sure() {
    let mut scene = Scene::launched(MEDDLING, "mood = \"good\"");
    scene.robot.wait_on(&mut scene.launch);
    let in_hand = "Misuse: a record of `odometry` of odometry.0 is in hand; leave its `with`";
    let not_in_hand = "Misuse: this `with` has no record of `odometry` of odometry.0 in hand";
    let meddles = answers(&scene, "meddles");
    assert_has(
        &meddles,
        [
            &format!("exit: {not_in_hand}"),
            &format!("enter: {in_hand}"),
            "read: Meddling",
            &format!("other: {not_in_hand}"),
            &format!("still: {in_hand}"),
            "thread: Misuse: `odometry` of odometry.0 was opened in another thread",
            &format!("over: {not_in_hand}"),
            "left: SystemExit: at once",
            "equal: True, False",
            "stale: Misuse: the record of `odometry` of odometry.0 that was found is gone",
        ],
    );
    let keeps = answers(&scene, "keeps");
    assert_has(
        &keeps,
        [
            "hoarded: Misuse: a view of record ",
            "failed: ValueError: its own, collected 0 times",
            "circle: Misuse: a view of record ",
            "`numpy.array(…)`, collected 1 times",
            "collected: no exception, but None",
        ],
    );
    assert!(answers(&scene, "circles").contains("reader: None"), "{}", answers(&scene, "circles"));
    scene.stop();
}

#[test]
fn by_hand_it_says_why_it_does_not_start_and_ends_by_control_c() {
    let place = Place::new();
    let (package, config) = (package(&place), place.path("robot.toml"));
    place.write("gripper.py", FAULTY);
    let started = |settings: &str, arguments: &[&str]| {
        std::fs::write(&config, configured("\"no.map\"", settings, FAULTY)).unwrap();
        let mut command = python(&place, &[&["gripper.py"], arguments].concat());
        command.env("PYTHONPATH", &package);
        Running::start(command)
    };
    let named = ["--config", config.to_str().unwrap(), "--name", "gripper.0"];
    for (settings, arguments, code, told) in [
        ("mood = \"good\"", &named[..2], 2, "which module of it?"),
        ("mod = \"good\"", &named[..], 78, "it has no setting `mod`; it has gain, mood"),
        ("mood = \"good\", gain = 11", &named[..], 78, "`gain` is 11, out of range: at most 9"),
        ("", &named[..], 1, "KeyError: 'mood'"),
    ] {
        let settings = if settings.is_empty() { "gain = 1" } else { settings };
        let said = started(settings, arguments).said();
        assert!(said.code == Some(code) && said.err.contains(told), "{told}: {said:?}");
    }
    let mut module = started("mood = \"good\"", &named);
    until("it is on", || {
        module.assert_runs();
        place.say_at(&config, "main", &["status", "gripper.0"]).out.contains("\ngripper.0  on ")
    });
    module.signal(Signal::SIGINT);
    let said = module.said();
    assert!(said.code == Some(0) && said.err.contains("safe, in a mood that is good"), "{said:?}");
    assert!(said.out.contains("Misuse: this is for a module's own functions"), "{said:?}");
}
