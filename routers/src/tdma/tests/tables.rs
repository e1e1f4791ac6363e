//! Nodes with different tables on one wire: one is started from an edited file.

use super::world::{CYCLE, File, MS, SECOND, World};
use crate::tdma::Silent;
use crate::time::Role;
use std::time::Duration;

const US: fn(u64) -> Duration = Duration::from_micros;

/// An edit of a file.
type Edit = fn(&mut File);

/// Each field that may be edited, and the edit.
const EDITS: [(&str, Edit); 12] = [
    ("nothing of the slots", |_| {}),
    ("cycle", |file| file.tdma.cycle += US(1_000)),
    ("synchronisation", |file| file.tdma.synchronisation -= US(20)),
    ("guard", |file| file.tdma.guard -= US(10)),
    ("link", |file| file.tdma.link_bytes_s /= 2),
    ("offset", |file| file.tdma.slots.iter_mut().for_each(|slot| slot.offset += US(250))),
    ("length", |file| file.tdma.slots[0].length += US(100)),
    ("period", |file| file.tdma.slots[0].period = 2),
    ("phase", |file| file.tdma.slots[3].phase = 2),
    ("node", |file| (file.tdma.slots[0].node, file.tdma.slots[1].node) = (1, 0)),
    ("order of the masters", |file| file.masters.reverse()),
    ("masters", |file| file.masters = vec![2, 1, 0]),
];

fn edited(edit: Edit, digest: u64) -> File {
    let mut file = File { digest, ..File::right() };
    edit(&mut file);
    file
}

fn is_parted(world: &World, node: u8) -> bool {
    matches!(world.silent(node), Some(Silent::OtherTable { .. }))
}

fn agreed(seed: u64) -> World {
    let mut world = World::new(seed);
    world.start_all();
    assert!(world.run_until(2 * SECOND, World::agrees), "seed {seed}: no agreement at first");
    world.run(SECOND / 4);
    world
}

#[test]
fn a_node_with_an_edited_file_beside_others_sends_nothing() {
    for (seed, (field, edit)) in (0..).zip(EDITS) {
        for (node, digest) in [(0, 3), (1, 9), (2, 9), (0, 9)] {
            let mut world = agreed(seed);
            world.kill(node);
            world.nodes[usize::from(node)].file = edited(edit, digest);
            world.run(20 * MS);
            world.start(node);
            let sent = world.frames_of(node);
            world.run(3 * SECOND);
            let told = format!("`{field}` edited at node {node}, digest {digest}: {:?}", world.silent(node));
            world.assert_alone(&told);
            assert!(is_parted(&world, node) && world.frames_of(node) == sent, "{told}");
            let others: Vec<u8> = (0..3).filter(|other| *other != node).collect();
            assert!(others.iter().all(|other| world.silent(*other).is_none()), "the others go on: {told}");
            // With the right file it joins them.
            world.kill(node);
            world.nodes[usize::from(node)].file = File::right();
            world.start(node);
            assert!(world.run_until(2 * SECOND, World::agrees), "{told}");
            world.assert_alone(&told);
        }
    }
}

#[test]
fn of_two_tables_that_meet_one_goes_on() {
    for (seed, (field, edit)) in (0..).zip(EDITS) {
        for digest in [3, 9] {
            let mut world = World::new(seed);
            world.nodes[1].file = edited(edit, digest);
            // Its cable is out while it starts.
            for other in [0, 2] {
                (world.cut[1][other], world.cut[other][1]) = (true, true);
            }
            world.start_all();
            world.run(2 * SECOND);
            assert_eq!(world.clock(1).role(), Role::Master, "alone it has begun a time");
            world.cut = [[false; 3]; 3];
            world.run(4 * CYCLE);
            world.collisions.clear();
            world.run(4 * SECOND);
            let told = format!("`{field}` edited, digest {digest}: {:?}", world.silent(1));
            world.assert_alone(&told);
            assert!(is_parted(&world, 1) && world.silent(0).is_none() && world.silent(2).is_none(), "{told}");
        }
    }
}

#[test]
fn a_node_that_does_not_hear_that_it_must_yield_silences_the_others() {
    let mut world = World::new(5);
    world.nodes[1].file = edited(EDITS[9].1, 3);
    for other in [0, 2] {
        (world.cut[1][other], world.cut[other][1]) = (true, true);
    }
    world.start_all();
    world.run(2 * SECOND);
    // The others hear it, and it hears nothing.
    (world.cut[1][0], world.cut[1][2]) = (false, false);
    world.run(SECOND / 4);
    world.collisions.clear();
    world.run(4 * SECOND);
    world.assert_alone("both others are silent");
    assert!(is_parted(&world, 0) && is_parted(&world, 2) && world.silent(1).is_none());
    world.cut = [[false; 3]; 3];
    world.kill(1);
    world.nodes[1].file = File::right();
    world.start(1);
    assert!(world.run_until(6 * SECOND, World::agrees), "from the right file all agree");
}

#[test]
fn two_tables_that_begin_at_once_are_soon_one() {
    for seed in 0..12 {
        let mut world = World::new(seed);
        world.nodes[1].file = edited(EDITS[seed as usize % EDITS.len()].1, 8);
        world.start_all();
        world.run(2 * SECOND);
        world.collisions.clear();
        world.run(2 * SECOND);
        world.assert_alone(&format!("seed {seed}"));
        let speak = (0..3).filter(|node| world.silent(*node).is_none()).count();
        assert!((1..=2).contains(&speak), "seed {seed}: {speak} nodes speak");
    }
}
