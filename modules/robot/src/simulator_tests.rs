use super::*;
use proptest::prelude::*;

const HALL: &str = concat!(
    "rohrpost-map 1\ncell_m 1\nmap\n",
    "##############\n#            #\n#            #\n#  >         #\n#            #\n#            #\n##############\n"
);
const FORWARD: Twist = Twist { speed_m_s: 0.5, turn_rate_rad_s: 0.0 };
const TENTH_NS: u64 = 100_000_000;

fn robot(settings: Settings) -> Simulator {
    Simulator::new(World::parse(HALL).unwrap(), settings)
}

/// Repeats the command at 10 Hz from `from_ns` on; gives the time after.
fn drive(robot: &mut Simulator, twist: Twist, from_ns: u64, tenths: u64) -> u64 {
    for tenth in 0..tenths {
        robot.command(twist, from_ns + tenth * TENTH_NS).unwrap();
    }
    robot.step_to(from_ns + tenths * TENTH_NS);
    from_ns + tenths * TENTH_NS
}

#[test]
fn speeds_up_and_cruises_within_the_limits() {
    let mut robot = robot(Settings::default());
    robot.command(FORWARD, 0).unwrap();
    robot.step_to(200_000_000);
    assert!((robot.odometry().twist.speed_m_s - 0.2).abs() < 1e-9, "1 m/s² for 0.2 s");
    drive(&mut robot, Twist { speed_m_s: 99.0, turn_rate_rad_s: -99.0 }, 200_000_000, 30);
    assert_eq!(robot.odometry().twist, Twist { speed_m_s: 0.7, turn_rate_rad_s: -1.5 });
}

#[test]
fn without_commands_it_brakes_after_the_dead_man_time() {
    let mut robot = robot(Settings::default());
    let end_ns = drive(&mut robot, FORWARD, 0, 20);
    let last_command_ns = end_ns - TENTH_NS;
    robot.step_to(last_command_ns + 500_000_000);
    assert_eq!(robot.odometry().twist.speed_m_s, 0.5, "not yet");
    robot.step_to(last_command_ns + 700_000_000);
    assert!((robot.odometry().twist.speed_m_s - 0.3).abs() < 1e-9, "braking, not stopping dead");
    robot.step_to(last_command_ns + 1_100_000_000);
    assert_eq!(robot.odometry().twist.speed_m_s, 0.0);
}

#[test]
fn another_time_moves_nothing_and_keeps_the_age_of_the_last_command() {
    const HOUR_NS: u64 = 3_600_000_000_000;
    for new_ns in [3 * HOUR_NS, HOUR_NS] {
        let mut robot = robot(Settings::default());
        let end_ns = drive(&mut robot, FORWARD, 2 * HOUR_NS, 20);
        assert_eq!(end_ns - TENTH_NS, 2 * HOUR_NS + 19 * TENTH_NS, "the last command is a tenth old");
        let before = robot.true_pose();
        robot.set_time(new_ns);
        assert_eq!((robot.step_to(new_ns), robot.true_pose()), (Stepped { steps: 0, skipped: 0 }, before));
        robot.step_to(new_ns + 400_000_000);
        assert_eq!(robot.odometry().twist.speed_m_s, 0.5, "not dead yet");
        robot.step_to(new_ns + 600_000_000);
        assert!((robot.odometry().twist.speed_m_s - 0.3).abs() < 1e-9, "braking");
    }
}

#[test]
fn a_wall_stops_it_and_counts_once() {
    let mut robot = robot(Settings::default());
    let now_ns = drive(&mut robot, FORWARD, 0, 400);
    assert_eq!(robot.bumps(), 1, "leaning against the wall is one bump");
    let x_m = robot.true_pose().x_m;
    assert!((12.74..=12.75).contains(&x_m), "stands before the wall at 13 m less the radius, not at {x_m}");
    let now_ns = drive(&mut robot, Twist { speed_m_s: -0.3, turn_rate_rad_s: 0.0 }, now_ns, 20);
    assert!(robot.true_pose().x_m < 12.4, "comes free backwards");
    drive(&mut robot, FORWARD, now_ns, 40);
    assert_eq!(robot.bumps(), 2);
}

#[test]
fn late_callers_are_bounded() {
    let mut robot = robot(Settings::default());
    robot.command(FORWARD, 0).unwrap();
    assert_eq!(robot.step_to(3_600_000_000_000), Stepped { steps: 500, skipped: 359_500 });
    assert!(robot.true_pose().x_m < 4.2, "one command drives for the dead-man time only");
    assert_eq!(robot.step_to(0), Stepped::default(), "the past is over");
    assert_eq!(robot.step_to(3_600_010_000_000), Stepped { steps: 1, skipped: 0 });
    assert_eq!(robot.step_to(u64::MAX).steps, 500);
}

#[test]
fn nonsense_is_no_command() {
    let mut robot = robot(Settings::default());
    assert!(robot.command(Twist { speed_m_s: f64::NAN, turn_rate_rad_s: 0.0 }, 0).is_err());
    assert!(robot.command(Twist { speed_m_s: 0.0, turn_rate_rad_s: f64::INFINITY }, 0).is_err());
    robot.step_to(2_000_000_000);
    assert_eq!(robot.true_pose(), robot.world().start());
}

#[test]
fn odometry_drifts_but_follows() {
    let mut drifting = robot(Settings { seed: 7, ..Settings::default() });
    let mut exact = robot(Settings { seed: 7, wheel_noise: 0.0, wheel_scale_error: 0.0, ..Settings::default() });
    for robot in [&mut drifting, &mut exact] {
        drive(robot, Twist { speed_m_s: 0.3, turn_rate_rad_s: 0.3 }, 0, 600);
        assert_eq!(robot.bumps(), 0);
    }
    let error = |robot: &Simulator| {
        let moved = Pose::from(robot.world().start().isometry().inverse() * robot.true_pose().isometry());
        (moved.x_m - robot.odometry().pose.x_m).hypot(moved.y_m - robot.odometry().pose.y_m)
    };
    assert!(error(&exact) < 1e-6, "{}", error(&exact));
    assert!((0.005..1.5).contains(&error(&drifting)), "after 18 m: {}", error(&drifting));
}

#[test]
fn scanner_sees_the_walls() {
    let scanner = Scanner { beams: 181, range_max_m: 8.0, range_noise_m: 0.0, ..Scanner::default() };
    let mut robot = robot(Settings { scanner, ..Settings::default() });
    let scan = robot.scan();
    assert_eq!((scan.ranges_m.len(), scan.pose), (181, None));
    assert!((scan.angle_rad(180) - 0.5 * std::f64::consts::PI).abs() < 1e-5);
    assert!((scan.ranges_m[0] - 2.5).abs() < 1e-4, "the wall on the right: {}", scan.ranges_m[0]);
    assert_eq!(scan.ranges_m[90], 8.0, "nothing ahead within reach");
    assert!(scan.hits().count() < 181);
}

#[test]
fn scanner_is_where_it_is_mounted() {
    let mounting = Pose { x_m: 0.2, y_m: 0.0, heading_rad: std::f64::consts::PI };
    let scanner = Scanner { beams: 4, field_of_view_rad: TAU, range_noise_m: 0.0, mounting, ..Scanner::default() };
    let mut robot = robot(Settings { scanner, ..Settings::default() });
    // Beams at -180°, -90°, 0° and 90° of a scanner that looks back: ahead, left, back, right of the robot.
    let expected = [8.0, 2.5, 2.7, 2.5];
    for (range_m, expected_m) in robot.scan().ranges_m.iter().zip(expected) {
        assert!((range_m - expected_m).abs() < 1e-4, "{range_m}, not {expected_m}");
    }
}

#[test]
fn range_noise_has_the_spread_asked_for() {
    let scanner =
        Scanner { beams: 1, field_of_view_rad: 0.0, range_noise_m: 0.05, range_max_m: 20.0, ..Scanner::default() };
    let mut robot = robot(Settings { scanner, ..Settings::default() });
    let readings: Vec<f64> = (0..2000).map(|_| f64::from(robot.scan().ranges_m[0])).collect();
    let mean_m = readings.iter().sum::<f64>() / 2000.0;
    let spread_m = (readings.iter().map(|reading| (reading - mean_m).powi(2)).sum::<f64>() / 2000.0).sqrt();
    assert!((mean_m - 9.5).abs() < 0.01 && (spread_m - 0.05).abs() < 0.005, "{mean_m} ± {spread_m}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn the_same_seed_and_commands_give_the_same_bits(
        seed: u64,
        commands in prop::collection::vec((-1.0..1.0, -2.0..2.0), 1..60),
    ) {
        let run = |scans_each: usize| {
            let mut robot = robot(Settings { seed, ..Settings::default() });
            for (tenth, (speed_m_s, turn_rate_rad_s)) in commands.iter().enumerate() {
                let twist = Twist { speed_m_s: *speed_m_s, turn_rate_rad_s: *turn_rate_rad_s };
                robot.command(twist, tenth as u64 * TENTH_NS).unwrap();
                for _ in 0..scans_each { robot.scan(); }
            }
            robot
        };
        let (mut one, mut same, looked) = (run(1), run(1), run(3));
        prop_assert_eq!(one.scan(), same.scan());
        prop_assert_eq!(one.odometry(), looked.odometry(), "looking more often changes no motion");
        prop_assert_eq!(one.true_pose(), looked.true_pose());
    }

    #[test]
    fn it_is_never_inside_a_wall(commands in prop::collection::vec((-1.0..1.0, -2.0..2.0), 1..200)) {
        let mut robot = robot(Settings::default());
        for (index, (speed_m_s, turn_rate_rad_s)) in commands.into_iter().enumerate() {
            robot.command(Twist { speed_m_s, turn_rate_rad_s }, index as u64 * 4 * TENTH_NS).unwrap();
            let pose = robot.true_pose();
            prop_assert!(!robot.world().disc_collides(pose.x_m, pose.y_m, 0.25));
        }
    }
}
