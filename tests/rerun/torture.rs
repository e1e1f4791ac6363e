//! A viewer is frozen, killed and restarted, also in a flood, while the robot measures its own latencies.
//!
//! The robot has one processor, which is never idle ([`Load`]); bridge and viewer run wherever the kernel puts them.
//!
//! The figure is the lower quartile of the median delay of beats in short windows: other load of the computer only adds
//! to it, and comes and goes; the effect of a fault stays. Faults are interleaved with two kinds of peace: a viewer
//! that is `well`, which costs the computer more than one that does nothing; and none at all, `absent`, which costs it
//! less. With a fault the robot must be no slower than with either. How many windows there are does not depend on what
//! they say: only when peace itself is noisy is their number doubled, once, and all count.
//!
//! A few rounds on a shared computer distinguish a robot that waits for its viewer from one that does not, but show no
//! difference of 10 %: they have a wide limit. `ROHRPOST_TORTURE_ROUNDS=20 cargo xtask test --all` repeats each fault
//! that often, and applies the narrow one.

use super::load::{Load, on_one_processor};
use super::modules::Mark;
use super::robot::Robot;
use super::viewer::{Viewer, free_port};
use rohrpost_testbed::stall_detector::{Watched, repeated_on_stall};
use std::time::{Duration, Instant};

/// Ratio of the robot's delay with a faulty viewer to that in peace, at most; with a requested number of rounds.
const RATIO_MAX: f64 = 1.1;
/// The same in the few rounds of the usual tests.
const RATIO_MAX_OF_FEW: f64 = 2.0;
/// Peace is noisy when its median lies so far above its lower quartile, as a share of that.
const SPREAD_MAX: f64 = 0.15;
/// Beats of a window: a tenth of a second.
const WINDOW: u64 = 20;
/// Windows of each kind in a round.
const WINDOWS: u32 = 6;
const ROUNDS: usize = 3;
/// Longer than the watch takes to cut a frozen viewer off (3 s).
const FREEZE: Duration = Duration::from_millis(4000);
/// All buffers that could fill up are full after this time.
const LONG_FREEZE: Duration = Duration::from_secs(11);
/// After it only the absence of the viewer is left of the fault.
const SETTLED: Duration = Duration::from_secs(1);
/// Limit of the bridge's memory in all cases: its own bounds, and the program.
const MIB_MAX: u64 = 120;

/// The state of the drawing; the same as the bridge's own type.
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
    _load: Load,
}

impl Test {
    fn new(settings: impl FnOnce(u16) -> String) -> Self {
        let port = free_port();
        let drawing = format!("viewer = \"rerun+http://127.0.0.1:{port}/proxy\"");
        let settings = settings(port);
        let (robot, load) = (Robot::start(&drawing, &settings), on_one_processor(Load::start));
        Self { robot, port, viewer: None, most_mib: 0, _load: load }
    }

    /// Median latency of one window, ns.
    fn window(&mut self) -> u64 {
        self.most_mib = self.most_mib.max(self.robot.bridge_mib());
        self.robot.window(WINDOW)
    }

    /// Some windows, one after the other.
    fn windows(&mut self) -> Vec<u64> {
        (0..WINDOWS).map(|_| self.window()).collect()
    }

    /// As many, over a span of time.
    fn windows_over(&mut self, span: Duration) -> Vec<u64> {
        let began = Instant::now();
        let at = |number: u32| span * number / WINDOWS;
        let mut all = Vec::new();
        for number in 1..=WINDOWS {
            all.push(self.window());
            std::thread::sleep(at(number).saturating_sub(began.elapsed()));
        }
        all
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

/// Medians of windows, ns, by situation.
#[derive(Default)]
struct Figures {
    well: Vec<u64>,
    absent: Vec<u64>,
    frozen: Vec<u64>,
    killed: Vec<u64>,
}

/// The value that this share of all is below.
fn quantile(windows: &[u64], share: f64) -> f64 {
    let mut sorted = windows.to_vec();
    sorted.sort_unstable();
    sorted[((sorted.len() - 1) as f64 * share).round() as usize] as f64
}

fn quiet(windows: &[u64]) -> f64 {
    quantile(windows, 0.25)
}

fn spread(windows: &[u64]) -> f64 {
    quantile(windows, 0.5) / quiet(windows) - 1.0
}

impl Figures {
    /// Both kinds of peace and the faults, in turns.
    fn take(&mut self, test: &mut Test, rounds: usize, marks: [(Mark, &str); 2], freeze: bool) {
        let [(frozen, frozen_name), (killed, killed_name)] = marks;
        for _ in 0..rounds {
            self.well.extend(test.windows());
            if freeze {
                test.viewer().freeze();
                self.frozen.extend(test.windows_over(FREEZE));
                test.viewer().go_on();
                test.returned(&frozen, frozen_name);
            }
            test.viewer = None;
            self.killed.extend(test.windows());
            std::thread::sleep(SETTLED);
            self.absent.extend(test.windows());
            test.restart();
            test.returned(&killed, killed_name);
        }
    }

    fn is_noisy(&self) -> bool {
        spread(&self.well).max(spread(&self.absent)) > SPREAD_MAX
    }

    /// The worst ratio of a fault to a peace; prints all.
    fn worst(&self, when: &str) -> f64 {
        let mut worst: f64 = 0.0;
        for (peace, windows) in [("well", &self.well), ("absent", &self.absent)] {
            let (us, spread) = (quiet(windows) / 1e3, spread(windows) * 100.0);
            println!("{when}: {peace} {us:.1} µs, median {spread:.0} % above, {} windows", windows.len());
        }
        for (fault, windows) in [("frozen", &self.frozen), ("killed", &self.killed)] {
            if windows.is_empty() {
                continue;
            }
            let with = quiet(windows);
            let [well, absent] = [&self.well, &self.absent].map(|peace| with / quiet(peace));
            let (us, spread) = (with / 1e3, spread(windows) * 100.0);
            println!(
                "{when}: {fault} {us:.1} µs, median {spread:.0} % above: {well:.2} of well, {absent:.2} of absent"
            );
            worst = worst.max(well).max(absent);
        }
        worst
    }
}

fn rounds_asked_for() -> Option<usize> {
    let rounds = std::env::var("ROHRPOST_TORTURE_ROUNDS").ok()?;
    Some(rounds.parse().expect("a number of rounds"))
}

/// Figures of so many rounds, and of as many again if peace was noisy.
fn measure(test: &mut Test, when: &str, marks: &[(Mark, &str); 2], freeze: bool) -> f64 {
    let rounds = rounds_asked_for().unwrap_or(ROUNDS);
    let mut figures = Figures::default();
    figures.take(test, rounds, marks.clone(), freeze);
    if figures.is_noisy() {
        println!("{when}: noisy, so once more");
        figures.take(test, rounds, marks.clone(), freeze);
    }
    figures.worst(when)
}

#[test]
fn a_viewer_that_misbehaves_does_not_slow_the_robot() {
    repeated_on_stall(Watched::Ordinary, || {
        let mut test = Test::new(|_| String::new());
        test.robot.mark(&Mark::Begun(1));
        test.windows();
        assert_eq!(test.counts().drawn, 0, "there is no viewer yet");
        test.restart();
        test.returned(&Mark::Begun(2), "Begun");

        test.viewer().freeze();
        test.windows_over(LONG_FREEZE);
        test.viewer().go_on();
        test.returned(&Mark::Frozen(1), "Frozen");
        let stuck = test.counts();
        assert!(stuck.stuck >= 1 && stuck.rebuilt >= 1, "{stuck:?}");

        let marks = [(Mark::Frozen(2), "Frozen"), (Mark::Killed(1), "Killed")];
        let quiet = measure(&mut test, "usual", &marks, true);
        test.robot.flood(true);
        let marks = [(Mark::Frozen(3), "Frozen"), (Mark::Flooded(1), "Flooded")];
        let flooded = measure(&mut test, "flood", &marks, false);
        test.robot.flood(false);

        test.robot.assert_well();
        let counts = test.counts();
        println!("{counts:?}; at most {} MiB", test.most_mib);
        assert!(counts.replaced > 0, "{counts:?}");
        assert!(test.most_mib <= MIB_MAX, "the bridge had {} MiB", test.most_mib);
        let said = test.robot.said();
        assert!(said.contains("stands still") && said.contains("has gone"), "it says what the viewer does:\n{said}");
        assert!(threads_are_nice(&test.robot), "all threads are as nice as their class");
        let most = if rounds_asked_for().is_some() { RATIO_MAX } else { RATIO_MAX_OF_FEW };
        for (when, worst) in [("usual", quiet), ("flood", flooded)] {
            assert!(
                worst <= most,
                "{when}: with a fault the robot's latencies are {worst:.2} times those in peace, not {most}"
            );
        }
    });
}

/// The measurement can fail: a robot that waits for its viewer is detected.
#[test]
fn a_robot_that_waits_for_its_viewer_is_found_out() {
    repeated_on_stall(Watched::Ordinary, || {
        let mut test = Test::new(|port| format!("ask-viewer = {port}"));
        test.restart();
        let before = quiet(&[test.windows(), test.windows()].concat());
        test.viewer().freeze();
        let with = quiet(&[test.windows(), test.windows()].concat());
        test.viewer().go_on();
        assert!(with > 3.0 * before, "{with} ns with a frozen viewer, {before} ns before");
    });
}

/// Rerun makes threads of its own; they inherit what the bridge has. Class 40 has nice 8; the thread that waits for
/// signals is older than that, and does nothing.
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
