//! A viewer is frozen, killed and restarted, also in a flood, while the robot measures its own latencies.
//!
//! The robot has one processor, which is never idle ([`Load`]); bridge and viewer run wherever the kernel puts them.
//!
//! The figure is the median delay of beats in a short window. Faults are interleaved with two kinds of peace: a viewer
//! that is `well`, which costs the computer more than one that does nothing; and none at all, `absent`, which costs it
//! less. With a fault the robot must be no slower than with either, by a tenth at most.
//!
//! Windows are compared by ranks: of all pairs of a window with a fault and one in peace of the same round, no more
//! than half have a ratio above that, but for chance. So load of the computer, which comes and goes, is on both sides.
//! A window in which a processor stood still is taken again; nothing else is left out, and how many windows there are
//! does not depend on what they say. More rounds leave less to chance:
//! `ROHRPOST_TORTURE_ROUNDS=20 cargo xtask test --all`.

use super::load::{Load, on_one_processor};
use super::modules::Mark;
use super::robot::{Robot, until};
use super::viewer::{Viewer, free_port};
use rohrpost_testbed::stalls::{Late, Stalls, unless_stalled};
use std::time::{Duration, Instant};

/// Ratio of the robot's delay with a faulty viewer to that in peace, at most.
const RATIO_MAX: f64 = 1.1;
/// Standard deviations that are chance.
const CHANCE: f64 = 3.0;
/// Beats of a window: a tenth of a second.
const WINDOW: u64 = 20;
/// Windows of each kind in a round.
const WINDOWS: u32 = 12;
const ROUNDS: usize = 3;
/// A window is of no use if a processor stood still for this share of it.
const STALLED_MAX: f64 = 0.1;
/// So many of these in a row, and nothing can be said.
const STALLED_WINDOWS: u32 = 20;
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

struct Test<'a> {
    robot: Robot,
    port: u16,
    viewer: Option<Viewer>,
    most_mib: u64,
    stalls: &'a Stalls,
    _load: Load,
}

impl<'a> Test<'a> {
    fn new(stalls: &'a Stalls, settings: impl FnOnce(u16) -> String) -> Self {
        let port = free_port();
        let drawing = format!("viewer = \"rerun+http://127.0.0.1:{port}/proxy\"");
        let settings = settings(port);
        let (robot, load) = (Robot::start(&drawing, &settings), on_one_processor(Load::start));
        Self { robot, port, viewer: None, most_mib: 0, stalls, _load: load }
    }

    /// Median latency of one window in which no processor stood still, ns.
    fn window(&mut self) -> Result<u64, Late> {
        self.most_mib = self.most_mib.max(self.robot.bridge_mib());
        let first = Instant::now();
        for _ in 0..STALLED_WINDOWS {
            let began = Instant::now();
            let p50_ns = self.robot.window(WINDOW);
            let ended = Instant::now();
            if self.stalls.stalled(began, ended) < (ended - began).mul_f64(STALLED_MAX) {
                return Ok(p50_ns);
            }
        }
        Err(Late::now("no window without a stall", first, first.elapsed().mul_f64(STALLED_MAX)))
    }

    /// Some windows, one after the other.
    fn windows(&mut self) -> Result<Vec<u64>, Late> {
        (0..WINDOWS).map(|_| self.window()).collect()
    }

    /// As many, over a span of time.
    fn windows_over(&mut self, span: Duration) -> Result<Vec<u64>, Late> {
        let began = Instant::now();
        let at = |number: u32| span * number / WINDOWS;
        let mut all = Vec::new();
        for number in 1..=WINDOWS {
            all.push(self.window()?);
            std::thread::sleep(at(number).saturating_sub(began.elapsed()));
        }
        Ok(all)
    }

    /// The bridge reads the stream of pictures, and holds none of them; so a viewer that stands still holds none.
    fn holds_no_picture(&self) {
        assert_eq!(self.robot.pictures().readers, 1, "the bridge reads it");
        let written = self.robot.pictures().written;
        // It may just be copying one.
        until("no picture is held while others are written", || {
            let pictures = self.robot.pictures();
            pictures.written > written + 1 && pictures.holding == 0
        });
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
            "/pictures/source.0/picture",
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

const PEACES: [&str; 2] = ["well", "absent"];
const FAULTS: [&str; 2] = ["frozen", "killed"];

/// Medians of the windows of a round, ns: of both kinds of peace, and of both faults.
struct Round {
    peaces: [Vec<u64>; 2],
    faults: [Vec<u64>; 2],
}

impl Round {
    /// Both kinds of peace and the faults.
    fn take(test: &mut Test<'_>, marks: &[(Mark, &str); 2], freeze: bool) -> Result<Self, Late> {
        let [(frozen_mark, frozen_name), (killed_mark, killed_name)] = marks;
        let (well, mut frozen) = (test.windows()?, Vec::new());
        if freeze {
            test.viewer().freeze();
            frozen = test.windows_over(FREEZE)?;
            test.viewer().go_on();
            test.returned(frozen_mark, frozen_name);
        }
        test.viewer = None;
        let killed = test.windows()?;
        std::thread::sleep(SETTLED);
        let absent = test.windows()?;
        test.restart();
        test.returned(killed_mark, killed_name);
        Ok(Self { peaces: [well, absent], faults: [frozen, killed] })
    }
}

/// Windows with a fault, and in peace, of each round.
type Compared<'a> = Vec<(&'a [u64], &'a [u64])>;

/// The share of pairs of one round with a ratio above [`RATIO_MAX`], and the share that half of them may be by chance.
fn slower(rounds: &Compared<'_>) -> (f64, f64) {
    let (mut above, mut pairs, mut variance) = (0.0, 0.0, 0.0);
    for (fault, peace) in rounds {
        let all = fault.iter().flat_map(|fault| peace.iter().map(move |peace| *fault as f64 / *peace as f64));
        above += all.filter(|ratio| *ratio > RATIO_MAX).count() as f64;
        let (n, m) = (fault.len() as f64, peace.len() as f64);
        pairs += n * m;
        // Of the number of pairs in order, of two samples of one kind.
        variance += n * m * (n + m + 1.0) / 12.0;
    }
    (above / pairs, 0.5 + CHANCE * f64::sqrt(variance) / pairs)
}

/// The middle of all.
fn median_us<'a>(windows: impl Iterator<Item = &'a u64>) -> f64 {
    let mut sorted: Vec<u64> = windows.copied().collect();
    sorted.sort_unstable();
    sorted[sorted.len() / 2] as f64 / 1e3
}

/// What is slower with a fault than in peace; prints all.
fn find_slower(rounds: &[Round], when: &str) -> Vec<String> {
    let mut found = Vec::new();
    for (fault, peace) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        let taken = rounds.iter().filter(|round| !round.faults[fault].is_empty());
        let compared: Compared<'_> = taken.map(|round| (&round.faults[fault][..], &round.peaces[peace][..])).collect();
        if compared.is_empty() {
            continue;
        }
        let (share, most) = slower(&compared);
        let with = median_us(compared.iter().flat_map(|(fault, _)| *fault));
        let without = median_us(compared.iter().flat_map(|(_, peace)| *peace));
        let said = format!(
            "{when}: {} {with:.1} µs, {} {without:.1} µs; {:.0} of 100 pairs above {RATIO_MAX}, at most {:.0}",
            FAULTS[fault],
            PEACES[peace],
            share * 100.0,
            most * 100.0
        );
        println!("{said}");
        if share > most {
            found.push(said);
        }
    }
    found
}

/// What is slower in so many rounds.
fn measure(test: &mut Test<'_>, when: &str, marks: &[(Mark, &str); 2], freeze: bool) -> Result<Vec<String>, Late> {
    let asked = std::env::var("ROHRPOST_TORTURE_ROUNDS").ok();
    let rounds = asked.map_or(ROUNDS, |rounds| rounds.parse().expect("a number of rounds"));
    let taken: Result<Vec<Round>, Late> = (0..rounds).map(|_| Round::take(test, marks, freeze)).collect();
    Ok(find_slower(&taken?, when))
}

#[test]
fn a_viewer_that_misbehaves_does_not_slow_the_robot() {
    unless_stalled(|stalls| {
        let mut test = Test::new(stalls, |_| String::new());
        test.robot.mark(&Mark::Begun(1));
        test.windows()?;
        assert_eq!(test.counts().drawn, 0, "there is no viewer yet");
        test.restart();
        test.returned(&Mark::Begun(2), "Begun");

        test.viewer().freeze();
        test.windows_over(LONG_FREEZE)?;
        test.holds_no_picture();
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
        let slower = [quiet?, flooded?].concat();
        assert!(slower.is_empty(), "with a fault the robot is slower than in peace:\n{}", slower.join("\n"));
        Ok(())
    });
}

/// The measurement can fail: a robot that waits for its viewer is detected.
#[test]
fn a_robot_that_waits_for_its_viewer_is_found_out() {
    unless_stalled(|stalls| {
        let mut test = Test::new(stalls, |port| format!("ask-viewer = {port}"));
        test.restart();
        let before = test.windows()?;
        test.viewer().freeze();
        let with = test.windows()?;
        test.viewer().go_on();
        let (share, most) = slower(&vec![(&with[..], &before[..])]);
        assert!(share > most, "{with:?} ns with a frozen viewer, {before:?} ns before");
        Ok(())
    });
}

/// So is one that is slower by a third, and chance is not.
#[test]
fn a_difference_of_a_third_is_found_and_the_noise_of_a_window_is_not() {
    // The same noise on both sides, in another order: a quarter up and down.
    let noise = |seed: u64| (0..WINDOWS).map(move |window| 90 + (u64::from(window) * 7 + seed * 5) % 12 * 5);
    let is_slower = |percent: u64| {
        let rounds: Vec<(Vec<u64>, Vec<u64>)> = (0..ROUNDS as u64)
            .map(|round| (noise(round).map(|ns| ns * percent).collect(), noise(round + 1).map(|ns| ns * 100).collect()))
            .collect();
        let (share, most) = slower(&rounds.iter().map(|(fault, peace)| (&fault[..], &peace[..])).collect());
        share > most
    };
    assert_eq!([100, 110, 133, 200].map(is_slower), [false, false, true, true]);
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
