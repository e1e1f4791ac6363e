//! A wave that is run again over its grid takes nothing from the heap, nor does a tree of events that is built.

#[path = "../../../benches/src/counting.rs"]
pub mod counting;

use counting::{CountingHeap, heap_uses};
use rohrpost_team::RobotId;
use rohrpost_team::events::{Flow, Plan, Priority, ROOT};
use rohrpost_team::grid::{Cell, Direction, Grid, Obstacle, ObstacleKind, Square, Wave};

#[global_allocator]
static HEAP: CountingHeap = CountingHeap;

#[test]
fn a_wave_over_the_same_grid_again_does_not_touch_the_heap() {
    const SIDE: u32 = 64;
    let squares = (0..SIDE * SIDE).map(|at| if at % 7 == 3 { Square::Wall } else { Square::Path });
    let Some(grid) = Grid::new(SIDE, squares.collect()) else { panic!("the grid is whole") };
    let mut wave = Wave::default();
    let mut turn = |number: u32| {
        let cell = |at: u32| Cell { column: at % SIDE, row: at / SIDE % SIDE };
        let moves = ObstacleKind::Moving(Direction::East);
        let obstacles = (1..9).map(|at| Obstacle { cell: cell(number * at), kind: moves });
        wave.start(&grid, cell(number), [cell(number * 31), cell(number * 37)], obstacles);
        let goal = wave.next_goal();
        while wave.next_goal().is_some() {}
        goal.map_or(0, |goal| wave.back_from(goal).count())
    };
    let before = heap_uses();
    turn(0);
    let after_first = heap_uses();
    assert!(after_first > before, "the first one allocates, and it is counted");
    let steps: usize = (1..200).map(&mut turn).sum();
    assert_eq!(heap_uses(), after_first);
    assert!(steps > 200, "there were paths: {steps}");
}

#[test]
fn events_do_not_touch_the_heap_once_the_tree_is_built() {
    let me = RobotId::new(1).expect("a robot");
    let mut plan = Plan::new();
    let beat = plan.event("beat", Priority::Normal, 4);
    let object = plan.event("object", Priority::Normal, 4);
    let group = plan.group("group", &[ROOT]);
    let flow = Flow { consumes: &[beat], emits: &[object], sends: &[object], cycles: &[] };
    plan.leaf("source", &[group], flow, move |_: &mut u64, number: &u64, turn| {
        turn.emit(object, *number);
        turn.send(object, *number);
        turn.switch(group, true);
    });
    plan.leaf("sink", &[group], Flow { consumes: &[object], ..Flow::default() }, |sum, number, _| *sum += number);
    let Ok(mut tree) = plan.build() else { panic!("the tree is sound") };
    let before = heap_uses();
    let mut sum = 0;
    for round in 0..1000 {
        // More than there is room for.
        let taken = (0..6).filter(|_| tree.hard(beat, 1)).count();
        assert_eq!(taken, 4);
        while tree.dispatch(round, &mut sum) {}
        while let Some((head, number)) = tree.take_sent(me) {
            assert!(tree.hear(&head, number).is_ok() && head.encode()[0] == b'E');
        }
    }
    while tree.dispatch(1000, &mut sum) {}
    assert_eq!(heap_uses(), before);
    assert_eq!(sum, 8000, "four of a round, here and heard");
}
