//! The bridge is switched off and on, killed and started again: earlier recordings stay, and the new drawing is
//! complete.

use super::launched::Launched;
use super::programs::{bridge, ok, rerun, rows, rrd};
use super::robot::{until, wait};
use rohrpost::interfaces::{Cartographer, CartographerInterface, MapCounts};
use rohrpost::serde::Deserialize;
use rohrpost::types::{OccupancyGrid, Pose};
use rohrpost::{Context, Module, ModuleError};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

#[derive(Deserialize)]
#[serde(crate = "rohrpost::serde", deny_unknown_fields)]
struct Settings {}

/// Its map never changes: it publishes it on request only.
struct Quiet {
    asked: bool,
}

impl Module for Quiet {
    type Settings = Settings;
    type Interfaces = CartographerInterface;

    fn new(_: Settings, context: &mut Context) -> Result<Self, ModuleError> {
        context.set_period(Duration::from_millis(50));
        Ok(Self { asked: false })
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        if std::mem::take(&mut self.asked) {
            let cells = vec![100; 16];
            let map = OccupancyGrid { origin: Pose::default(), resolution_m: 0.1, columns: 4, rows: 4, cells };
            context.publish_now(CartographerInterface::MAP, &map)?;
        }
        Ok(())
    }
}

impl Cartographer for Quiet {
    fn counts(&mut self) -> MapCounts {
        MapCounts::default()
    }

    fn publish_all(&mut self) {
        self.asked = true;
    }

    fn clear(&mut self) {}
}

/// Not a test: what launch starts. Run as a test it ends at once.
#[test]
fn module() {
    if std::env::var_os("ROHRPOST_MODULE").is_some() {
        let code = rohrpost::run::<Quiet>();
        std::process::exit(i32::from(code != std::process::ExitCode::SUCCESS));
    }
}

fn configuration(settings: &str) -> String {
    let (me, bridge) = (std::env::current_exe().unwrap(), bridge());
    format!(
        r#"
installation = "switched"
[system]
name = "robot"
id = 1
[classes]
mapper = {{ id = 90 }}
gui = {{ id = 40 }}
output = {{ id = 32 }}
tool = {{ id = 16 }}
[nodes.main]
[[module]]
name = "output.0"
builtin = "output"
[[module]]
name = "mapper.0"
program = [{me:?}, "--exact", "switching::module", "--nocapture"]
settings = {{}}
[[module]]
name = "gui.0"
program = [{bridge:?}]
calls = ["mapper.0", {{ to = "output.0", although = "it reads earlier lines once, and waits for nobody" }}]
stop-within = "10 s"
optional = true
settings = {{ {settings} }}
[gui]
show = [{{ from = "mapper.0", data = "map", rate = 0.0 }}]
"#
    )
}

fn drawn(file: &Path) -> BTreeMap<String, u64> {
    rows(&rrd(&rerun(), "print", file))
}

#[test]
fn a_drawing_that_is_switched_on_again_is_whole_and_the_last_one_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let (file, old) = (folder.path().join("map.rrd"), folder.path().join("map.old.rrd"));
    std::fs::write(folder.path().join("map.toml"), configuration(r#"file = "map.rrd""#)).unwrap();
    let launch = Launched::start(folder.path(), "map.toml");
    // States and charts come each half second, some twenty rows. After several times as long the map has come, too: it
    // is requested at once.
    let enough = |launch: &Launched| wait("something is drawn", || (launch.count("drawn")? > 100).then_some(()));
    enough(&launch);
    ok("off", &launch.tool(&["call", "gui.0", "off"]));
    until("the first ends", || std::fs::read(&file).unwrap().windows(4).any(|mark| mark == b"FOOT"));
    ok("on", &launch.tool(&["call", "gui.0", "on"]));
    enough(&launch);
    let said = launch.end();
    assert!(!said.contains("does not stop within"), "it ends in time:\n{said}");
    for file in [&old, &file] {
        let rows = drawn(file);
        let has = |entity: &str| rows.keys().any(|name| name.starts_with(entity));
        assert!(has("/world/map/mapper.0/"), "{}: {rows:#?}", file.display());
        // The line is older than the bridge, and was not repeated.
        assert!(has("/output/mapper.0"), "{}: {rows:#?}", file.display());
        let verified = rrd(&rerun(), "verify", file);
        assert!(verified.contains("1 file verified without error"), "{verified}");
    }
}

#[test]
fn settings_that_cannot_be_are_refused_with_what_can() {
    for (settings, why) in [
        (r#"file = "a.rrd", file-max-mib = 0"#, "`file-max-mib` is 0; use 8 or more"),
        (
            r#"file = "a.rrd", rate-hz = 1e-19"#,
            "`rate-hz` is 0.0000000000000000001; use 0.01 to 1000, or 0 for no limit",
        ),
    ] {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("map.toml"), configuration(settings)).unwrap();
        let launch = Launched::start(folder.path(), "map.toml");
        until(why, || {
            let log = launch.tool(&["log", "--module", "gui.0"]);
            String::from_utf8_lossy(&log.stdout).contains(why)
        });
    }
}
