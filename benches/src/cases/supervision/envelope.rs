//! What the check of a command costs, beside turning each beam into x and y once, which any supervisor with a scan has
//! to do; and that it needs no heap.

use super::robot::BEAMS;
use crate::counting::heap_uses;
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::{End, Failure, Placement, Scheduling, sample_in_child, settle};
use rohrpost_bench_local::rounds::{Contender, at_most, compare};
use rohrpost_bench_local::settings::Settings;
use rohrpost_bench_local::statistics::Summary;
use rohrpost_mailbox::monotonic_ns;
use rohrpost_supervision::{Command, Envelope, Limits, Mounting, Scan};
use std::f64::consts::TAU;
use std::hint::black_box;
use std::time::Duration;

/// Checks of a turn, and those before them that do not count.
const CHECKS: usize = 20_000;
const WARM_UP: usize = 1_000;
/// From one check to the next, as the wormhole sees time: a look.
const LOOK_NS: u64 = 50_000_000;
/// Different scans, so that no processor learns one by heart.
const SCANS: usize = 64;
/// In one room of so many, one beam of as many has no reading.
const UNREAD_EACH: usize = 9;
/// Nav2's collision monitor: a published time of one step, ns. Another program on another computer.
const NAV2_STEP_NS: f64 = 4_450_000.0;
const PATIENCE: Duration = Duration::from_secs(60);
const COMMANDS: [Command; 4] = [
    Command { speed_m_s: 0.5, turn_rate_rad_s: 0.2 },
    Command { speed_m_s: -0.3, turn_rate_rad_s: 0.0 },
    Command { speed_m_s: 0.7, turn_rate_rad_s: -1.0 },
    Command { speed_m_s: 0.0, turn_rate_rad_s: 1.5 },
];

/// The cases of this file.
pub(super) fn cases() -> [Case; 2] {
    let time = Case::new("envelope of 360 beams", None, "ns", |settings, subject| {
        let contenders = [
            Contender::sampled("rohrpost", || timed(settings, checking())),
            Contender::sampled("sin_cos of each beam", || timed(settings, turned)).beside(None, at_most(4.0)),
            Contender::fixed("Nav2's step, published", Summary::single(NAV2_STEP_NS)),
        ];
        Ok(compare(settings, subject, &contenders))
    });
    let heap = Case::new("envelope, heap uses", None, "a check", |settings, subject| {
        let once = Settings { rounds: 1, ..settings.clone() };
        let copied = |scan: &Scan<'_>| drop(black_box(scan.ranges_m.to_vec()));
        let contenders = [
            Contender::single("rohrpost", || counted(settings, checking())),
            Contender::single("copy of the scan", || counted(settings, copied)).beside(at_most(0.0), None),
        ];
        Ok(compare(&once, subject, &contenders))
    });
    [time, heap]
}

/// Each beam as a point, by one sine and cosine.
fn turned(scan: &Scan<'_>) {
    let (mut x_m, mut y_m) = (0.0, 0.0);
    for (beam, range_m) in scan.ranges_m.iter().enumerate() {
        let (sin, cos) = (scan.start_rad + beam as f64 * scan.step_rad).sin_cos();
        x_m += f64::from(*range_m) * cos;
        y_m += f64::from(*range_m) * sin;
    }
    black_box((x_m, y_m));
}

/// The wormhole's check, of a robot that is told to drive forward, backward and to turn, one after the other: so it may
/// roll both ways, and both are checked.
fn checking() -> impl FnMut(&Scan<'_>) {
    let limits = Limits {
        radius_m: 0.25,
        margin_m: 0.05,
        speed_max_m_s: 0.7,
        turn_rate_max_rad_s: 1.5,
        braking_m_s2: 1.0,
        turn_braking_rad_s2: 4.0,
        lag_s: 0.05,
        look_s: 0.07,
        others_m_s: 0.0,
    };
    let envelope = Envelope::new(limits, Mounting { x_m: 0.1, y_m: 0.0, heading_rad: 0.0 });
    let (mut motion, mut now_ns, mut commands) = (limits.motion(), 0, COMMANDS.iter().cycle());
    move |scan| {
        now_ns += LOOK_NS;
        let scan = Scan { taken_ns: now_ns - LOOK_NS / 2, ..*scan };
        let wanted = commands.next().copied().unwrap_or(Command::STOP);
        let verdict = envelope.check(now_ns, wanted, &scan, &motion);
        motion.tell(now_ns, verdict.command());
    }
}

/// Rooms of many sizes, with posts in them.
fn rooms() -> Vec<Vec<f32>> {
    let range_m = |room: usize, beam: usize| match (room % UNREAD_EACH, beam % UNREAD_EACH) {
        (0, 0) => f32::NAN,
        (_, 1) => 0.6 + 0.05 * room as f32,
        _ => 1.0 + 0.1 * room as f32 + 0.5 * (beam as f32 * 0.1).sin(),
    };
    (0..SCANS).map(|room| (0..BEAMS).map(|beam| range_m(room, beam)).collect()).collect()
}

/// Hands on scan after scan; `note` is told what is to be noted around each.
fn each_scan(checks: usize, work: &mut impl FnMut(&Scan<'_>), mut around: impl FnMut(&mut dyn FnMut())) {
    let rooms = rooms();
    for ranges_m in rooms.iter().cycle().take(checks) {
        let step_rad = TAU / BEAMS as f64;
        let scan = Scan { taken_ns: 0, start_rad: 0.0, step_rad, range_max_m: 8.0, ranges_m, moving_m: &[] };
        around(&mut || work(black_box(&scan)));
    }
}

/// ns of each.
fn timed(settings: &Settings, mut work: impl FnMut(&Scan<'_>)) -> Result<Vec<f64>, Failure> {
    let checks = settings.count(CHECKS);
    sample_in_child(PATIENCE, |samples| {
        settle(End::Ping, Placement::OneCore, Scheduling::Fifo)?;
        each_scan(WARM_UP, &mut work, |work| work());
        each_scan(checks, &mut work, |work| {
            let began_ns = monotonic_ns();
            work();
            samples.push((monotonic_ns() - began_ns) as f64);
        });
        Ok(())
    })
}

/// Heap uses of each, on average.
fn counted(settings: &Settings, mut work: impl FnMut(&Scan<'_>)) -> Result<f64, Failure> {
    let checks = settings.count(CHECKS);
    let uses = sample_in_child(PATIENCE, |samples| {
        let mut uses = 0;
        each_scan(checks, &mut work, |work| {
            let before = heap_uses();
            work();
            uses += heap_uses() - before;
        });
        samples.push(uses as f64 / checks as f64);
        Ok(())
    })?;
    uses.first().copied().ok_or_else(|| Failure::Failed("nothing counted".into()))
}
