use super::*;
use core::f64::consts::FRAC_PI_2;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::vec::Vec;

extern crate std;

const MS: u64 = 1_000_000;
const BEAMS: usize = 181;

fn limits() -> Limits {
    Limits {
        radius_m: 0.25,
        margin_m: 0.05,
        speed_max_m_s: 1.0,
        turn_rate_max_rad_s: 1.5,
        braking_m_s2: 1.0,
        turn_braking_rad_s2: 4.0,
        lag_s: 0.1,
        look_s: 0.1,
        others_m_s: 0.0,
    }
}

/// A scan of half a turn, taken 100 ms before; each beam by its direction in degrees.
fn ranges(range_m: impl Fn(f64) -> f32) -> Vec<f32> {
    (0..BEAMS).map(|beam| range_m(beam as f64 - 90.0)).collect()
}

fn scan(ranges_m: &[f32]) -> Scan<'_> {
    let step_rad = PI / (BEAMS - 1) as f64;
    Scan { taken_ns: 900 * MS, start_rad: -FRAC_PI_2, step_rad, range_max_m: 8.0, ranges_m, moving_m: &[] }
}

/// A robot that stood.
fn check_of(limits: Limits, command: (f64, f64), ranges_m: &[f32]) -> Verdict {
    let mut motion = limits.motion();
    motion.tell(0, Command::STOP);
    motion.tell(800 * MS, Command::STOP);
    let command = Command { speed_m_s: command.0, turn_rate_rad_s: command.1 };
    // A second and more of braking: it stands by now.
    let now_ns = 10_000 * MS;
    let scan = Scan { taken_ns: now_ns - 100 * MS, ..scan(ranges_m) };
    Envelope::new(limits, Mounting::default()).check(now_ns, command, &scan, &motion)
}

fn check(command: (f64, f64), ranges_m: &[f32]) -> Verdict {
    check_of(limits(), command, ranges_m)
}

fn passes(command: (f64, f64), ranges_m: &[f32]) -> bool {
    matches!(check(command, ranges_m), Verdict::Passed(_))
}

#[test]
fn in_the_open_a_command_passes_as_it_is_and_one_beyond_the_motor_is_cut() {
    let open = ranges(|_| 8.0);
    for command in [(0.0, 0.0), (1.0, 0.0), (1.0, 0.8), (0.5, -0.8), (0.0, 1.5)] {
        assert!(passes(command, &open), "{command:?}");
    }
    let cut = Command { speed_m_s: 1.0, turn_rate_rad_s: 0.0 };
    assert_eq!(check((9.0, 0.0), &open), Verdict::Capped(Capped { to: cut, why: Why::Limit }));
}

/// `v * (look + lag) + v² / 2b = way`, of a wall ahead; by hand.
#[test]
fn towards_a_wall_the_speed_is_that_with_which_the_robot_still_stops() {
    for (wall_m, speed_m_s) in [(1.0, 1.0), (0.6, 0.6), (0.52, 0.4928)] {
        let wall = ranges(|degrees| (wall_m / degrees.to_radians().cos().max(0.01)).min(8.0) as f32);
        let told = check((1.0, 0.0), &wall).command().speed_m_s;
        assert!((told - speed_m_s).abs() < 0.001, "{wall_m} m: {told} m/s");
    }
    let near = ranges(|degrees| (0.301 / degrees.to_radians().cos().max(0.01)).min(8.0) as f32);
    assert!(check((1.0, 0.0), &near).command().speed_m_s < 0.01);
}

#[test]
fn what_is_beside_or_behind_the_way_does_not_matter_and_turning_on_the_spot_always_passes() {
    let corridor = ranges(|degrees| (0.31 / degrees.to_radians().sin().abs().max(0.01)).min(8.0) as f32);
    assert!(passes((0.5, 0.0), &corridor));
    assert!(!passes((0.5, 1.0), &corridor), "into the wall");
    let enclosed = ranges(|_| 0.26);
    assert!(passes((0.0, 1.5), &enclosed) && passes((0.0, -1.5), &enclosed));
    assert_eq!(check((0.5, 0.0), &enclosed), Verdict::Refused(Why::Seen));
}

#[test]
fn a_thing_at_the_side_ahead_stops_the_turn_towards_it_alone() {
    let left = ranges(|degrees| if (25.0..45.0).contains(&degrees) { 0.5 } else { 8.0 });
    assert!(passes((0.5, -0.2), &left));
    assert!(!passes((0.5, 0.8), &left));
}

#[test]
fn unseen_is_blocked() {
    let open = ranges(|_| 8.0);
    assert_eq!(check((-0.5, 0.0), &open), Verdict::Refused(Why::Unseen), "backward without eyes");
    for blind in [f32::NAN, 0.0, -1.0] {
        let half_blind = |from: f64| ranges(|degrees| if (from..from + 10.0).contains(&degrees) { blind } else { 8.0 });
        assert_eq!(check((1.0, 0.0), &half_blind(0.0)), Verdict::Refused(Why::Unseen));
        assert!(passes((1.0, 0.0), &half_blind(60.0)), "beside the way");
    }
}

/// By its maker's code, a reading beyond the range says that nothing came back.
#[test]
fn what_is_beyond_the_range_is_not_known() {
    let mut motion = limits().motion();
    motion.tell(0, Command::STOP);
    let now_ns = 10_000 * MS;
    for nothing in [4.0, f32::INFINITY] {
        let ranges_m = ranges(|_| nothing);
        let scan = Scan { taken_ns: now_ns, range_max_m: 0.6, ..scan(&ranges_m) };
        let forward = Command { speed_m_s: 1.0, turn_rate_rad_s: 0.0 };
        let told = Envelope::new(limits(), Mounting::default()).check(now_ns, forward, &scan, &motion).command();
        assert!((told.speed_m_s - 0.6).abs() < 0.001, "{told:?}");
    }
}

#[test]
fn what_moves_is_kept_away_from_further() {
    let wall = ranges(|degrees| (1.2 / degrees.to_radians().cos().max(0.01)).min(8.0) as f32);
    let [still, walking] = [0.0, 0.5].map(|others_m_s| check_of(Limits { others_m_s, ..limits() }, (1.0, 0.0), &wall));
    assert_eq!(still.command().speed_m_s, 1.0);
    assert!(walking.command().speed_m_s < 0.7, "{walking:?}");
}

/// Walls on both sides, known up to a thickness: what they hide may come through as soon as it has had the time.
#[test]
fn what_a_known_wall_hides_is_kept_away_from_as_what_is_seen_there() {
    let walls = ranges(|degrees| (0.5 / degrees.to_radians().sin().abs().max(0.01)).min(8.0) as f32);
    let mut motion = limits().motion();
    motion.tell(0, Command::STOP);
    let now_ns = 10_000 * MS;
    let speed_m_s = |thick_m: f32| {
        let moving_m: Vec<f32> = walls.iter().map(|range_m| range_m + thick_m).collect();
        let scan = Scan { taken_ns: now_ns - 100 * MS, moving_m: &moving_m, ..scan(&walls) };
        let envelope = Envelope::new(Limits { others_m_s: 0.5, ..limits() }, Mounting::default());
        envelope.check(now_ns, Command { speed_m_s: 0.5, turn_rate_rad_s: 0.0 }, &scan, &motion).command().speed_m_s
    };
    assert_eq!([0.0, 0.1, 1.0].map(speed_m_s), [0.0, 0.0, 0.5]);
}

#[test]
fn a_robot_of_which_nothing_is_known_may_be_as_fast_as_it_can() {
    let (limits, wall) = (limits(), ranges(|degrees| (0.9 / degrees.to_radians().cos().max(0.01)).min(8.0) as f32));
    let unknown = Envelope::new(limits, Mounting::default()).check(
        1000 * MS,
        Command { speed_m_s: 0.3, turn_rate_rad_s: 0.0 },
        &scan(&wall),
        &limits.motion(),
    );
    assert!(matches!(unknown, Verdict::Refused(_)), "{unknown:?}");
    assert!(passes((0.3, 0.0), &wall));
}

/// The robot rolls out in the turn: into the wall beside it.
#[test]
fn a_robot_that_still_rolls_turns_only_where_there_is_room_for_that() {
    let limits = limits();
    // A wall to the left, seen all around.
    let wall_m = |degrees: u16| 0.4 / f64::from(degrees).to_radians().sin().max(0.01);
    let beside: Vec<f32> = (0..360).map(|degrees| wall_m(degrees).min(8.0) as f32).collect();
    let mut motion = limits.motion();
    motion.tell(0, Command::STOP);
    motion.tell(5000 * MS, Command { speed_m_s: 1.0, turn_rate_rad_s: 0.0 });
    let now_ns = 10_000 * MS;
    let scan = Scan { taken_ns: now_ns - 100 * MS, start_rad: 0.0, ..scan(&beside) };
    let envelope = Envelope::new(limits, Mounting::default());
    let turn = |turn_rate_rad_s| envelope.check(now_ns, Command { speed_m_s: 0.0, turn_rate_rad_s }, &scan, &motion);
    assert!(matches!(turn(1.5), Verdict::Refused(_)));
    assert!(matches!(turn(-1.5), Verdict::Passed(_)));
}

#[test]
fn a_scanner_that_is_mounted_elsewhere_sees_the_same_wall() {
    let mounting = Mounting { x_m: 0.15, y_m: 0.1, heading_rad: 0.5 };
    let wall_m = 0.6;
    let mounted: Vec<f32> = (0..360)
        .map(|beam| {
            let direction_rad = mounting.heading_rad - PI + f64::from(beam) * PI / 180.0;
            let ahead = direction_rad.cos();
            if ahead > 0.01 { ((wall_m - mounting.x_m) / ahead).min(8.0) as f32 } else { 8.0 }
        })
        .collect();
    let mut motion = limits().motion();
    motion.tell(0, Command::STOP);
    let now_ns = 10_000 * MS;
    let scan = Scan {
        taken_ns: now_ns,
        start_rad: -PI,
        step_rad: PI / 180.0,
        range_max_m: 8.0,
        ranges_m: &mounted,
        moving_m: &[],
    };
    let forward = Command { speed_m_s: 1.0, turn_rate_rad_s: 0.0 };
    let told = Envelope::new(limits(), mounting).check(now_ns, forward, &scan, &motion).command();
    assert!((told.speed_m_s - 0.6).abs() < 0.001, "{told:?}");
}

/// Points that are too far to matter are left out: the reach is that of all of them.
#[test]
fn the_reach_is_the_least_of_all_points_and_no_more_than_enough() {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let envelope = Envelope::new(limits(), Mounting { x_m: 0.1, y_m: -0.05, heading_rad: 0.3 });
    let mut cut = 0;
    for _ in 0..2_000 {
        let nearest_m = random.random_range(0.1..3.0);
        let ranges_m: Vec<f32> = (0..360).map(|_| random.random_range(nearest_m..4.0)).collect();
        let moving_m: Vec<f32> = ranges_m.iter().map(|range_m| range_m + random.random_range(-1.0..1.0)).collect();
        let step_rad = TAU / ranges_m.len() as f64;
        let scan = Scan { step_rad, start_rad: 0.0, moving_m: &moving_m, ..scan(&ranges_m) };
        let right_rad: f64 = random.random_range(-FRAC_PI_2..0.0);
        let left_rad = random.random_range(0.0..FRAC_PI_2);
        let sector = Sector { right: Direction::of(right_rad), left: Direction::of(left_rad), is_wide: false };
        let (others_m, enough_m) = (random.random_range(0.0..0.5), random.random_range(0.0..3.0));
        let point = |beam: usize, range_m: f64, radius_m: f64| {
            let beam = Direction::of(0.3 + beam as f64 * step_rad);
            sector.contact_m(0.1 + range_m * beam.x, -0.05 + range_m * beam.y, radius_m)
        };
        let reaches = ranges_m.iter().zip(&moving_m).enumerate().map(|(beam, (range_m, moving_m))| {
            let moving_m = f64::from(range_m.max(*moving_m));
            point(beam, f64::from(*range_m), 0.3).min(point(beam, moving_m, 0.3 + others_m))
        });
        let least_m = reaches.fold(f64::INFINITY, f64::min);
        let room = envelope.room(&scan, &sector, others_m, enough_m);
        assert!((room.reach_m - least_m.min(enough_m)).abs() < 1e-9, "{room:?}, {least_m} m, {enough_m} m");
        cut += usize::from(least_m < enough_m);
    }
    assert!((200..1_800).contains(&cut), "{cut}");
}
