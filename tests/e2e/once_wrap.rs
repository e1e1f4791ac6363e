//! At most once where numbers wrap.

use crate::harness::{PATIENCE, Place, probe};
use crate::probe::COUNT;

#[test]
fn calls_are_told_apart_where_their_numbers_wrap() {
    for (start, what) in [
        (u32::MAX - 5, "the sequence wraps, and the id with it"),
        (65_530, "the id wraps alone"),
        (u32::MAX / 2 - 5, "the sequence becomes negative as a signed number"),
    ] {
        let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", "")]);
        let mut tool = robot.tool(PATIENCE);
        tool.link.set_next_sequence(start);
        let mut told = Vec::new();
        for round in 0..4u32 {
            // Several at a time, and answers fetched in reverse.
            let calls: Vec<u32> =
                (0..5).map(|call| robot.begin(&mut tool, "probe.0", COUNT, &(round * 5 + call,))).collect();
            for call in calls.into_iter().rev() {
                told.push(tool.link.wait(call, |bytes| rohrpost::wire::from_bytes::<u64>(bytes)).unwrap());
            }
        }
        told.sort_unstable();
        assert_eq!(told, (1..=20).collect::<Vec<u64>>(), "{what}");
        assert_eq!(place.counted(), (0..20).collect::<Vec<u32>>(), "{what}");
        tool.close();
        launch.stop();
    }
}

#[test]
fn calls_with_equal_ids_have_their_own_answers() {
    let (place, mut launch, robot) = Place::running(&[&probe("probe.0", "", "")]);
    let mut tool = robot.tool(PATIENCE);
    let mut calls = Vec::new();
    for number in 0..4u32 {
        // 65536 apart: the same 16 bits.
        tool.link.set_next_sequence(1 + (number << 16));
        calls.push(robot.begin(&mut tool, "probe.0", COUNT, &(number,)));
    }
    for (number, call) in calls.into_iter().enumerate().rev() {
        let told = tool.link.wait(call, |bytes| rohrpost::wire::from_bytes::<u64>(bytes)).unwrap();
        assert_eq!(told, number as u64 + 1);
    }
    assert_eq!(place.counted(), [0, 1, 2, 3]);
    tool.close();
    launch.stop();
}
