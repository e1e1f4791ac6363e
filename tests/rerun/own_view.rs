//! A bridge with a user's own view: the example `own_view` draws a type that only it knows.

use super::launched::Launched;
use super::programs::{bridge, rerun, rows, rrd};
use super::robot::wait;
use rohrpost::serde::Deserialize;
use rohrpost::{Context, Module, ModuleError};
use std::time::Duration;

/// The example draws by type, whatever module declares it.
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
    assert!(example.is_file(), "`cargo xtask test --all` builds {}", example.display());
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
    let launch = Launched::start(folder.path(), "fires.toml");
    wait("something is drawn", || (launch.count("drawn")? > 60).then_some(()));
    launch.end();
    let rows = rows(&rrd(&rerun(), "print", &folder.path().join("fires.rrd")));
    for entity in ["/world/fires/camera.0", "/data/camera.0/heat"] {
        assert!(rows.get(entity).is_some_and(|rows| *rows > 5), "{entity}: {rows:#?}");
    }
    assert!(!rows.keys().any(|entity| entity.starts_with("/data/camera.0/fires")), "its own view draws it alone");
}
