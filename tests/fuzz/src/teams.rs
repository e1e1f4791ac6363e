//! Messages of robots of a team: what is read is written again as it was, and whatever a robot is told, what it knows
//! stays bounded, and what it sends can be read.

use rohrpost_team::events::{EventHead, EventType, Flow, LossCause, Plan, Priority, ROOT, Tree};
use rohrpost_team::group::{GroupSettings, Hello};
use rohrpost_team::view::{RECORDS_BYTES_MAX, RECORDS_MAX, Records, ViewSettings};
use rohrpost_team::{Position, RobotId, Team, TeamSettings};

const S: u64 = 1_000_000_000;

/// A robot that knows another one, and has seen something.
fn robot() -> Team {
    let group = GroupSettings { beat_ns: S / 2, max_age_ns: 4 * S };
    let view = ViewSettings {
        gate_mm: 500,
        sightings: 1,
        certainty_max_age_ns: 10 * S,
        intruder_max_age_ns: 60 * S,
        friend_max_age_ns: 30 * S,
        friend_radius_mm: 300,
        speed_max_mm_s: 1000,
    };
    let settings = TeamSettings { group, view, drift_ppb: 50_000, clock_off_ns: S };
    let new = |system| Team::new(RobotId::new(system).expect("no reserved number"), 1, 0, settings);
    let (mut robot, mut other) = (new(7), new(9));
    robot.look(S, &[Position::default()], |_| false);
    other.hear_hello(S, &robot.beat(S, None).hello);
    robot.hear_hello(S, &other.beat(S, None).hello);
    robot
}

/// What the robot sends next can be read, and its view is bounded.
fn check(mut robot: Team) {
    let me = robot.group().me();
    assert!(robot.group().leader(2 * S) <= me && robot.group().group(2 * S) >= me);
    for now_s in [2, 20, 200] {
        let now_ns = now_s * S;
        robot.look(now_ns, &[Position { x_mm: 300, y_mm: 0 }], |_| true);
        let beat = robot.beat(now_ns, None);
        let hello = beat.hello.encode();
        assert!(hello.len() <= 96 + 12 * 253 && Hello::decode(&hello).is_ok());
        for records in [beat.objects, beat.synchro].into_iter().flatten() {
            let bytes = records.encode();
            assert!(bytes.len() <= RECORDS_BYTES_MAX && Records::decode(&bytes).is_ok());
        }
        assert!(robot.view().ledgers().values().all(|ledger| ledger.records.len() <= RECORDS_MAX));
        assert!(robot.view().objects().is_sorted_by_key(|object| object.id));
        let _ = (robot.agrees(now_ns), robot.team_clock(now_ns));
    }
}

pub(crate) fn run_hellos(data: &[u8]) {
    let Ok(hello) = Hello::decode(data) else { return };
    assert_eq!(hello.encode(), data);
    let mut robot = robot();
    robot.hear_hello(2 * S, &hello);
    robot.hear_hello(2 * S, &hello);
    check(robot);
}

pub(crate) fn run_records(data: &[u8]) {
    let Ok(records) = Records::decode(data) else { return };
    assert_eq!(records.encode(), data);
    let mut robot = robot();
    robot.hear_records(2 * S, records.clone());
    let known = robot.view().clone();
    robot.hear_records(2 * S, records);
    assert!(*robot.view() == known, "a repetition changes nothing");
    check(robot);
}

/// A tree with an exception; its leaves count how often they run.
fn tree() -> (Tree<u64, u8>, EventType) {
    let mut plan = Plan::new();
    let object = plan.event("object", Priority::Normal, 8);
    let group = plan.group("group", &[ROOT]);
    let flow = Flow { consumes: &[object], sends: &[object], cycles: &[(object, 3)], ..Flow::default() };
    plan.leaf("updater", &[group], flow, move |runs, first, turn| {
        *runs += 1;
        turn.send(object, *first);
    });
    (plan.build().expect("an exception is declared"), object)
}

pub(crate) fn run_events(data: &[u8]) {
    let Ok((head, payload)) = EventHead::decode(data) else { return };
    assert_eq!([&head.encode(), payload].concat(), data);
    let first = payload.first().copied().unwrap_or(0);
    let ((mut tree, object), mut runs, mut heard) = (tree(), 0, 0);
    for _ in 0..20 {
        heard += u64::from(tree.hear(&head, first).is_ok());
    }
    assert_eq!(heard + tree.refused(), 20);
    while tree.dispatch(0, &mut runs) {}
    assert_eq!(runs + tree.lost(object, LossCause::QueueFull), heard);
    let me = RobotId::new(7).expect("no reserved number");
    let sent = std::iter::from_fn(|| tree.take_sent(me)).inspect(|(reply, _)| assert_eq!(reply.depth, head.depth + 1));
    let sent = sent.count() as u64;
    assert_eq!(sent + tree.lost(object, LossCause::TooDeep), runs);
}
