//! A robot after its program has named a destination, and missed its deadline.

use super::trial::{Drive, Supervision, Trial};
use super::{STEPS, world, worlds};
use rohrpost_modules::types::Pose;
use rohrpost_robot::world::World;
use rohrpost_supervision::{Command, Driver, Limits, Located, Order, Place, Promise, Safety, Settings, Wormhole};

/// How long safety drives.
const FOR_NS: u64 = 12_000_000_000;

/// The wormhole from the moment of the missed deadline on, with a destination in the odometry's frame.
fn greedy(x_m: f64, y_m: f64) -> Drive {
    let mut wormhole = Wormhole::new(Settings::default());
    let _ = wormhole.set_sight(0, true);
    for sequence in 0..2 {
        let order = Order { incarnation: 1, sequence };
        let promise = Promise { order, duration_ns: 1, command: Command::STOP };
        wormhole.promise(0, 0, Driver::Program, promise).1.expect("it is taken");
    }
    let mut safety = None;
    Box::new(move |_, limits: &Limits, now_ns, by_wheels: Pose| {
        let safety = safety.get_or_insert_with(|| {
            let mut safety = Safety::new(limits, FOR_NS);
            let order = Order { incarnation: 1, sequence: 2 };
            safety.set_destination(order, Some(Place { frame: 0, x_m, y_m })).expect("it is a place");
            safety
        });
        let _ = wormhole.look(now_ns);
        let place = Place { frame: 0, x_m: by_wheels.x_m, y_m: by_wheels.y_m };
        let located = Located { place, heading_rad: by_wheels.heading_rad };
        Some(safety.command(now_ns, &wormhole, Some(located)).unwrap_or(Command::STOP))
    })
}

/// A hall with a dead end in the east, 1.8 m ahead.
const HALL: &str = "rohrpost-map 1
cell_m 0.4
map
###############
#             #
#             #
#             #
#      ####   #
#         #   #
#         #   #
#    >    #   #
#         #   #
#         #   #
#      ####   #
#             #
#             #
#             #
###############
";

/// How far the robot ends from its destination, and its speed after its time.
fn driven_to(seed: u64, x_m: f64, y_m: f64) -> (f64, f64) {
    let mut trial =
        Trial::new(seed, |_| World::parse(HALL).expect("it is a map"), greedy(x_m, y_m), Supervision::Envelope);
    assert_eq!(trial.run(FOR_NS / 10_000_000 + 200).bumps, 0, "seed {seed}");
    let by_wheels = trial.robot.odometry();
    (f64::hypot(by_wheels.pose.x_m - x_m, by_wheels.pose.y_m - y_m), by_wheels.twist.speed_m_s)
}

#[test]
fn it_arrives_where_the_way_is_free_and_stands_in_a_dead_end() {
    for seed in 0..20 {
        for (x_m, y_m) in [(1.2, 0.0), (-1.5, 0.5), (-0.5, -1.8)] {
            let (off_m, speed_m_s) = driven_to(seed, x_m, y_m);
            assert!(off_m <= 0.25 && speed_m_s == 0.0, "seed {seed}, to {x_m} {y_m}: {off_m} m off, {speed_m_s} m/s");
        }
        // Behind the wall of the dead end.
        let (off_m, speed_m_s) = driven_to(seed, 2.8, 0.0);
        assert!((1.2..1.6).contains(&off_m) && speed_m_s == 0.0, "seed {seed}: {off_m} m off, {speed_m_s} m/s");
    }
}

#[test]
fn nothing_is_touched_on_the_way() {
    let mut way_m = 0.0;
    for seed in 0..worlds() {
        // All around, up to 4 m away.
        let (sin, cos) = (seed as f64).sin_cos();
        let far_m = 0.5 + 3.5 * (seed % 8) as f64 / 8.0;
        let mut trial = Trial::new(seed, world, greedy(far_m * cos, far_m * sin), Supervision::Envelope);
        let outcome = trial.run(STEPS);
        assert_eq!(outcome.bumps, 0, "seed {seed}: {outcome:?}");
        way_m += outcome.way_m;
    }
    assert!(way_m > worlds() as f64, "the robot hardly drives: {way_m} m");
}
