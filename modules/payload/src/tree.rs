//! The seed's tree of modules (seed 000, figures 4.7, 4.8 and 4.10).
//!
//! ```text
//! root ─┬─ communication ──── position-freshness, view-freshness, hello-sender, obstacle-analyser, view-updater,
//!       │       │             view-synchroniser
//!       │       └──────────┬─ navigation ─┬─ wandering ── wandering-move, wandering-pilot
//!       ├─ self-coordination ┘            ├─ searching ── searching-move, searching-pilot
//!       │       └─ obstacle-avoidance     └─ blocking ─── blocking-move, blocking-pilot
//!       ├─ multi-robot-coordination ── claim-keeper, coordinator
//!       └─ remote-control ─── command-sender, remote-control-leaf, report-reader
//! ```

use crate::event::{Event, Types};
use crate::mode::{Branches, Mode};
use crate::state::State;
use crate::{communication, coordination, navigation, remote};
use rohrpost_team::events::{Flow, GroupId, Plan, PlanError, Priority, ROOT, Tree};

/// The tree, with the branch of the first mode on.
pub(crate) fn plant() -> Result<(Tree<State, Event>, Types), PlanError> {
    let mut plan: Plan<State, Event> = Plan::new();
    let types = declare(&mut plan);
    let communication = plan.group("communication", &[ROOT]);
    let own = plan.group("self-coordination", &[ROOT]);
    let navigation = plan.group("navigation", &[communication, own]);
    let branch = |plan: &mut Plan<_, _>, name| plan.group(name, &[navigation]);
    let branches = Branches {
        wandering: branch(&mut plan, "wandering"),
        searching: branch(&mut plan, "searching"),
        blocking: branch(&mut plan, "blocking"),
    };
    communicate(&mut plan, communication, types, branches);
    let flow = Flow { consumes: &[types.obstacle], ..Flow::default() };
    plan.leaf("obstacle-avoidance", &[own], flow, |state, event, _| navigation::avoid(state, event));
    for (mode, move_name, pilot_name) in [
        (Mode::Wandering, "wandering-move", "wandering-pilot"),
        (Mode::Searching, "searching-move", "searching-pilot"),
        (Mode::Blocking, "blocking-move", "blocking-pilot"),
    ] {
        let flow = Flow { consumes: &[types.moved], ..Flow::default() };
        plan.leaf(move_name, &[branches.of(mode)], flow, |state, _, turn| state.reroute(turn.now_ns));
        let flow = Flow { consumes: &[types.pose], ..Flow::default() };
        plan.leaf(pilot_name, &[branches.of(mode)], flow, |state, _, turn| navigation::pilot(state, turn.now_ns));
    }
    coordinate(&mut plan, types);
    control(&mut plan, types);
    let mut tree = plan.build()?;
    tree.switch(branches.searching, false);
    tree.switch(branches.blocking, false);
    Ok((tree, types))
}

fn declare(plan: &mut Plan<State, Event>) -> Types {
    Types {
        beat: plan.event("beat", Priority::Normal, 2),
        pose: plan.event("pose", Priority::Normal, 2),
        obstacle: plan.event("obstacle", Priority::High, 2),
        object: plan.event("object", Priority::Normal, 4),
        heard: plan.event("heard", Priority::Low, 128),
        synchro: plan.event("synchro", Priority::Low, 16),
        traffic: plan.event("traffic", Priority::Low, 128),
        moved: plan.event("move", Priority::Normal, 16),
        command: plan.event("command", Priority::Normal, 4),
        request: plan.event("request", Priority::Normal, 4),
        report: plan.event("report", Priority::Low, 16),
    }
}

fn communicate(plan: &mut Plan<State, Event>, parent: GroupId, types: Types, branches: Branches) {
    let both = [types.beat, types.pose];
    let flow = Flow { consumes: &both, ..Flow::default() };
    plan.leaf("position-freshness", &[parent], flow, |state, _, turn| {
        communication::position_freshness(state, turn.now_ns);
    });
    let moves = [types.moved];
    let flow = Flow { consumes: &[types.beat], emits: &moves, ..Flow::default() };
    plan.leaf("view-freshness", &[parent], flow, move |state, _, turn| {
        communication::refresh_view(state, turn.now_ns);
        communication::revise(state, turn, types, branches);
    });
    let flow = Flow { consumes: &[types.beat], ..Flow::default() };
    plan.leaf("hello-sender", &[parent], flow, |state, _, turn| communication::hello(state, turn.now_ns));
    let flow = Flow { consumes: &[types.obstacle], emits: &[types.object], ..Flow::default() };
    plan.leaf("obstacle-analyser", &[parent], flow, move |state, event, turn| {
        communication::analyse(state, event, turn, types);
    });
    for (name, consumes) in
        [("view-updater", &[types.object, types.heard][..]), ("view-synchroniser", &[types.synchro][..])]
    {
        let flow = Flow { consumes, emits: &moves, ..Flow::default() };
        plan.leaf(name, &[parent], flow, move |state, event, turn| {
            communication::update_view(state, turn.now_ns, event);
            communication::revise(state, turn, types, branches);
        });
    }
}

fn coordinate(plan: &mut Plan<State, Event>, types: Types) {
    let parent = [plan.group("multi-robot-coordination", &[ROOT])];
    let flow = Flow { consumes: &[types.traffic], ..Flow::default() };
    plan.leaf("claim-keeper", &parent, flow, |state, event, turn| {
        coordination::hear(state, turn.now_ns, event);
        coordination::coordinate(state, turn.now_ns);
    });
    let flow = Flow { consumes: &[types.pose], ..Flow::default() };
    plan.leaf("coordinator", &parent, flow, |state, _, turn| coordination::coordinate(state, turn.now_ns));
}

fn control(plan: &mut Plan<State, Event>, types: Types) {
    let parent = [plan.group("remote-control", &[ROOT])];
    let flow = Flow { consumes: &[types.command], sends: &[types.request, types.report], ..Flow::default() };
    plan.leaf("command-sender", &parent, flow, move |_, event, turn| remote::command(event, turn, types));
    let flow = Flow { consumes: &[types.request], sends: &[types.report], ..Flow::default() };
    plan.leaf("remote-control-leaf", &parent, flow, move |state, event, turn| {
        remote::obey(state, event, turn, types);
    });
    let flow = Flow { consumes: &[types.report], ..Flow::default() };
    plan.leaf("report-reader", &parent, flow, |state, event, turn| remote::read(state, event, turn.from));
}
