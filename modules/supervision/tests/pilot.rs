//! The shipped pilot under the envelope: it hardly notices.

use rohrpost_modules::types::Twist;
use rohrpost_robot::pilot::{Pilot, Settings as PilotSettings};
use rohrpost_robot::simulator::{Settings as RobotSettings, Simulator};
use rohrpost_robot::world::World;
use rohrpost_supervision::{Command, Envelope, Limits, Mounting, Scan, Verdict};
use std::collections::BTreeSet;

const TENTH_NS: u64 = 100_000_000;
const SEEDS: u64 = 6;

/// What a drive of three minutes came to.
#[derive(Debug, Default)]
struct Drive {
    bumps: u64,
    commands: u64,
    changed: u64,
    /// Squares of 2 m that it was in.
    places: BTreeSet<(i64, i64)>,
}

fn drive(seed: u64, is_supervised: bool) -> Drive {
    let world = World::parse(include_str!("../../../config/building.map")).expect("it is a map");
    let robot = RobotSettings { seed, ..RobotSettings::default() };
    let limits = Limits {
        radius_m: robot.radius_m,
        margin_m: 0.05,
        speed_max_m_s: robot.speed_max_m_s,
        turn_rate_max_rad_s: robot.turn_rate_max_rad_s,
        braking_m_s2: robot.acceleration_max_m_s2,
        turn_braking_rad_s2: robot.turn_acceleration_max_rad_s2,
        lag_s: 0.02,
        look_s: 0.11,
        others_m_s: 0.0,
    };
    let (mut robot, mut motion) = (Simulator::new(world, robot), limits.motion());
    motion.tell(0, Command::STOP);
    let mut pilot = Pilot::new(PilotSettings { seed, ..PilotSettings::default() });
    let envelope = Envelope::new(limits, Mounting::default());
    let mut drive = Drive::default();
    for tenth in 10..1800 {
        let now_ns = tenth * TENTH_NS;
        robot.step_to(now_ns);
        let scan = robot.scan();
        let twist = pilot.drive(&scan);
        let wanted = Command { speed_m_s: twist.speed_m_s, turn_rate_rad_s: twist.turn_rate_rad_s };
        let command = if is_supervised {
            let seen = Scan {
                taken_ns: now_ns,
                start_rad: scan.start_rad.into(),
                step_rad: scan.step_rad.into(),
                range_max_m: scan.range_max_m.into(),
                ranges_m: &scan.ranges_m,
                moving_m: &[],
            };
            let verdict = envelope.check(now_ns, wanted, &seen, &motion);
            drive.commands += 1;
            drive.changed += u64::from(!matches!(verdict, Verdict::Passed(_)));
            verdict.command()
        } else {
            wanted
        };
        motion.tell(now_ns, command);
        let twist = Twist { speed_m_s: command.speed_m_s, turn_rate_rad_s: command.turn_rate_rad_s };
        robot.command(twist, now_ns).expect("it is a number");
        let pose = robot.true_pose();
        drive.places.insert(((pose.x_m / 2.0) as i64, (pose.y_m / 2.0) as i64));
    }
    Drive { bumps: robot.bumps(), ..drive }
}

#[test]
fn it_changes_few_of_its_commands_and_it_sees_as_much() {
    let [mut free, mut supervised] = [0, 0];
    let [mut commands, mut changed] = [0, 0];
    for seed in 1..=SEEDS {
        let (without, with) = (drive(seed, false), drive(seed, true));
        assert_eq!(with.bumps, 0, "seed {seed}");
        free += without.places.len();
        supervised += with.places.len();
        commands += with.commands;
        changed += with.changed;
    }
    assert!(changed * 50 <= commands, "{changed} of {commands} commands were changed; places {free} and {supervised}");
    assert!(supervised * 20 >= free * 19, "it was in {supervised} places, without in {free}");
}
