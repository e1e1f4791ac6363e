//! The tree of seed 000, 4.5: refused with all its cycles, and accepted with exceptions.

use rohrpost_team::events::{EventType, Flow, GroupId, Plan, PlanError, Priority, ROOT, Tree, Turn};

fn nothing(_: &mut (), _: &u8, _: &mut Turn<'_, u8>) {}

/// Figures 4.7, 4.8 and 4.10, with what 4.3 and algorithm 2 say that modules produce.
fn seed_tree(exceptions: bool) -> Result<Tree<(), u8>, PlanError> {
    let mut plan = Plan::new();
    let beat = plan.event("beat", Priority::Normal, 2);
    let obstacle = plan.event("obstacle", Priority::High, 4);
    let object = plan.event("object", Priority::Normal, 16);
    let synchro = plan.event("synchro", Priority::Normal, 8);
    let moved = plan.event("move", Priority::Normal, 4);
    let control = plan.event("control", Priority::Normal, 4);
    let communication = plan.group("communication", &[ROOT]);
    let coordination = plan.group("self-coordination", &[ROOT]);
    let navigation = plan.group("navigation", &[communication, coordination]);
    let mut leaf =
        |name, parents: &[GroupId], consumes: &[EventType], emits: &[_], sends: &[_], cycles: &[EventType]| {
            let cycles: Vec<_> = cycles.iter().map(|it| (*it, 4)).filter(|_| exceptions).collect();
            plan.leaf(name, parents, Flow { consumes, emits, sends, cycles: &cycles }, nothing);
        };
    let both = [object, synchro];
    leaf("position-freshness-detector", &[communication], &[beat], &[], &[], &[]);
    leaf("hello-sender", &[communication], &[beat], &[], &[object], &[]);
    leaf("obstacle-analyser", &[communication], &[obstacle], &[object], &[], &[]);
    leaf("view-updater", &[communication], &[object], &[moved], &both, &both);
    leaf("view-synchronizer", &[communication], &[synchro], &[object, moved], &[synchro], &[synchro]);
    leaf("view-freshness-detector", &[communication], &[beat], &[moved], &[], &[]);
    leaf("obstacle-avoidance", &[coordination], &[obstacle], &[], &[], &[]);
    leaf("remote-control", &[ROOT], &[control], &[], &[control], &[control]);
    for mode in ["wandering", "searching", "blocking"] {
        let group = plan.group(mode, &[navigation]);
        let name = |leaf: &str| -> &'static str { format!("{mode}-{leaf}").leak() };
        plan.leaf(name("move"), &[group], Flow { consumes: &[moved], ..Flow::default() }, nothing);
        plan.leaf(name("pilot"), &[group], Flow { consumes: &[beat], ..Flow::default() }, nothing);
    }
    plan.build()
}

#[test]
fn the_seeds_own_tree_is_refused_with_all_its_cycles_named() {
    let Err(error) = seed_tree(false) else { panic!("it is accepted") };
    assert_eq!(
        error.to_string(),
        "events would go in cycles: \
         `remote-control` -- control to teammates --> `remote-control`; \
         `view-synchronizer` -- object --> `view-updater` -- synchro to teammates --> `view-synchronizer`; \
         `view-synchronizer` -- synchro to teammates --> `view-synchronizer`; \
         `view-updater` -- object to teammates --> `view-updater`. \
         Take a link away, or declare it in `cycles` of its leaf with a depth"
    );
}

#[test]
fn with_exceptions_the_seeds_tree_is_accepted() {
    assert!(seed_tree(true).is_ok());
}
