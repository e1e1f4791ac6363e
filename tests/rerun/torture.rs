//! A viewer is frozen, killed and restarted, also in a flood, while the robot measures its own latencies.
//!
//! What is compared are medians of short windows, without the fault and with it in turns. Of all turns together the quieter
//! windows count: what else the computer does comes and goes, and the fault stays. Noise is no failure: while the ratio is
//! above [`RATIO_MAX`] the fault is repeated, up to [`ROUNDS_MAX`] times. `ROHRPOST_TORTURE_ROUNDS=20 cargo xtask test` makes
//! each fault come that often at least.

use super::robot::{Mark, Robot};
use super::viewer::{Viewer, free_port};
use std::time::{Duration, Instant};

/// The robot's latencies with a viewer that misbehaves, by those with one that does not.
const RATIO_MAX: f64 = 1.1;
const ROUNDS_MAX: usize = 12;
/// Beats of a window: a tenth of a second.
const WINDOW: u64 = 20;
const WINDOWS: usize = 20;
/// The bridge's memory, whatever happens: its own bounds, and the program.
const MIB_MAX: u64 = 120;

/// What became of the drawing; the same as the bridge's own type.
#[rohrpost::data]
#[derive(Clone, Copy, Debug)]
struct Counts {
    drawn: u64,
    replaced: u64,
    dropped: u64,
    rebuilt: u64,
    stuck: u64,
}

struct Test {
    robot: Robot,
    port: u16,
    viewer: Option<Viewer>,
    most_mib: u64,
}

impl Test {
    fn new(settings: impl FnOnce(u16) -> String) -> Self {
        let port = free_port();
        let robot = Robot::start(port, &settings(port));
        Self { robot, port, viewer: None, most_mib: 0 }
    }

    /// Median latencies of some windows, ns.
    fn latencies(&mut self) -> Vec<u64> {
        let windows = (0..WINDOWS).map(|_| {
            self.most_mib = self.most_mib.max(self.robot.bridge_mib());
            self.robot.window(WINDOW)
        });
        windows.collect()
    }

    fn restart(&mut self) {
        self.viewer = None;
        self.viewer = Some(Viewer::start(self.port));
    }

    fn viewer(&self) -> &Viewer {
        self.viewer.as_ref().unwrap()
    }

    /// The viewer is there and gets what is drawn now, and what was drawn before it came.
    fn returned(&mut self, mark: &Mark, entity: &str) {
        self.robot.mark(mark);
        let folder = self.robot.folder().to_owned();
        let new = format!("/data/source.0/marks/{entity}");
        let always = [
            "/blueprint_panel",
            "/world/scan/source.0",
            "/world/robot/source.0/body",
            "/modules/sink.0",
            "/output/",
            "/packages/sink",
            "/data/source.0/marks/Begun",
        ];
        let entities = [&always[..], &[new.as_str()]].concat();
        self.viewer().shows(&folder, &entities, ("/world/map/source.0/", 64));
    }

    fn counts(&mut self) -> Counts {
        self.robot.bridge()
    }
}

/// What the quieter windows have: the lower quartile.
fn quiet(mut windows: Vec<u64>) -> f64 {
    windows.sort_unstable();
    windows[windows.len() / 4] as f64
}

/// Repeats well, ill, well, … until the ratio is good enough, or there were enough.
fn ratio(
    test: &mut Test,
    what: &str,
    rounds: usize,
    mut make_ill: impl FnMut(&mut Test, usize),
    mut make_well: impl FnMut(&mut Test),
) -> f64 {
    let (mut well, mut ill) = (test.latencies(), Vec::new());
    for round in 1.. {
        make_ill(test, round);
        ill.extend(test.latencies());
        make_well(test);
        well.extend(test.latencies());
        let (with, without) = (quiet(ill.clone()), quiet(well.clone()));
        let ratio = with / without;
        println!("{what}: {:.1} µs with it, {:.1} µs without: {ratio:.2}", with / 1e3, without / 1e3);
        if round >= rounds && (ratio <= RATIO_MAX || round >= ROUNDS_MAX) {
            return ratio;
        }
    }
    unreachable!("rounds do not end")
}

fn rounds() -> usize {
    std::env::var("ROHRPOST_TORTURE_ROUNDS").ok().map_or(1, |rounds| rounds.parse().expect("a number of rounds"))
}

fn hold(duration: Duration, test: &mut Test) {
    let start = Instant::now();
    while start.elapsed() < duration {
        test.robot.window(WINDOW);
        test.most_mib = test.most_mib.max(test.robot.bridge_mib());
    }
}

#[test]
fn a_viewer_that_misbehaves_does_not_slow_the_robot() {
    let mut test = Test::new(|_| String::new());
    test.robot.mark(&Mark::Begun(1));
    let absent = quiet(test.latencies());
    assert_eq!(test.counts().drawn, 0, "there is no viewer yet");
    test.restart();
    test.returned(&Mark::Begun(2), "Begun");
    println!("absent: {:.1} µs", absent / 1e3);

    let rounds = rounds();
    let frozen = ratio(
        &mut test,
        "frozen",
        rounds,
        |test, round| {
            test.viewer().freeze();
            // Once for long, so that all that could fill up is full; then the watch has come in any case.
            hold(Duration::from_secs(if round == 1 { 11 } else { 1 }), test);
        },
        |test| {
            test.viewer().go_on();
            test.returned(&Mark::Frozen(1), "Frozen");
        },
    );
    let stuck = test.counts();
    assert!(stuck.stuck >= 1 && stuck.rebuilt >= 1, "{stuck:?}");

    let killed = ratio(
        &mut test,
        "killed",
        rounds,
        |test, _| test.viewer = None,
        |test| {
            test.restart();
            test.returned(&Mark::Killed(1), "Killed");
        },
    );

    test.robot.flood(true);
    let flooded = ratio(
        &mut test,
        "killed in a flood",
        rounds,
        |test, _| test.viewer = None,
        |test| {
            test.restart();
            test.returned(&Mark::Flooded(1), "Flooded");
        },
    );
    test.robot.flood(false);

    test.robot.assert_well();
    let counts = test.counts();
    println!("{counts:?}; at most {} MiB", test.most_mib);
    assert!(counts.replaced > 0, "{counts:?}");
    assert!(test.most_mib <= MIB_MAX, "the bridge had {} MiB", test.most_mib);
    let said = test.robot.said();
    assert!(said.contains("stands still") && said.contains("has gone"), "it says what the viewer does:\n{said}");
    assert!(threads_are_nice(&test.robot), "all threads are as nice as their class");
    for (what, ratio) in [("frozen", frozen), ("killed", killed), ("killed in a flood", flooded)] {
        assert!(ratio <= RATIO_MAX, "{what}: the robot's latencies are {ratio:.2} times those before");
    }
}

/// The measurement can fail: a robot that waits for its viewer is found out.
#[test]
fn a_robot_that_waits_for_its_viewer_is_found_out() {
    let mut test = Test::new(|port| format!("ask-viewer = {port}"));
    test.restart();
    let before = quiet(test.latencies());
    test.viewer().freeze();
    let with = quiet(test.latencies());
    test.viewer().go_on();
    assert!(with > 3.0 * before, "{with} ns with a frozen viewer, {before} ns before");
}

/// Rerun makes threads of its own; they inherit what the bridge has. Class 40 has nice 8; the thread that waits for signals is
/// older than that, and does nothing.
fn threads_are_nice(robot: &Robot) -> bool {
    let threads = std::fs::read_dir(format!("/proc/{}/task", robot.bridge_pid())).unwrap();
    let mut all = threads.map(|thread| {
        let stat = std::fs::read_to_string(thread.unwrap().path().join("stat")).unwrap_or_default();
        let (name, rest) = stat.rsplit_once(") ").unwrap_or(("", ""));
        // The third field, the state, is the first behind the name; nice is the nineteenth.
        (name.ends_with("(signals"), rest.split(' ').nth(16).map(str::to_owned))
    });
    all.all(|(signals, nice)| signals || nice.is_none_or(|nice| nice == "8"))
}
