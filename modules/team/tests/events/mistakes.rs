//! Each mistake of a plan is told, and trees that differ have different digests.

use rohrpost_team::events::{
    Flow, GROUPS_MAX, LEAVES_MAX, Plan, PlanError, Priority, ROOT, STEPS_MAX, TYPES_MAX, Tree, Turn,
};

type TestPlan = Plan<(), ()>;

fn nothing(_: &mut (), (): &(), _: &mut Turn<'_, ()>) {}

fn told(declare: impl FnOnce(&mut TestPlan)) -> String {
    let mut plan = Plan::new();
    declare(&mut plan);
    plan.build().err().unwrap().to_string()
}

fn number(at: usize) -> &'static str {
    format!("n{at}").leak()
}

#[test]
fn each_mistake_is_told() {
    let leaf = |plan: &mut TestPlan, name| plan.leaf(name, &[ROOT], Flow::default(), nothing);
    let cases = [
        (told(|plan| leaf(plan, "a b")), "`a b` is no name: 1 to 64 of a-z, 0-9 and -"),
        (told(|plan| leaf(plan, "root")), "two of the plan are named `root`: give one of them another name"),
        (
            told(|plan| {
                plan.event("beat", Priority::Low, 0);
            }),
            "event `beat` has room for none: at least 1 has to wait",
        ),
        (
            told(|plan| {
                plan.group("idle", &[]);
            }),
            "`idle` has no parent, so no event reaches it: name one, such as ROOT",
        ),
        (
            told(|plan| {
                let foreign = TestPlan::new().event("beat", Priority::Low, 1);
                plan.leaf("user", &[ROOT], Flow { consumes: &[foreign], ..Flow::default() }, nothing);
            }),
            "`user` names a group or an event of another plan",
        ),
        (
            told(|plan| {
                let beat = plan.event("beat", Priority::Low, 1);
                plan.leaf("user", &[ROOT], Flow { cycles: &[(beat, 1)], ..Flow::default() }, nothing);
            }),
            "leaf `user` has an exception for event `beat`, which it does not produce: take one of both away",
        ),
        (
            told(|plan| {
                for at in 0..=TYPES_MAX {
                    plan.event(number(at), Priority::Low, 1);
                }
            }),
            "`n32` is one too many: a plan has at most 32 events",
        ),
        (
            told(|plan| {
                for at in 0..GROUPS_MAX {
                    plan.group(number(at), &[ROOT]);
                }
            }),
            "`n63` is one too many: a plan has at most 64 groups",
        ),
        (
            told(|plan| (0..=LEAVES_MAX).for_each(|at| leaf(plan, number(at)))),
            "`n128` is one too many: a plan has at most 128 leaves",
        ),
    ];
    for (told, expected) in cases {
        assert_eq!(told, expected);
    }
}

#[test]
fn ways_that_double_with_each_group_are_refused_early() {
    let mut plan = TestPlan::new();
    let mut above = vec![ROOT];
    for at in 0..15 {
        above = [0, 1].map(|side| plan.group(number(2 * at + side), &above)).to_vec();
    }
    let error = plan.build().err().unwrap();
    assert!(matches!(error, PlanError::TooMany { name: "n29", max: STEPS_MAX, .. }), "{error}");
}

/// A tree of one leaf, with one thing changed.
fn tree(change: usize) -> Tree<(), ()> {
    let mut plan = TestPlan::new();
    let beat =
        plan.event(if change == 1 { "pulse" } else { "beat" }, Priority::Normal, if change == 9 { 8 } else { 4 });
    let object = plan.event("object", if change == 2 { Priority::Low } else { Priority::Normal }, 4);
    let group = plan.group("group", &[ROOT]);
    let parents = if change == 3 { vec![ROOT] } else { vec![group] };
    let name = if change == 4 { "other" } else { "leaf" };
    let types = [beat, object];
    let some = |yes: bool, it| if yes { &types[it..=it] } else { &types[..0] };
    let (consumes, emits) = (some(change != 5, 0), some(change == 6, 1));
    let sends = some(change != 7, 1);
    let cycles = [(object, 3)];
    let cycles = if change == 8 { &cycles[..] } else { &[] };
    plan.leaf(name, &parents, Flow { consumes, emits, sends, cycles }, nothing);
    plan.build().unwrap()
}

#[test]
fn digests_differ_where_trees_do_but_not_by_rooms() {
    let digests: Vec<u64> = (0..9).map(|change| tree(change).digest()).collect();
    for (at, digest) in digests.iter().enumerate() {
        assert!(!digests[..at].contains(digest), "change {at}");
    }
    assert_eq!(tree(9).digest(), digests[0]);
    assert_eq!(tree(0).short_digest(), digests[0] as u16);
}
