//! `cargo demo` with a Cargo and a `rohrpost` that are shell scripts: which of them runs when, and what each leaves.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Longest wait for anything, on a busy computer.
const PATIENCE: Duration = Duration::from_secs(60);

/// Builds the bridge as the file `bridge` says, each word a step.
const CARGO: &str = r#"#!/bin/sh
cd "$CARGO_TARGET_DIR"
artifact() { echo "{\"reason\":\"compiler-artifact\",\"package_id\":\"registry+x#$1\",\"fresh\":$2}"; }
case "$*" in
tree*) printf 'rohrpost-gui-bridge v0.1.0\nrerun v0.36.0\nring v0.17.0\nring v0.17.0\n'; exit ;;
*rohrpost-cli*) echo cli >> built; exit ;;
esac
echo bridge >> built
for step in $(cat bridge); do
    case $step in
    found) artifact ring true ;;
    compiles) echo '   Compiling rerun v0.36.0' >&2
        while [ ! -e counted ]; do sleep 0.02; done
        artifact rerun false ;;
    waits) sleep 1000 & echo $! $$ > build.pid; wait ;;
    goes) while [ ! -e go ]; do sleep 0.02; done ;;
    fails) echo 'error: linking failed' >&2; exit 101 ;;
    links) artifact bridge false; echo new > debug/rohrpost-gui-bridge ;;
    ends) echo '    Finished `dev` profile' >&2 ;;
    esac
done
"#;

/// Runs until the file `stop` is there.
const ROHRPOST: &str = r#"#!/bin/sh
here=$CARGO_TARGET_DIR
case $1 in
demo) echo "$PATH" > "$here/path"; echo "$*" > "$here/demo.new"; mv "$here/demo.new" "$here/demo"
    while [ ! -e "$here/stop" ]; do sleep 0.02; done
    exit 5 ;;
start) [ -e "$here/is-up" ] || { echo 'no node runs here' >&2; exit 1; }
    echo "gui.0 runs and is on ($(cat "$here/debug/rohrpost-gui-bridge"))"; echo "$*" > "$here/started" ;;
esac
"#;

/// A target folder with both scripts and a bridge of an earlier build.
struct Stage {
    folder: PathBuf,
}

impl Stage {
    fn new(name: &str, bridge: &str) -> Self {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("demo-{name}"));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(folder.join("debug")).unwrap();
        fs::create_dir_all(folder.join("elsewhere")).unwrap();
        let stage = Self { folder };
        for (path, text) in [("cargo", CARGO), ("debug/rohrpost", ROHRPOST), ("debug/rohrpost-gui-bridge", "old")] {
            fs::write(stage.at(path), text).unwrap();
            fs::set_permissions(stage.at(path), fs::Permissions::from_mode(0o755)).unwrap();
        }
        fs::write(stage.at("elsewhere/rohrpost-gui-bridge"), "installed").unwrap();
        fs::write(stage.at("bridge"), bridge).unwrap();
        stage
    }

    fn at(&self, path: &str) -> PathBuf {
        self.folder.join(path)
    }

    fn text(&self, path: &str) -> String {
        fs::read_to_string(self.at(path)).unwrap_or_default()
    }

    fn put(&self, path: &str) {
        fs::write(self.at(path), "").unwrap();
    }

    fn demo(&self, arguments: &[&str]) -> Child {
        let path = format!("{}:{}", self.at("elsewhere").display(), std::env::var("PATH").unwrap());
        let mut command = Command::new(env!("CARGO_BIN_EXE_xtask"));
        command.arg("demo").args(arguments).current_dir(&self.folder).env("CARGO", self.at("cargo"));
        command.env("CARGO_TARGET_DIR", &self.folder).env("PATH", path);
        command.stdin(Stdio::null()).stderr(fs::File::create(self.at("said")).unwrap()).spawn().unwrap()
    }

    fn log(&self) -> String {
        self.text("gui-bridge-build.log")
    }

    fn last_line(&self) -> String {
        self.log().lines().next_back().unwrap_or_default().to_owned()
    }

    /// Ends the demo. Its exit code is that of the whole.
    fn stop(&self, mut demo: Child) {
        self.put("stop");
        assert_eq!(demo.wait().unwrap().code(), Some(5), "{}", self.text("said"));
    }
}

#[track_caller]
fn wait(what: &str, mut is: impl FnMut() -> bool) {
    let began = Instant::now();
    while !is() {
        assert!(began.elapsed() < PATIENCE, "waited in vain: {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Whether a process runs. One that has ended, and that nobody has collected, does not.
fn runs(pid: &str) -> bool {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    stat.rsplit_once(") ").is_some_and(|(_, rest)| !rest.starts_with(['Z', 'X']))
}

#[test]
fn a_bridge_that_is_there_is_there_from_the_start() {
    let stage = Stage::new("fresh", "found ends");
    let demo = stage.demo(&[]);
    wait("the demo starts", || stage.at("demo").exists());
    assert_eq!(stage.text("demo"), "demo\n");
    assert_eq!(stage.text("debug/rohrpost-gui-bridge"), "old", "it is of the present sources");
    assert_eq!(stage.text("built"), "cli\nbridge\n");
    assert!(!stage.text("said").contains("beside"), "{}", stage.text("said"));
    stage.stop(demo);
}

#[test]
fn the_robot_starts_at_once_and_the_bridge_joins_it() {
    let stage = Stage::new("joins", "found compiles goes links ends");
    let demo = stage.demo(&["--quiet"]);
    wait("the demo starts", || stage.at("demo").exists());
    let said = stage.text("said");
    assert!(said.contains("the robot starts; the GUI bridge with Rerun is built beside it"), "{said}");
    assert!(said.contains("how far that is: gui-bridge-build.log"), "{said}");
    assert_eq!(stage.text("demo"), "demo --quiet --gui-build gui-bridge-build.log\n");
    assert!(!stage.at("debug/rohrpost-gui-bridge").exists(), "a bridge of earlier sources would be started");
    let path = stage.text("path");
    assert!(path.starts_with(stage.at("debug").to_str().unwrap()) && !path.contains("elsewhere"), "{path}");
    stage.put("counted");
    wait("a crate is compiled", || stage.last_line() == "2 of 3 crates");
    assert!(stage.log().starts_with("nice -n 19 "), "{}", stage.log());
    stage.put("go");
    wait("the bridge is linked", || stage.text("debug/rohrpost-gui-bridge") == "new\n");
    // It is tried again until the robot takes orders.
    stage.put("is-up");
    wait("the bridge has joined", || stage.last_line() == "gui.0 runs and is on (new)");
    assert_eq!(stage.text("started"), "start gui.0\n");
    stage.stop(demo);
}

#[test]
fn the_build_ends_with_the_demo() {
    let stage = Stage::new("ends", "compiles waits");
    stage.put("counted");
    let demo = stage.demo(&[]);
    wait("the build waits", || stage.text("build.pid").ends_with('\n'));
    let pids = stage.text("build.pid");
    assert!(stage.at("demo").exists() || runs(&demo.id().to_string()));
    wait("the demo starts", || stage.at("demo").exists());
    assert!(pids.split_whitespace().all(runs), "{pids}");
    stage.stop(demo);
    wait("the build has ended, with all that it had started", || !pids.split_whitespace().any(runs));
    wait("it is told", || stage.last_line().ends_with("the demo has ended, and the build with it: 1 of 3 crates"));
    assert_eq!(stage.text("started"), "", "nothing is started in a robot that has ended");
}

#[test]
fn a_demo_that_is_killed_leaves_no_build() {
    let stage = Stage::new("killed", "compiles waits");
    stage.put("counted");
    let mut demo = stage.demo(&[]);
    wait("the build waits", || stage.text("build.pid").ends_with('\n'));
    let pids = stage.text("build.pid");
    demo.kill().unwrap();
    demo.wait().unwrap();
    wait("the build has ended", || !pids.split_whitespace().any(runs));
}

#[test]
fn a_build_that_fails_says_why_and_the_robot_runs() {
    for (name, steps) in [("fails", "compiles fails"), ("fails-at-once", "fails")] {
        let stage = Stage::new(name, steps);
        stage.put("counted");
        let demo = stage.demo(&[]);
        wait("the demo starts", || stage.at("demo").exists());
        wait("the failure is told", || stage.last_line().starts_with("the build failed: "));
        assert!(stage.log().contains("error: linking failed"), "{}", stage.log());
        assert!(stage.last_line().contains("exit status: 101"), "{}", stage.log());
        assert!(!stage.at("debug/rohrpost-gui-bridge").exists(), "{name}: nobody knows which sources it is of");
        stage.stop(demo);
    }
}

#[test]
fn a_demo_that_ends_by_itself_has_its_bridge_first() {
    let stage = Stage::new("first", "found compiles links ends");
    stage.put("counted");
    stage.put("stop");
    let mut demo = stage.demo(&["--seconds", "3"]);
    assert_eq!(demo.wait().unwrap().code(), Some(5));
    assert_eq!(stage.text("demo"), "demo --seconds 3\n");
    assert_eq!(stage.text("debug/rohrpost-gui-bridge"), "new\n");
    let said = stage.text("said");
    assert!(said.contains("\n    2 of 3 crates\n") && said.contains("\n    3 of 3 crates\n"), "no terminal: {said}");
    assert!(!said.contains("1 of 3 crates"), "what was found is not told as work: {said}");
    assert!(!said.contains("minute"), "{said}");
}

#[test]
fn without_a_gui_no_bridge_is_built() {
    let stage = Stage::new("without", "fails");
    stage.put("stop");
    let mut demo = stage.demo(&["--no-gui"]);
    assert_eq!(demo.wait().unwrap().code(), Some(5));
    assert_eq!(stage.text("built"), "cli\n");
    assert_eq!(stage.text("demo"), "demo --no-gui\n");
}
