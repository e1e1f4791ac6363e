//! Intruders, friends, empty places and made-up objects, as two or three robots tell each other.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_team::group::{GroupSettings, Hello, Notice, Pose};
use rohrpost_team::view::{Object, RECORDS_MAX, Records, ViewSettings};
use rohrpost_team::{Position, RobotId, Team, TeamSettings, Version};

const S: u64 = 1_000_000_000;

fn id(system: u8) -> RobotId {
    RobotId::new(system).unwrap()
}

fn at(x_mm: i32) -> Position {
    Position { x_mm, y_mm: 0 }
}

fn team(me: u8) -> Team {
    Team::new(id(me), 1, 7, settings())
}

fn settings() -> TeamSettings {
    let group = GroupSettings { beat_ns: S / 2, max_age_ns: 2 * S };
    let view = ViewSettings {
        gate_mm: 500,
        sightings: 3,
        certainty_max_age_ns: 10 * S,
        intruder_max_age_ns: 60 * S,
        friend_max_age_ns: 30 * S,
        friend_radius_mm: 300,
        speed_max_mm_s: 1000,
    };
    TeamSettings { group, view, drift_ppb: 50_000, clock_off_ns: S }
}

/// All beat, each at its place, and hear each other.
fn exchange(now_ns: u64, robots: &mut [(&mut Team, i32)]) {
    for from in 0..robots.len() {
        let pose = Some(Pose { position: at(robots[from].1), ..Pose::default() });
        let beat = robots[from].0.beat(now_ns, pose);
        for (to, (other, _)) in robots.iter_mut().enumerate() {
            if to != from {
                let records = [&beat.objects, &beat.synchro].into_iter().flatten();
                records.for_each(|records| other.hear_records(now_ns, records.clone()));
                other.hear_hello(now_ns, &beat.hello);
            }
        }
    }
}

/// A robot sees the obstacle as often as it must.
fn see(robot: &mut Team, now_ns: u64, place: Position) {
    (0..3).for_each(|look| robot.look(now_ns + look, &[place], |_| false));
}

fn one(team: &Team) -> Object {
    let objects = team.view().objects();
    assert_eq!(objects.len(), 1, "{objects:?}");
    objects[0].clone()
}

#[test]
fn an_obstacle_is_an_intruder_after_three_looks_however_many_echoes_one_has() {
    let mut a = team(1);
    a.look(S, &[at(0), at(10), at(20), at(30)], |_| false);
    a.look(2 * S, &[at(0)], |_| false);
    assert!(a.view().objects().is_empty());
    a.look(3 * S, &[at(0)], |_| false);
    assert!(one(&a).certain);
}

#[test]
fn a_friend_is_no_intruder_until_it_has_been_silent_for_long_and_then_may_be_one() {
    let (mut a, mut b, mut d) = (team(1), team(2), team(4));
    exchange(S, &mut [(&mut a, 0), (&mut b, 0), (&mut d, 20_000)]);
    // Silent for 29 s, it may have driven 29 m.
    see(&mut a, 30 * S, at(48_000));
    assert!(a.view().objects().is_empty());
    see(&mut a, 30 * S + 10, at(50_000));
    assert!(one(&a).certain, "further it cannot be");
    assert_eq!(one(&a).may_be, None);

    let (mut a, mut b, mut d) = (team(1), team(2), team(4));
    exchange(S, &mut [(&mut a, 0), (&mut b, 0), (&mut d, 20_000)]);
    exchange(30 * S, &mut [(&mut a, 100_000), (&mut b, 100_000)]);
    see(&mut a, 32 * S, at(48_000));
    exchange(32 * S, &mut [(&mut a, 100_000), (&mut b, 100_000)]);
    let object = one(&b);
    assert!(!object.certain, "it is searched, not blocked");
    let text = b.suspicion(32 * S, &object).unwrap().to_string();
    assert_eq!(text, "may be robot 4, silent for 31 s");
    see(&mut b, 33 * S, at(48_100));
    exchange(33 * S, &mut [(&mut a, 100_000), (&mut b, 100_000)]);
    assert!(one(&a).certain && one(&b).certain, "a second robot has seen it");
    assert_eq!(one(&a).may_be, None);
    // Robot 4 comes back, and is there.
    exchange(34 * S, &mut [(&mut a, 100_000), (&mut b, 100_000), (&mut d, 48_000)]);
    exchange(35 * S, &mut [(&mut a, 100_000), (&mut b, 100_000), (&mut d, 48_000)]);
    assert!(a.view().objects().is_empty() && b.view().objects().is_empty(), "{:?}", a.view().objects());
}

#[test]
fn certain_ends_by_age_and_where_a_robot_that_could_see_it_sees_nothing() {
    let (mut a, mut b) = (team(1), team(2));
    see(&mut a, S, at(0));
    exchange(2 * S, &mut [(&mut a, 9000), (&mut b, 9000)]);
    assert!(one(&b).certain);
    b.look(3 * S, &[], |_| false);
    assert!(one(&b).certain, "it did not look there");
    b.look(3 * S, &[at(400)], |place| place == at(0));
    assert!(one(&b).certain, "something stands within the gate");
    b.look(4 * S, &[], |place| place == at(0));
    exchange(4 * S, &mut [(&mut a, 9000), (&mut b, 9000)]);
    assert!(!one(&a).certain && !one(&b).certain);
    see(&mut a, 5 * S, at(0));
    exchange(5 * S, &mut [(&mut a, 9000), (&mut b, 9000)]);
    assert!(one(&b).certain, "seen again, it is certain again");
    for second in 6..=16 {
        exchange(second * S, &mut [(&mut a, 9000), (&mut b, 9000)]);
    }
    assert!(!one(&b).certain, "after CERTAINTY_MAX_AGE");
    let age_ns = 16 * S - one(&b).seen_ns;
    assert!((11 * S - S / 1000..=11 * S).contains(&age_ns), "{age_ns}");
    for second in 17..=66 {
        exchange(second * S, &mut [(&mut a, 9000), (&mut b, 9000)]);
    }
    assert!(a.view().objects().is_empty() && b.view().objects().is_empty(), "after INTRUDER_MAX_AGE");
}

#[test]
fn the_leader_ends_what_a_lost_observer_saw_and_an_old_copy_does_not_bring_it_back() {
    let (mut a, mut b, mut c) = (team(1), team(2), team(3));
    see(&mut c, S, at(0));
    exchange(S, &mut [(&mut a, 9000), (&mut b, 9000), (&mut c, 9000)]);
    exchange(2 * S, &mut [(&mut a, 9000), (&mut b, 9000), (&mut c, 9000)]);
    let old = b.view().clone().synchro(2 * S, u8::MAX);
    for second in 3..=70 {
        exchange(second * S, &mut [(&mut a, 9000), (&mut b, 9000)]);
        let certain = b.view().objects().first().map(|object| object.certain);
        let expected = match second {
            ..=11 => Some(true),
            13..60 => Some(false),
            63.. => None,
            _ => continue,
        };
        assert_eq!(certain, expected, "after {second} s");
    }
    let digests = b.view().digests();
    b.hear_records(71 * S, old.clone());
    assert_eq!((b.view().digests(), b.view().objects()), (digests, vec![]));
    // A robot that has only the old copy gets the rest.
    let mut d = team(4);
    d.hear_records(71 * S, old);
    assert_eq!(d.view().objects().len(), 1);
    for second in 72..76 {
        exchange(second * S, &mut [(&mut a, 9000), (&mut b, 9000), (&mut d, 9000)]);
    }
    assert!(d.view().objects().is_empty());
}

#[test]
fn only_its_station_ends_a_made_up_intruder() {
    let (mut a, mut station) = (team(1), team(200));
    let fake = station.add_fake(S, at(0));
    exchange(S, &mut [(&mut a, 9000), (&mut station, 0)]);
    a.look(2 * S, &[], |_| true);
    exchange(200 * S, &mut [(&mut a, 9000), (&mut station, 0)]);
    a.look(201 * S, &[], |_| true);
    assert!(one(&a).certain && one(&a).is_fake, "neither sight nor age ends it");
    exchange(300 * S, &mut [(&mut a, 9000)]);
    assert!(one(&a).certain, "nor that its station is silent");
    assert!(!a.end_fake(300 * S, fake), "it is not this robot's");
    assert!(station.end_fake(300 * S, fake) && !station.end_fake(300 * S, fake));
    exchange(300 * S, &mut [(&mut a, 9000), (&mut station, 0)]);
    assert!(a.view().objects().is_empty());
}

#[test]
fn near_sightings_are_one_intruder_of_the_least_id_and_the_newest_place() {
    let (mut a, mut b, mut c) = (team(1), team(2), team(3));
    see(&mut b, S, at(0));
    see(&mut c, S, at(800));
    exchange(S, &mut [(&mut a, 9000), (&mut b, 9000), (&mut c, 9000)]);
    assert_eq!(a.view().objects().len(), 2, "further apart than the gate");
    see(&mut a, 2 * S, at(400));
    exchange(2 * S, &mut [(&mut a, 9000), (&mut b, 9000), (&mut c, 9000)]);
    let object = one(&c);
    assert_eq!((object.id.observer, object.position), (id(1), at(400)), "both are near the third, which follows both");
    assert_eq!(object.observers, [id(1), id(2), id(3)].into());
    assert_eq!((one(&a).id, one(&a).position), (object.id, object.position));
}

#[test]
fn a_ledger_is_bounded_and_forgetting_starts_no_synchro() {
    let (mut a, mut b) = (team(1), team(2));
    exchange(S, &mut [(&mut a, 0), (&mut b, 0)]);
    for n in 0..200_u64 {
        let (now_ns, place) = ((2 + n) * S, at(10_000 + 2000 * n as i32));
        see(&mut a, now_ns, place);
        a.look(now_ns + S / 4, &[], |seen| seen == place);
        let first = a.beat(now_ns + S / 2, None);
        assert_eq!(first.synchro, None, "{n}");
        first.objects.into_iter().for_each(|records| b.hear_records(now_ns + S / 2, records));
        b.hear_hello(now_ns + S / 2, &first.hello);
        let answer = b.beat(now_ns + S / 2, None);
        assert_eq!(answer.synchro, None, "{n}");
        a.hear_hello(now_ns + S / 2, &answer.hello);
        assert!(a.view().ledgers()[&id(1)].records.len() <= RECORDS_MAX);
        assert_eq!(a.view().digests(), b.view().digests(), "{n}");
    }
    assert!(a.view().ledgers()[&id(1)].floor > Version::default());
}

#[test]
fn a_view_of_more_than_one_message_comes_in_several() {
    let (mut a, mut b) = (team(1), team(2));
    for observer in 100..116 {
        let mut station = team(observer);
        for n in 0..RECORDS_MAX as i32 {
            station.add_fake(S, at(2000 * n));
        }
        a.hear_records(S, station.beat(S, None).objects.unwrap());
    }
    let mut beats = 0;
    while a.view().digests() != b.view().digests() {
        beats += 1;
        assert!(beats < 10, "{:?}", b.view().digests());
        exchange((1 + beats) * S, &mut [(&mut a, 0), (&mut b, 0)]);
    }
    assert!(beats > 2, "{beats}: all came at once");
}

#[test]
fn robots_with_other_maps_are_told_and_their_records_left_alone() {
    let mut a = team(1);
    let mut other = Records { from: id(2), map: 8, is_synchro: true, ledgers: Default::default() };
    let mut b = team(2);
    see(&mut b, S, at(0));
    let beat = b.beat(S, None);
    other.ledgers = beat.objects.unwrap().ledgers;
    a.hear_records(S, other);
    a.hear_hello(S, &Hello { map: 8, ..beat.hello });
    assert!(a.view().objects().is_empty() && a.group().leader(S) == id(1) && a.group().group(S) == id(2));
    assert_eq!(a.group().notices().iter().collect::<Vec<_>>(), [&Notice::OtherMap(id(2))]);
    assert!(!a.agrees(S));
}

#[test]
fn robots_with_other_trees_of_events_are_told() {
    let (mut a, mut b) = (team(1), team(2));
    for (own, other, is_told) in [(0, 0, false), (5, 0, false), (0, 6, false), (5, 6, true), (6, 6, false)] {
        a.set_tree(own);
        b.set_tree(other);
        let now_ns = S * u64::from(b.group().version().counter + 1);
        a.hear_hello(now_ns, &b.beat(now_ns, None).hello);
        assert_eq!(a.group().notices().contains(&Notice::OtherTree(id(2))), is_told, "{own} and {other}");
    }
}

#[test]
fn two_robots_of_one_id_are_told_and_do_not_race() {
    let (mut a, mut twin, mut b) = (team(1), team(1), team(2));
    for second in 1..40 {
        exchange(second * S, &mut [(&mut a, 0), (&mut twin, 0), (&mut b, 0)]);
    }
    let incarnations = [&a, &twin].map(|robot| robot.group().version().incarnation);
    assert!(incarnations.iter().all(|incarnation| *incarnation <= 3), "{incarnations:?}");
    assert!([&a, &twin].iter().any(|it| it.group().notices().contains(&Notice::Duplicate(id(1)))));
    assert!(b.group().notices().contains(&Notice::Duplicate(id(1))), "{:?}", b.group().notices());
}

#[test]
fn a_hello_is_read_as_written_has_its_size_and_damage_is_refused() {
    let mut a = team(1);
    for other in (2..=64).map(id) {
        let mut robot = Team::new(other, 9, 7, settings());
        a.hear_hello(S, &robot.beat(S, None).hello);
    }
    let hello = a.beat(2 * S, Some(Pose { position: at(-5), heading_mrad: -3, speed_mm_s: 7 })).hello;
    let bytes = hello.encode();
    assert_eq!(bytes.len(), 96 + 12 * 63);
    let read = Hello::decode(&bytes).unwrap();
    assert_eq!((read.entries.len(), read.pose, read.sent_ns), (63, hello.pose, 2 * S));
    assert_eq!(read.encode(), bytes);
    for len in 0..bytes.len() {
        assert!(Hello::decode(&bytes[..len]).is_err(), "{len}");
    }
    for (at, byte, why) in [
        (0, b'X', "byte 3: a hello begins with `H` and layout 1"),
        (2, 0x80, "byte 3: a hello has three flags"),
        (3, 0, "byte 4: a robot's number is 1 to 254"),
        (12, 64, "message ends or goes on at byte 852, which its counts do not say"),
        (12, 62, "message ends or goes on at byte 840, which its counts do not say"),
        (108, 2, "byte 120: entries ascend, without the sender"),
    ] {
        let mut damaged = bytes.clone();
        damaged[at] = byte;
        assert_eq!(Hello::decode(&damaged).unwrap_err().to_string(), why);
    }
}
