//! A bridge with a view of a user's own: the example `own_view` draws a type that only it knows.

use super::programs::{bridge, ok, rerun, rows, rrd};
use super::robot::wait;
use rohrpost::serde::Deserialize;
use rohrpost::{Context, Module, ModuleError};
use std::process::{Command, Stdio};
use std::time::Duration;

/// What the example draws: the type counts, not who declares it.
#[rohrpost::data]
struct Fires {
    places_m: Vec<[f32; 2]>,
}

/// Sees fires.
#[rohrpost::interface(class = "camera")]
trait Seeing {
    #[data(1)]
    fn fires() -> Fires;

    #[data(2)]
    fn heat() -> f64;
}

#[derive(Deserialize)]
#[serde(crate = "rohrpost::serde", deny_unknown_fields)]
struct Settings {}

struct Camera;

impl Seeing for Camera {}

impl Module for Camera {
    type Settings = Settings;
    type Interfaces = SeeingInterface;

    fn new(_: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        context.set_period(Duration::from_millis(50));
        Ok(Self)
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        context.publish_now(SeeingInterface::FIRES, &Fires { places_m: vec![[1.0, 2.0], [3.0, 4.0]] })?;
        Ok(context.publish_now(SeeingInterface::HEAT, &451.0)?)
    }
}

/// Not a test: what launch starts. Run as a test it ends at once.
#[test]
fn module() {
    if std::env::var_os("ROHRPOST_MODULE").is_some() {
        let code = rohrpost::run::<Camera>();
        std::process::exit(i32::from(code != std::process::ExitCode::SUCCESS));
    }
}

#[test]
fn a_view_of_ones_own_draws_a_type_of_ones_own() {
    let folder = tempfile::tempdir().unwrap();
    let (me, example) = (std::env::current_exe().unwrap(), bridge().parent().unwrap().join("examples/own_view"));
    assert!(example.is_file(), "`cargo xtask test` builds {}", example.display());
    let config = format!(
        r#"
installation = "fires"
[system]
name = "robot"
id = 1
[classes]
camera = {{ id = 90 }}
gui = {{ id = 40 }}
tool = {{ id = 16 }}
[nodes.main]
[[module]]
name = "camera.0"
program = [{me:?}, "--exact", "own_view::module", "--nocapture"]
[[module]]
name = "gui.0"
program = [{example:?}]
calls = ["camera.0"]
settings = {{ file = "fires.rrd" }}
[gui]
show = [{{ from = "camera.0", data = "fires" }}, {{ from = "camera.0", data = "heat" }}]
"#
    );
    std::fs::write(folder.path().join("fires.toml"), config).unwrap();
    let command = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_rohrpost"));
        command.args(arguments).env("ROHRPOST_DIR", folder.path().join("nodes")).current_dir(folder.path());
        command.stdin(Stdio::null());
        command
    };
    let launch = command(&["launch", "fires.toml"]).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    wait("something is drawn", || {
        let counts = command(&["call", "gui.0", "counts", "--json"]).output().unwrap();
        let counts: serde_json::Value = serde_json::from_slice(&counts.stdout).ok()?;
        (counts["drawn"].as_u64()? > 60).then_some(())
    });
    let pid = nix::unistd::Pid::from_raw(launch.id() as i32);
    nix::sys::signal::kill(pid, nix::sys::signal::Signal::SIGTERM).unwrap();
    ok("launch", &launch.wait_with_output().unwrap());
    let rows = rows(&rrd(&rerun(), "print", &folder.path().join("fires.rrd")));
    for entity in ["/world/fires/camera.0", "/data/camera.0/heat"] {
        assert!(rows.get(entity).is_some_and(|rows| *rows > 5), "{entity}: {rows:#?}");
    }
    assert!(!rows.keys().any(|entity| entity.starts_with("/data/camera.0/fires")), "its own view draws it alone");
}
