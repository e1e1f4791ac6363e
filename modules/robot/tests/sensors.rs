//! The simulated camera and depth sensor take nothing from the heap: their pixels and points go where the caller says.
//!
//! One test, as the heap is counted for a whole thread.

#![allow(clippy::unwrap_used, reason = "these are tests")]

#[path = "../../../benches/src/counting.rs"]
pub mod counting;

use counting::{CountingHeap, heap_uses};
use rohrpost_robot::camera::{CAMERA, SimulatedCamera};
use rohrpost_robot::depth::{DEPTH_SENSOR, SimulatedDepth};
use rohrpost_robot::world::World;

#[global_allocator]
static HEAP: CountingHeap = CountingHeap;

#[test]
fn looking_takes_nothing_from_the_heap() {
    let world = World::parse(include_str!("../../../config/building.map")).unwrap();
    let (mut camera, mut depth) = (SimulatedCamera::new(CAMERA), SimulatedDepth::new(DEPTH_SENSOR));
    let mut pixels = vec![0; camera.image().raw_bytes() as usize];
    let mut points = vec![0; depth.cloud().raw_bytes() as usize];
    let before = heap_uses();
    camera.render(&world, &world.start(), &mut pixels);
    depth.look(&world, &world.start(), &mut points);
    let after = heap_uses();
    drop(pixels.clone());
    assert!(heap_uses() > after, "uses of the heap are counted");
    assert_eq!(after - before, 0);
    assert!(pixels.iter().any(|byte| *byte != 0) && points.iter().any(|byte| *byte != 0));
}
