//! `rohrpost new`: its project is built, tested, launched and called, as its README says.

use crate::harness::{Place, python, until, wait};
use crate::python_node::package;
use std::path::{Path, PathBuf};
use std::process::Command;

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// Cargo in the new project, without the network. It builds into the folder and by the profile of this workspace, so
/// that nothing is compiled twice.
fn cargo(project: &Path, command: &str) -> Command {
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    // The target folder is reached as `target`, so that robot.toml finds the program where it looks for it.
    cargo.current_dir(project).env_remove("CARGO_TARGET_DIR").args([command, "--offline", "--quiet"]);
    // As strangers have it; the checks of this workspace compile with clippy.
    cargo.env_remove("RUSTC_WORKSPACE_WRAPPER");
    for setting in ["profile.dev.debug=\"line-tables-only\"", "profile.dev.package.\"*\".debug=false"] {
        cargo.args(["--config", setting]);
    }
    cargo
}

/// Makes a project, builds it, and runs its own test.
fn made_and_tested(place: &Place, words: &[&str]) -> PathBuf {
    place.say(&[&["new"], words].concat()).ok_with(["cargo build && rohrpost launch robot.toml"]);
    let project = place.path(words[0]);
    compile_what_the_readme_writes(&project);
    // The versions that are here already.
    std::fs::copy(Path::new(ROOT).join("Cargo.lock"), project.join("Cargo.lock")).unwrap();
    // target/debug/deps/e2e-…
    let target = std::env::current_exe().unwrap().ancestors().nth(3).unwrap().to_owned();
    std::os::unix::fs::symlink(&target, project.join("target")).unwrap();
    let tested = cargo(&project, "test").env("ROHRPOST_DIR", place.memory()).output().unwrap();
    assert!(tested.status.success(), "{tested:?}");
    assert!(String::from_utf8_lossy(&tested.stdout).contains("1 passed"), "{tested:?}");
    let built = cargo(&project, "build").output().unwrap();
    assert!(built.status.success(), "{built:?}");
    project
}

/// The lines of Rust in the project's README, as a function of its library.
fn compile_what_the_readme_writes(project: &Path) {
    let read = |file: &str| std::fs::read_to_string(project.join(file)).unwrap();
    let readme = read("README.md");
    let blocks = readme.split("```rust\n").skip(1).map(|block| block.split("```").next().unwrap());
    // What `new` stores, `received` has.
    let written = blocks.collect::<String>().replace("self.", "");
    assert!(written.contains("context.subscribe"), "{readme}");
    let function = format!(
        "\n/// What the README writes.\n#[allow(unused_variables)]\npub fn as_the_readme_says(\n    context: &mut \
         Context,\n    data: &rohrpost::Received<'_>,\n) -> Result<(), ModuleError> {{\n{written}\nOk(())\n}}\n"
    );
    std::fs::write(project.join("src/lib.rs"), read("src/lib.rs") + &function).unwrap();
}

/// Build products of a removed project are useless.
fn clean(project: &Path, name: &str) {
    let cleaned = cargo(project, "clean").args(["--package", name]).output().unwrap();
    assert!(cleaned.status.success(), "{cleaned:?}");
}

#[test]
fn a_new_camera_writes_pictures_of_1080_rows_in_place() {
    let place = Place::new();
    let project = made_and_tested(&place, &["eye", "--camera"]);
    let config = project.join("robot.toml");
    place.say(&["check", config.to_str().unwrap()]).ok_with(["image"]);
    let mut launch = place.launch(&config);
    let robot = place.robot(&config, "main", &mut launch);
    until("eye.0 is on", || {
        launch.assert_runs();
        robot.state("eye.0") == "on"
    });
    wait("it writes pictures", || {
        let listed = place.say(&["stream", "info", "eye.0", "1", "--json"]).json();
        (listed["written"].as_u64()? > 3).then_some(())
    });
    let picture = place.path("picture");
    place.say(&["stream", "read", "eye.0", "1", "--raw", picture.to_str().unwrap()]).ok();
    // Sizes, format and length, and three bytes a pixel.
    let bytes = std::fs::metadata(picture).unwrap().len();
    assert!((1920 * 1080 * 3..1920 * 1080 * 3 + 32).contains(&bytes), "{bytes}");
    place.end(&mut launch);
    clean(&project, "eye");
}

#[test]
fn a_new_project_builds_runs_and_has_a_test_that_passes() {
    let place = Place::new();
    let project = made_and_tested(&place, &["wind-vane"]);
    let config = project.join("robot.toml");
    place.say(&["check", config.to_str().unwrap()]).ok();
    let mut launch = place.launch(&config);
    let robot = place.robot(&config, "main", &mut launch);
    until("wind-vane.0 is on", || {
        launch.assert_runs();
        robot.state("wind-vane.0") == "on"
    });
    place.say(&["call", "wind-vane.0"]).ok_with(["restart <from: u64> -> u64", "The present count."]);
    place.say(&["call", "wind-vane.0", "restart", "1000"]).ok();
    let count = place.say(&["echo", "wind-vane.0", "count", "--count", "1", "--json"]).json();
    assert!(count["value"].as_u64().unwrap() > 1000, "{count}");
    assert!(place.say(&["log"]).ok().contains("counts 10 times a second"));
    // Its parameter, as the README there changes it.
    place.say(&["param", "get", "wind-vane.0"]).ok_with(["rate-hz", "Hz    0.1..=1000  Counts a second."]);
    let set = place.say(&["param", "set", "wind-vane.0", "rate-hz", "200"]).ok();
    assert_eq!(set, "wind-vane.0 rate-hz: 10 -> 200 Hz\n");
    place.say(&["param", "set", "wind-vane.0", "rate-hz", "0"]).fails_with(["out of range: 0.1..=1000 Hz"]);
    // At ten a second it could not have counted so far in this time.
    let counted = || place.say(&["call", "wind-vane.0", "get", "count", "--json"]).json().as_u64().unwrap();
    let (first, began) = (counted(), std::time::Instant::now());
    until("it counts at the new rate", || {
        let elapsed_s = began.elapsed().as_secs_f64();
        (counted() - first) as f64 > 20.0 + 15.0 * elapsed_s
    });
    place.end(&mut launch);
    clean(&project, "wind-vane");
}

#[test]
fn nothing_that_is_there_is_written_over() {
    let place = Place::new();
    std::fs::create_dir(place.path("arm")).unwrap();
    place.write("arm/notes", "mine");
    place.say(&["new", "arm"]).fails_with(["arm is not empty; name another folder with --path DIR"]);
    assert_eq!(std::fs::read_dir(place.path("arm")).unwrap().count(), 1);
    place.say(&["new", "arm", "--path", "arm/notes"]).fails_with(["arm/notes: Not a directory"]);
    place.say(&["new", "Arm"]).fails_with(["a letter first: `arm`"]);
    let said = place.say(&["new", "arm", "--path", "here", "--rohrpost", "arm"]);
    said.fails_with(["arm holds no sources of Rohrpost; say where they are with --rohrpost DIR"]);
    assert!(!place.path("here").exists());
    place.say(&["new", "arm", "--path", "deep/er", "--rohrpost", ROOT]).ok();
    assert!(place.path("deep/er/src/lib.rs").exists());
}

#[test]
fn a_new_project_in_python_runs_and_has_a_test_that_passes() {
    let place = Place::new();
    place.say(&["new", "wind-vane", "--python"]).ok_with(["  cd wind-vane\n  rohrpost launch robot.toml\n"]);
    let package = package(&place);
    let programs = Path::new(env!("CARGO_BIN_EXE_rohrpost")).parent().unwrap().to_owned();
    let path =
        std::env::join_paths([programs].into_iter().chain(std::env::split_paths(&std::env::var_os("PATH").unwrap())));
    let mut tests = python(&place, &["-m", "unittest"]);
    tests.current_dir(place.path("wind-vane")).env("PYTHONPATH", package).env("PATH", path.unwrap());
    tests.env("PYTHONDONTWRITEBYTECODE", "1");
    let tested = tests.output().unwrap();
    assert!(tested.status.success(), "{tested:?}");
    assert!(String::from_utf8_lossy(&tested.stderr).contains("Ran 1 test"), "{tested:?}");
    place.say(&["new", "eye", "--python", "--camera"]);
    assert!(!place.path("eye").exists());
}
