//! Floods: each priority's wait is within its bound, and a flood of one type loses nothing of another.

use rohrpost_team::RobotId;
use rohrpost_team::events::{EventHead, EventType, Flow, LossCause, Plan, Priority, ROOT, Tree, Turn};

/// Numbers of the events that have run.
type Ran = Vec<u64>;

struct Stage {
    tree: Tree<Ran, u64>,
    types: [EventType; 4],
}

/// A type of each priority, and one of teammates.
fn stage() -> Stage {
    let mut plan = Plan::new();
    let high = plan.event("obstacle", Priority::High, 7);
    let normal = plan.event("beat", Priority::Normal, 3);
    let low = plan.event("tidy", Priority::Low, 2);
    let object = plan.event("object", Priority::High, 4);
    let run = |ran: &mut Ran, number: &u64, _: &mut Turn<'_, u64>| ran.push(*number);
    plan.leaf("all", &[ROOT], Flow { consumes: &[high, normal, low, object], ..Flow::default() }, run);
    plan.leaf("sender", &[ROOT], Flow { sends: &[object], ..Flow::default() }, |_, _, _| ());
    Stage { tree: plan.build().unwrap(), types: [high, normal, low, object] }
}

impl Stage {
    /// Fills every queue, with events of this number.
    fn flood(&mut self, number: u64) {
        for event_type in self.types {
            while self.tree.hard(event_type, number) {}
        }
        while self.hear(number) {}
    }

    fn hear(&mut self, number: u64) -> bool {
        let (from, event_type, tree) = (RobotId::new(2).unwrap(), self.types[3].number(), self.tree.digest());
        self.tree.hear(&EventHead { from, depth: 1, event_type, path: 0, tree }, number).unwrap()
    }
}

#[test]
fn every_event_runs_within_its_bound_whatever_floods() {
    let mut worst = [0; 3];
    // From each turn of the order on, an event enters each queue behind all others, and all is flooded ever after.
    for start in 0..8 {
        for (probe, class) in Priority::ALL.into_iter().enumerate() {
            let (mut stage, mut ran) = (stage(), Ran::new());
            stage.flood(0);
            (0..start).for_each(|_| assert!(stage.tree.dispatch(0, &mut ran)));
            // Teammates' events are low: the last of these queues to be filled has the probe at its end.
            let is_probe_in = |stage: &mut Stage| match class {
                Priority::Low => stage.hear(1),
                _ => stage.tree.hard(stage.types[probe], 1),
            };
            while !is_probe_in(&mut stage) {
                assert!(stage.tree.dispatch(0, &mut ran));
                for other in stage.types.into_iter().filter(|it| class == Priority::Low || *it != stage.types[probe]) {
                    while stage.tree.hard(other, 0) {}
                }
            }
            let mut wait = 0;
            while !ran.contains(&1) {
                stage.flood(0);
                assert!(stage.tree.dispatch(0, &mut ran));
                wait += 1;
            }
            assert!(wait <= stage.tree.longest_wait(class), "{class:?} waited for {wait}");
            worst[probe] = wait.max(worst[probe]);
        }
    }
    println!("waits at most: {worst:?}");
    assert_eq!(Priority::ALL.map(|class| stage().tree.longest_wait(class)), [15, 24, 48]);
    assert!(worst[1] > 16 && worst[2] > 40, "the flood is one: {worst:?}");
}

#[test]
fn a_flood_of_one_type_loses_only_its_own_and_each_loss_is_counted() {
    let Stage { mut tree, types: [high, normal, low, object] } = stage();
    let mut ran = Ran::new();
    let (mut beats, mut floods) = (0, 0);
    for round in 0..1000 {
        for _ in 0..20 {
            floods += 1;
            tree.hard(high, 0);
            let head =
                EventHead { from: RobotId::new(2).unwrap(), depth: 1, event_type: 3, path: 0, tree: tree.digest() };
            tree.hear(&head, 0).unwrap();
        }
        assert!(tree.hard(normal, 1), "no beat is lost in round {round}");
        beats += 1;
        (0..12).for_each(|_| assert!(tree.dispatch(0, &mut ran)));
    }
    while tree.dispatch(0, &mut ran) {}
    assert_eq!(ran.iter().sum::<u64>(), beats);
    let lost = tree.lost(high, LossCause::QueueFull) + tree.lost(object, LossCause::QueueFull);
    assert!(lost > 0);
    assert_eq!(ran.len() as u64 + lost, beats + 2 * floods);
    assert_eq!([normal, low].map(|it| tree.lost(it, LossCause::QueueFull)), [0, 0]);
}
