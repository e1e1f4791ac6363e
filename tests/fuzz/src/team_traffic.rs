//! Traffic messages: what is read is written again as it was, and whatever a teammate says, a robot goes from path to
//! path, and what it sends can be read.

use rohrpost_team::coordination::{Planner, Traffic, TrafficMessage, TrafficSettings};
use rohrpost_team::grid::{Cell, Map};
use rohrpost_team::{RobotId, Version};

const S: u64 = 1_000_000_000;
const MAP: u64 = 0x1122_3344_5566_7788;

const SETTINGS: TrafficSettings = TrafficSettings {
    beat_ns: S / 2,
    max_age_ns: 2 * S,
    forget_ns: 20 * S,
    delay_max_ns: S / 10,
    step_min_ns: S,
    claim_ns: 3 * S,
    stall_ns: 4 * S,
    agree_ns: S,
    extend_ns: S,
    looks_max: 20,
};

/// Lets a robot go on for some seconds, its body where it may be.
fn go(robot: &mut Traffic, planner: &mut Planner, seconds: std::ops::Range<u64>) {
    for now_ns in seconds.flat_map(|second| [second * S, second * S + S / 2]) {
        if let Some(message) = robot.poll(now_ns, planner) {
            assert_eq!(TrafficMessage::decode(&message.encode()).as_ref(), Ok(&message));
        }
        if let Some(next) = robot.next_cell() {
            robot.set_place(Some(next));
        }
    }
}

pub(crate) fn run(data: &[u8]) {
    let Ok(message) = TrafficMessage::decode(data) else { return };
    assert_eq!(message.encode(), data);
    let mut planner = Planner::new(Map::read(b"......\n.*..*.\n......\n").expect("it is a map").grid);
    let me = RobotId::new(7).expect("no reserved number");
    let mut robot = Traffic::new(me, 1, MAP, SETTINGS, 0);
    robot.set_place(Some(Cell { column: 3, row: 2 }));
    robot.set_goal(Some(Cell { column: 0, row: 0 }));
    go(&mut robot, &mut planner, 0..4);
    // A teammate that repeats itself, and agrees with all that the robot says.
    let mut said = TrafficMessage { map: MAP, version: Version::default(), ..message };
    for second in 4..12 {
        said.version = said.version.next();
        robot.hear(second * S, &said);
        robot.set_goal(Some(Cell { column: second as u32 % 6, row: 0 }));
        if let Some(own) = robot.poll(second * S, &mut planner) {
            (said.round, said.digest) = (own.round, own.digest);
            said.echoes.extend(own.claim.map(|claim| (me, claim.number)));
        }
        go(&mut robot, &mut planner, second..second + 1);
    }
    go(&mut robot, &mut planner, 12..40);
}
