//! A hello of a team of 64: its bytes, and what it takes to handle it beside reading it.

use super::timed::{WARM_UP, timed};
use super::world::{BEAT_NS, id, settings};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::Failure;
use rohrpost_bench_local::rounds::{Contender, at_most, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_bench_local::statistics::Summary;
use rohrpost_team::Team;
use rohrpost_team::group::{HELLO_ENTRY_BYTES, HELLO_HEAD_BYTES, Hello};

const ROBOTS: u8 = 64;
/// Beats until all know all, and beats of which hellos are measured.
const SETTLED: u64 = 3;
const BEATS: u64 = 20;

pub(super) fn cases() -> [Case; 2] {
    let bytes = Case::new("hello of 64, bytes", None, "bytes", |settings, subject| {
        let once = Settings { rounds: 1, ..settings.clone() };
        let entries = usize::from(ROBOTS) - 1;
        let bound = (HELLO_HEAD_BYTES + entries * HELLO_ENTRY_BYTES) as f64;
        let contenders = [
            Contender::single("rohrpost", || Ok(longest_hello(&Heard::new()))),
            Contender::fixed("96, and 12 a robot", Summary::single(bound)).beside(at_most(1.0), None),
        ];
        Ok(compare(&once, subject, &contenders))
    });
    let handled = Case::new("hello of 64, handled", None, "ns", |settings, subject| {
        let heard = Heard::new();
        let contenders = [
            Contender::sampled("rohrpost", || heard.handled(settings)),
            Contender::sampled("decoding", || heard.decoded(settings)).beside(at_most(2.0), None),
        ];
        Ok(compare(settings, subject, &contenders))
    });
    [bytes, handled]
}

fn longest_hello(heard: &Heard) -> f64 {
    heard.hellos.iter().map(|(_, bytes)| bytes.len()).max().unwrap_or(0) as f64
}

/// What a robot of a settled team hears next.
struct Heard {
    robot: Team,
    /// When each comes, ns, and its bytes.
    hellos: Vec<(u64, Vec<u8>)>,
}

impl Heard {
    fn new() -> Self {
        let mut robots: Vec<Team> = (1..=ROBOTS).map(|system| Team::new(id(system), 1, 7, settings(45))).collect();
        for beat in 1..=SETTLED {
            sound(&mut robots, beat, |_, _| ());
        }
        let (robot, mut hellos) = (robots[0].clone(), Vec::new());
        for beat in SETTLED + 1..=SETTLED + BEATS {
            sound(&mut robots, beat, |now_ns, hello| hellos.push((now_ns, hello.encode())));
        }
        Self { robot, hellos }
    }

    fn decoded(&self, settings: &Settings) -> Result<Vec<f64>, Failure> {
        let mut next = self.hellos.iter().cycle();
        timed(settings.count(self.hellos.len()), || next.next(), |next| next.map(|(_, bytes)| Hello::decode(bytes)))
    }

    fn handled(&self, settings: &Settings) -> Result<Vec<f64>, Failure> {
        let (mut robot, mut next) = (self.robot.clone(), self.hellos.iter());
        let read = || next.next().and_then(|(now_ns, bytes)| Some((*now_ns, Hello::decode(bytes).ok()?)));
        let hear = |read: Option<(u64, Hello)>| {
            read.map(|(now_ns, hello)| {
                robot.hear_hello(now_ns, &hello);
                hello
            })
        };
        timed(settings.count(self.hellos.len() - WARM_UP), read, hear)
    }
}

/// All robots send a hello, one after the other, and all others hear it; `note` gets what the first one hears.
fn sound(robots: &mut [Team], beat: u64, mut note: impl FnMut(u64, &Hello)) {
    for from in 0..robots.len() {
        let now_ns = beat * BEAT_NS + from as u64;
        let hello = robots[from].beat(now_ns, None).hello;
        if from > 0 {
            note(now_ns, &hello);
        }
        robots.iter_mut().for_each(|robot| robot.hear_hello(now_ns, &hello));
    }
}
