//! Modules in Python on the node: the gripper of the book beside a simulated robot, and what goes wrong in Python.

use crate::harness::{Place, Robot, signal, wait};
use crate::process::Running;
use nix::sys::signal::Signal;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::Command;

const PAGE: &str = include_str!("../../docs/src/python-node.md");
const CONFIG: &str = r#"
installation = "test"
[system]
name = "robot"
id = 1
[classes]
motor = { id = 200 }
odometry = { id = 160 }
laser = { id = 150 }
camera = { id = 120 }
gripper = { id = 110 }
output = { id = 32 }
tool = { id = 16 }
[scheduling]
real-time-from = 256
[nodes.main]
[[module]]
name = "output.0"
builtin = "output"
settings = { file = "log" }
[[module]]
name = "gripper.0"
program = "./gripper.py"
calls = ["motor.0", "odometry.0", "camera.0"]
settings = { SETTINGS }
[module.stream.edge]
record = "1 MiB"
[[module]]
name = "motor.0"
aliases = ["odometry.0", "laser.0", "camera.0"]
builtin = "sim"
settings = { map = MAP, seed = 1, odometry-rate-hz = 20, camera-rate-hz = 20 }
"#;

/// A robot with a gripper in Python. Dropped in this order.
struct Scene {
    launch: Running,
    robot: Robot,
    place: Place,
}

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

/// The package with its part in Rust, which is built by the profile of this workspace.
fn package(place: &Place) -> PathBuf {
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.args(["build", "--offline", "--quiet", "--package", "rohrpost-python"]).current_dir(repository());
    let built = cargo.output().unwrap();
    assert!(built.status.success(), "{built:?}");
    // target/debug/deps/e2e-…
    let library = std::env::current_exe().unwrap().ancestors().nth(2).unwrap().join("lib_node.so");
    let (path, sources) = (place.path("package"), repository().join("clients/python/src/rohrpost"));
    std::fs::create_dir_all(path.join("rohrpost")).unwrap();
    for entry in std::fs::read_dir(sources).unwrap().map(|entry| entry.unwrap()) {
        symlink(entry.path(), path.join("rohrpost").join(entry.file_name())).unwrap();
    }
    symlink(library, path.join("rohrpost/_node.abi3.so")).unwrap();
    path
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
        let (config, program) = (place.path("robot.toml"), place.path("gripper.py"));
        let map = format!("{:?}", repository().join("config/building.map"));
        std::fs::write(&config, CONFIG.replace("MAP", &map).replace("SETTINGS", settings)).unwrap();
        std::fs::write(&program, code).unwrap();
        std::fs::set_permissions(&program, PermissionsExt::from_mode(0o755)).unwrap();
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
    let listed = scene.says(&["list", "--json"]).ok();
    assert!(listed.contains("\"gripper.0\""), "{listed}");
    assert!(scene.says(&["status", "gripper.0"]).ok().starts_with("gripper.0 is on\n"));
    assert_eq!(scene.says(&["call", "gripper.0", "close", "4"]).ok(), "{width_m: 0.02, force_n: 4}\n");
    let refused = scene.says(&["call", "gripper.0", "close", "40"]);
    assert_eq!(
        (refused.code, refused.out.trim()),
        (Some(1), "gripper.0 answers with an error: \"more than 20 N break it\"")
    );
    let said = scene.says(&["call", "gripper.0"]).ok();
    for words in ["Holds things, and stops the robot while it takes them.", "close <force_n: f64>", "How it holds now."]
    {
        assert!(said.contains(words), "{words}: {said}");
    }
    let held = scene.says(&["echo", "gripper.0", "grip", "--count", "1"]).ok();
    assert!(held.ends_with("{width_m: 0.02, force_n: 4}\n"), "{held}");
    // Parameters: as configured, set, and refused.
    assert_eq!(scene.says(&["param", "get", "gripper.0", "speed-m-s", "--json"]).json()[0]["value"], 0.06);
    assert_eq!(scene.says(&["param", "set", "gripper.0", "speed-m-s", "0.1"]).ok(), "gripper.0 speed-m-s: 0.06 -> 0.1 m/s\n");
    assert!(scene.says(&["param", "set", "gripper.0", "speed-m-s", "0.3"]).fails().contains("out of range: 0..=0.2"));
    // It reads the camera's stream in place, and writes its own in place, which a tool in Rust reads.
    wait("it has seen pictures", || (scene.written("edge") > 3).then_some(()));
    let edge = scene.says(&["stream", "read", "gripper.0", "edge"]).ok();
    assert!(edge.contains("height_px: 16") && edge.contains("Rgb8"), "{edge}");
    // Killed, it is started again, and its stream goes on.
    let (pid, before) = (scene.robot.pid("gripper.0"), scene.written("edge"));
    signal(pid, Signal::SIGKILL);
    scene.robot.wait_restarted("gripper.0", pid);
    assert_eq!(scene.says(&["call", "gripper.0", "close", "5"]).ok(), "{width_m: 0.02, force_n: 5}\n");
    wait("it sees pictures again", || (scene.written("edge") > before).then_some(()));
    for (order, state) in [("off", "off"), ("on", "on")] {
        scene.says(&[order, "gripper.0"]).ok();
        assert_eq!(scene.robot.state("gripper.0"), state);
    }
    scene.stop();
}
