//! Optional modules that lack their programs when launch begins: left out, and started when the programs are there.

use crate::harness::{OUTPUT, Place, Robot, probe, signal, until};
use crate::process::Running;
use crate::terminal::Terminal;
use nix::sys::signal::Signal;
use std::fs;
use std::path::{Path, PathBuf};

/// A probe with a program of this name in place of this test's path.
fn late(name: &str, program: &str) -> String {
    let me = std::env::current_exe().unwrap();
    probe(name, "", "optional = true").replace(&format!("{me:?}"), &format!("{program:?}"))
}

/// The program appears.
fn build(path: &Path) {
    std::os::unix::fs::symlink(std::env::current_exe().unwrap(), path).unwrap();
}

/// A folder that is on PATH for what [`launch`] starts.
fn on_path(place: &Place) -> PathBuf {
    place.path("installed")
}

fn launch(modules: &[&str]) -> (Place, Running, Robot) {
    let place = Place::new();
    fs::create_dir(on_path(&place)).unwrap();
    let config = place.config(modules);
    let mut command = place.command(&["launch", config.to_str().unwrap()]);
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders = std::iter::once(on_path(&place)).chain(std::env::split_paths(&path));
    command.env("PATH", std::env::join_paths(folders).unwrap());
    let mut launch = Running::start(command);
    let robot = place.robot(&config, "main", &mut launch);
    (place, launch, robot)
}

fn assert_left_out(place: &Place, module: &str) {
    let list = place.say(&["list", "--json"]).json();
    let line = list["modules"].as_array().unwrap().iter().find(|line| line["module"] == module).unwrap();
    assert_eq!((&line["state"], &line["error"]), (&"stopped".into(), &"left out: its program is missing".into()));
    let top = place.say(&["top", "--json", "--interval", "0.1"]).out;
    assert!(top.contains("left out: its program is missing"), "{top}");
    place.say(&["status"]).ok();
}

#[test]
fn a_module_that_was_left_out_starts_when_its_program_is_there() {
    for (program, file, place_told) in [
        ("./late", "late", "`./late` is no program at "),
        ("rohrpost-late", "installed/rohrpost-late", "`rohrpost-late` is neither in "),
    ] {
        let (place, mut launch, robot) = launch(&[OUTPUT, &late("probe.1", program), &probe("probe.0", "", "")]);
        until("probe.0 is on", || robot.state("probe.0") == "on");
        launch.wait_for("the module is left out, since it is optional");
        launch.wait_for("runs: 2 modules");
        assert_left_out(&place, "probe.1");
        for order in ["start", "restart"] {
            place.say(&[order, "probe.1"]).fails_with([&format!("probe.1 is not started: for launch {place_told}")]);
        }
        place.say(&["stop", "probe.1"]).fails_with(["probe.1 is left out and never ran, since its program is missing"]);
        assert!(place.say(&["call", "probe.1", "count", "1"]).fails().contains("`rohrpost start probe.1` starts it"));
        // A file that nobody may execute is no program.
        place.write(file, "");
        place.say(&["start", "probe.1"]).fails();
        assert_left_out(&place, "probe.1");
        fs::remove_file(place.path(file)).unwrap();

        build(&place.path(file));
        place.say(&["start", "probe.1"]).ok_with(["probe.1 runs and is on"]);
        launch.wait_for("probe.1 was left out and is started, as asked: its program is there now");
        assert_eq!(place.say(&["call", "probe.1", "count", "1"]).ok(), "1\n");
        assert!(place.say(&["start", "probe.1"]).fails().contains("probe.1 runs already"));
        // From now on it is a module like others.
        assert_eq!(robot.kill("probe.1").restarts, 1);
        place.say(&["stop", "probe.1"]).ok();
        assert!(place.say(&["stop", "probe.1"]).fails().contains("probe.1 is stopped already"));
        place.say(&["restart", "probe.1"]).ok();
        place.end(&mut launch);
    }
}

#[test]
fn a_node_of_which_all_is_left_out_waits_for_its_programs() {
    let (place, mut launch, _robot) = launch(&[&late("probe.1", "./late"), &late("probe.0", "./later")]);
    launch.wait_for("runs: 0 modules");
    assert_left_out(&place, "probe.1");
    build(&place.path("late"));
    place.say(&["restart", "probe.1"]).ok_with(["probe.1 runs and is on"]);
    assert_left_out(&place, "probe.0");
    place.end(&mut launch);
}

#[test]
fn a_program_that_disappears_while_its_module_runs_is_no_reason_to_leave_it_out() {
    let module = late("probe.1", "./late").replace("optional", "restart = \"never\"\noptional");
    let (place, mut launch, robot) = launch(&[&module, &probe("probe.0", "", "")]);
    launch.wait_for("runs: 1 module");
    build(&place.path("late"));
    place.say(&["start", "probe.1"]).ok();
    fs::remove_file(place.path("late")).unwrap();
    signal(robot.pid("probe.1"), Signal::SIGKILL);
    launch.wait_for("probe.1 was killed by signal 9");
    place.say(&["start", "probe.1"]).fails_with(["probe.1 is not started: for launch `./late` is no program at "]);
    launch.stop_failed();
    assert!(launch.err().contains("probe.1 failed for good: was killed by signal 9"), "{}", launch.err());
}

#[test]
fn start_and_restart_say_at_once_why_a_program_does_not_run() {
    let policy = "restart = { policy = \"on-failure\", backoff = \"10 min\", within = \"1 h\" }\noptional";
    let module = late("probe.1", "./late").replace("optional", policy);
    let (place, mut launch, robot) = launch(&[&module, &probe("probe.0", "", "")]);
    launch.wait_for("runs: 1 module");
    build(&place.path("late"));
    place.say(&["start", "probe.1"]).ok();
    let pid = robot.pid("probe.1");
    fs::remove_file(place.path("late")).unwrap();
    place.say(&["restart", "probe.1"]).fails_with(["probe.1 is not started: for launch `./late` is no program at "]);
    assert_eq!(robot.pid("probe.1"), pid, "it goes on");
    // The kernel looks for the interpreter, and nobody before.
    place.program("late", "#!/nowhere/python\n");
    for order in ["restart", "start"] {
        let told = place.say(&[order, "probe.1"]).fails();
        assert!(told.contains("probe.1 is not started: it could not be started: "), "{order}: {told}");
        assert!(told.contains("No such file") && told.contains("launch tries again"), "{order}: {told}");
    }
    fs::remove_file(place.path("late")).unwrap();
    build(&place.path("late"));
    assert!(place.say(&["start", "probe.1"]).ok().contains("probe.1 runs and is on"));
    launch.stop();
}

/// What `cargo demo` does: the GUI's program is built beside the robot.
#[test]
fn a_demo_shows_how_far_its_gui_is_until_that_joins() {
    let place = Place::new();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config");
    let demo = fs::read_to_string(folder.join("demo.toml")).unwrap();
    let demo = demo.replace("program = \"rohrpost-gui-bridge\"", "program = \"../late\"");
    fs::create_dir(place.path("config")).unwrap();
    place.write("config/demo.toml", demo);
    fs::copy(folder.join("building.map"), place.path("config/building.map")).unwrap();
    place.write("build.log", "nice cargo build\n12 of 433 crates\n");
    let said = place.say(&["demo", "--quiet", "--seconds", "0.1", "--gui-build", "build.log"]).ok();
    assert!(said.contains("\nGUI bridge: 12 of 433 crates (build.log)\n"), "why there is no drawing: {said}");

    let (terminal, mut demo) = Terminal::start(&place, &["demo", "--gui-build", "build.log"], 30, 120);
    terminal.wait_screen("how far it is", |screen| screen.contains("GUI bridge: 12 of 433 crates (build.log)"));
    place.write("build.log", "13 of 433 crates\n14 of");
    terminal.wait_screen("that it goes on", |screen| screen.contains("GUI bridge: 13 of 433 crates (build.log)"));
    // No module, but a program; it is never ready.
    place.program("late", "#!/bin/sh\nexec sleep 1000\n");
    place.say(&["start", "gui.0", "--no-wait"]).ok();
    terminal.wait_screen("that it has joined", |screen| {
        !screen.contains("GUI bridge") && screen.contains("gui.0 was left out and is started")
    });
    demo.signal(Signal::SIGINT);
    demo.end();
}
