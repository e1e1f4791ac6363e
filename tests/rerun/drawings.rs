//! Drawings of whole demos, in files.

use super::programs::{bridge, content, entities_of, ok, rerun, rows, rrd, search_path, timed_rows, times_ns};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::Command;
use std::time::{Duration, Instant};
use tempfile::TempDir;

const LOG: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../modules/robot/tests/data/small.log");

const TEAM: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/team.toml");

/// What the demo draws into.
const FILE: &str = "rohrpost-demo.rrd";

/// The last part of entities of the replica that brings pictures to the desk.
const PICTURE: &str = r"camera.0\/image\ base\ \u{2192}\ desk";

/// A demo that ran to its end: its output, and the number of rows of each entity in its drawing.
struct Drawing {
    said: String,
    /// What Rerun's command line prints of it.
    printed: String,
    rows: BTreeMap<String, u64>,
    folder: TempDir,
    /// Its run time, including start and end.
    took: Duration,
}

impl Drawing {
    fn of(arguments: &[&str]) -> Self {
        Self::where_possible(arguments).unwrap()
    }

    /// None where a demo of several nodes cannot be: without network namespaces.
    #[track_caller]
    fn where_possible(arguments: &[&str]) -> Option<Self> {
        Self::by(&[&["demo", "--quiet"], arguments].concat())
    }

    /// None where the command needs network namespaces, and there are none.
    #[track_caller]
    fn by(command: &[&str]) -> Option<Self> {
        let (rerun, bridge) = (rerun(), bridge());
        let folder = tempfile::tempdir().unwrap();
        let began = Instant::now();
        let demo = Command::new(env!("CARGO_BIN_EXE_rohrpost"))
            .args(command)
            .env("PATH", search_path(&bridge))
            .env("ROHRPOST_DIR", folder.path().join("memory"))
            .current_dir(folder.path())
            .output()
            .unwrap();
        let took = began.elapsed();
        if String::from_utf8_lossy(&demo.stderr).contains("network namespaces cannot be made here") {
            rohrpost_testbed::report::skipped(&String::from_utf8_lossy(&demo.stderr));
            return None;
        }
        let said = ok(&command.join(" "), &demo);
        assert!(!said.contains("left out"), "the bridge was not found:\n{said}");
        let file = folder.path().join(FILE);
        let verified = rrd(&rerun, "verify", &file);
        assert!(verified.contains("1 file verified without error"), "{verified}");
        let printed = rrd(&rerun, "print", &file);
        let rows = rows(&printed);
        // The two commands read the file differently.
        let entities: Vec<&String> = rows.keys().collect();
        assert_eq!(entities, entities_of(&rrd(&rerun, "stats", &file)).iter().collect::<Vec<_>>());
        Some(Self { said, printed, rows, folder, took })
    }

    fn file(&self) -> PathBuf {
        self.folder.path().join(FILE)
    }

    /// Rows of all entities below this one, together.
    fn count(&self, entity: &str) -> u64 {
        let below = format!("{entity}/");
        let own = |name: &&String| *name == entity || name.starts_with(&below);
        self.rows.iter().filter(|(name, _)| own(name)).map(|(_, rows)| rows).sum()
    }

    #[track_caller]
    fn has(&self, entity: &str, rows: std::ops::RangeInclusive<u64>) {
        let count = self.count(entity);
        assert!(rows.contains(&count), "{entity}: {count} rows, not {rows:?}\n{:#?}\n{}", self.rows, self.said);
    }

    /// Drawings of every robot: its modules, their lines, and the traffic of its packages, twice a second.
    fn has_robot(&self, modules: &[&str], busy: &[&str]) {
        let charts = 4..=2 * self.took.as_secs() + 3;
        for module in modules {
            self.has(&format!("/modules/{module}"), 1..=4);
        }
        for class in busy.iter().chain(&["output", "tool"]) {
            for entity in [format!("/packages/{class}"), format!("/losses/{class}")] {
                self.has(&entity, charts.clone());
            }
        }
        // Drawn only for spans with packages, so only checked for modules with steady traffic.
        for class in busy {
            self.has(&format!("/latency/{class}/p50"), charts.clone());
            self.has(&format!("/latency/{class}/p99"), charts.clone());
        }
        self.has(r"/modules\ now", 1..=10);
    }
}

#[test]
fn the_simulated_robot_is_drawn() {
    let drawing = Drawing::of(&["--seconds", "6"]);
    // Ten a second of scans and of poses, for six seconds less the start; a busy computer draws fewer.
    drawing.has("/world/scan/laser.0", 15..=70);
    drawing.has("/world/robot/mapper.0", 15..=75);
    drawing.has("/world/robot/odometry.0", 15..=75);
    drawing.has("/world/map/mapper.0", 4..=2000);
    // From streams, too large for packages: two pictures and one cloud a second, of which the place may be a row.
    drawing.has("/pictures/camera.0/image", 3..=16);
    drawing.has("/points/depth.0/points", 2..=20);
    for (entity, component, least) in [
        ("/pictures/camera.0/image", "Image:buffer", 640 * 480 * 3),
        // Of 204 800 points those that are seen, with their colours.
        ("/points/depth.0/points", "Points3D:positions", 1000 * 16),
    ] {
        let (components, bytes) = content(&drawing.printed, entity);
        assert!(components.contains(component), "{entity} has {components:?}");
        assert!(bytes >= f64::from(least), "{entity} has {bytes} bytes");
    }
    let modules = ["output.0", "motor.0", "mapper.0", "pilot.0", "gui.0"];
    drawing.has_robot(&modules, &["pilot", "gui"]); // the mapper reads streams
    drawing.has("/output", 1..=100);
    assert!(drawing.said.contains(" packages received, 0 lost"), "{}", drawing.said);
}

/// The desk shows streams of the base by their replicas, and how late they are.
#[test]
fn streams_of_another_node_are_drawn_with_their_delay() {
    let drawing = Drawing::where_possible(&["--nodes", "3", "--seconds", "16"]);
    let Some(drawing) = drawing else { return };
    assert!(drawing.said.contains("lost without a cause: 0\n"), "{}", drawing.said);
    drawing.has("/world/scan/laser.0", 15..=180);
    drawing.has("/world/robot/odometry.0", 15..=180);
    drawing.has("/pictures/camera.0/image", 3..=40);
    let (components, bytes) = content(&drawing.printed, "/pictures/camera.0/image");
    assert!(components.contains("Image:buffer") && bytes >= f64::from(640 * 480 * 3), "{components:?}, {bytes} bytes");
    let told = 2..=2 * drawing.took.as_secs() + 3;
    for way in [PICTURE, r"laser.0\/scan\ base\ \u{2192}\ desk"] {
        drawing.has(&format!("/network/records/{way}"), told.clone());
        drawing.has(&format!("/network/delay/{way}"), told.clone());
    }
    drawing.has(&format!(r"/network/records\ lost/sampled\,\ {PICTURE}"), 1..=*told.end());
}

/// Each node draws its router's report of slots, and of flows that leave it.
#[test]
fn time_slots_and_flows_are_drawn() {
    let drawing = Drawing::where_possible(&["--nodes", "3", "--tdma", "--seconds", "10"]);
    let Some(drawing) = drawing else { return };
    for entity in ["slots", "guards", "nodes", "marks", "times"] {
        drawing.has(&format!("/slots/plan/{entity}"), 1..=1);
    }
    // Told twice a second.
    for node in ["base", "brain", "desk"] {
        drawing.has(&format!("/slots/sent/{node}"), 1..=40);
        drawing.has(&format!("/slots/off/{node}"), 2..=41);
    }
    for flow in [r"base\ 0", r"brain\ 0"] {
        drawing.has(&format!("/slots/flows/{flow}/worst"), 2..=41);
        drawing.has(&format!("/slots/flows/{flow}/bound"), 2..=41);
    }
}

/// The GUI is not on the robot's LAN, and the TCP router, by which alone it is reached, is killed in the middle: that
/// costs a gap, which is seen, and nothing else.
#[test]
fn from_beyond_the_lan_all_is_drawn_but_for_a_gap() {
    let drawing = Drawing::where_possible(&["--nodes", "3", "--gui", "tcp", "--secure", "--seconds", "16"]);
    let Some(drawing) = drawing else { return };
    let said = &drawing.said;
    assert!(said.contains("The TCP router died") && said.contains("killed on purpose); there again"), "{said}");
    assert!(said.contains("the accounts balance"), "{said}");
    // Times of the outage, by the drawing itself.
    let lane = timed_rows(&drawing.file(), r"/modules/TCP\ router\,\ from\ desk");
    let states: Vec<bool> = lane.iter().map(|(_, state)| state.contains("on")).collect();
    assert!(states.chunks(2).all(|pair| pair[0] && pair.get(1) != Some(&true)) && states.len() >= 3, "{lane:?}");
    let (began_ns, ended_ns) = (lane[1].0, lane.last().unwrap().0);
    assert!(began_ns < ended_ns && *states.last().unwrap(), "{lane:?}");
    // Of seven seconds at least on each side, ten a second; a busy computer draws fewer.
    for entity in ["/world/scan/laser.0", "/world/robot/mapper.0", "/world/robot/odometry.0"] {
        let times = times_ns(&drawing.file(), entity);
        let (before, after) = (times.partition_point(|ns| *ns < began_ns), times.partition_point(|ns| *ns <= ended_ns));
        let within = after - before;
        assert!(
            before > 15 && times.len() - after > 15,
            "{entity}: {before} rows before, {within} within, {}",
            times.len()
        );
    }
    // Entities of the moment are cleared when the gap begins.
    let cleared = times_ns(&drawing.file(), "/world/scan");
    assert!(cleared.first().is_some_and(|ns| *ns <= ended_ns) && cleared.is_sorted(), "{cleared:?}, {lane:?}");
    assert!(!said.contains("out-of-order"), "{said}");
    for entity in ["/world/map/mapper.0", "/packages/gui", r"/network/packages/base\ \u{2192}\ brain", "/output"] {
        assert!(drawing.count(entity) > 0, "{entity}: {:#?}", drawing.rows);
    }
    let late = times_ns(&drawing.file(), r"/network/packages/base\ \u{2192}\ brain");
    assert!(late.last() > Some(&ended_ns), "links are told of again");
    drawing.has("/modules/pilot.0", 1..=8);
    let beyond = drawing.said.split_once("Through the TCP router, by class").expect("clients have counted").1;
    let robot = beyond.split_once("\ngui ").and_then(|(_, row)| row.lines().next()).expect("a row of the bridge");
    let counts: Vec<u64> = robot.split_whitespace().map_while(|word| word.parse().ok()).collect();
    let [meant, _left, _replaced, came, ..] = counts[..] else { panic!("{robot}") };
    assert!(meant > 200 && came * 5 > meant * 4, "of some thousand a gap's are missing: {robot}");
}

/// Each robot is a system of its own, and so is the arena, which draws them all.
#[test]
fn a_team_is_drawn_in_space_from_all_its_systems() {
    let launch = ["team", "launch", TEAM, "--robots", "3", "--seconds", "8", "--draw", FILE];
    let drawing = Drawing::by(&launch).unwrap();
    drawing.has("/space/walls", 1..=1);
    let beats = 8..=60;
    for robot in 1..=3 {
        drawing.has(&format!("/space/robot/{robot}"), 20..=1500);
        drawing.has(&format!("/space/way/{robot}"), beats.clone());
        drawing.has(&format!("/modes/robot-{robot}"), 2..=60);
        let groups = timed_rows(&drawing.file(), &format!("/groups/robot-{robot}"));
        assert!(groups.iter().any(|(_, row)| row.contains("group 3, leader 1")), "robot {robot}: {groups:?}");
    }
    drawing.has("/modules/arena.0", 1..=4);
    assert!(drawing.said.contains(&format!("drawing: {FILE}")), "{}", drawing.said);
}

#[test]
fn a_log_is_drawn() {
    let drawing = Drawing::of(&["--log", LOG, "--speed", "2"]);
    assert!(drawing.said.contains("log: 20 scans and 100 odometry lines played"), "{}", drawing.said);
    assert!(drawing.said.contains(" 20 scans mapped (0 without pose)"), "{}", drawing.said);
    assert!(drawing.said.contains(" packages received, 0 lost"), "{}", drawing.said);
    // 20 scans in 10 s of the log, twice as fast: four a second, so the rate leaves none out; but of those that
    // come together after the computer had no time, the newest alone are drawn.
    drawing.has("/world/scan/laser.0", 5..=22);
    drawing.has("/world/robot/mapper.0", 5..=24);
    drawing.has("/world/map/mapper.0", 4..=2000);
    drawing.has_robot(&["output.0", "mapper.0", "gui.0", "player.0"], &["gui"]);
    drawing.has("/output/player.0", 1..=3);
}
