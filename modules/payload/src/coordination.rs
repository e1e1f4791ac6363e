//! Leaves of the branch multi-robot coordination, which the seed left empty (seed 000, 4.5): places and claims of all
//! robots, and the cell that this one may enter.

use crate::event::Event;
use crate::mode::Mode;
use crate::state::{News, State};
use rohrpost_modules::types::Pose;
use rohrpost_team::RobotId;
use rohrpost_team::coordination::{Duty, Target, Traffic};
use rohrpost_team::grid::Cell;

/// So near to the middle of its cell, all of the robot's body is in it, metres.
const IN_CELL_M: f64 = 0.24;
/// A robot that does not come to the cell that it enters for so long turns back, ns.
const TURN_BACK_NS: u64 = 6_000_000_000;
/// Another goal is chosen after so long, ns.
const GOAL_NS: u64 = 40_000_000_000;
/// Goals are looked for no more often, ns.
const CHOICE_NS: u64 = 1_000_000_000;
/// Another goal is chosen so many steps before this one, so that all have agreed on ways to it when the robot is there.
const STEPS_AHEAD: usize = 2;

/// A teammate says where it is and which cell it claims.
pub(crate) fn hear(state: &mut State, now_ns: u64, event: &Event) {
    if let (Event::Traffic(message), Some(traffic)) = (event, &mut state.traffic) {
        traffic.hear(now_ns, message);
    }
}

/// Says where this robot is and what it wants, and takes the cell that it may enter.
pub(crate) fn coordinate(state: &mut State, now_ns: u64) {
    let Some(mut traffic) = state.traffic.take() else { return };
    place(state, &mut traffic, now_ns);
    if state.mode == Mode::Blocking {
        traffic.set_intruders(targets(state));
        let me = state.team.group().me();
        let duty = traffic.sharing().and_then(|sharing| sharing.duties.get(&me)).and_then(Duty::cell);
        state.navigation.destination = duty.map(|cell| (cell, now_ns));
    } else {
        traffic.set_intruders(Vec::new());
        traffic.set_goal(goal(state, &traffic, now_ns));
    }
    if let Some(message) = traffic.poll(now_ns, &mut state.ground.planner()) {
        state.outbox.push(message.encode());
    }
    state.navigation.next = if state.navigation.turns_back { None } else { traffic.next_cell() };
    let me = state.team.group().me();
    // A robot that is to end goes nowhere.
    let is_meant = |robot: RobotId| robot == me && state.quit_beats.is_none();
    let no_way = traffic.given_up().iter().find(|(robot, _)| is_meant(*robot)).map(|(_, why)| *why);
    if no_way != state.no_way {
        state.no_way = no_way;
        no_way.into_iter().for_each(|why| state.tell(News::NoWay(why)));
    }
    state.traffic = Some(traffic);
}

/// Tells in which cell the robot's whole body is. Between two cells it is in both, as was told before.
fn place(state: &mut State, traffic: &mut Traffic, now_ns: u64) {
    let (Some(here), Some(fix)) = (state.cell(), state.fix) else { return traffic.set_place(None) };
    let Pose { x_m, y_m, .. } = fix.pose;
    let (middle_x, middle_y) = state.ground.placement.middle_m(&state.ground.grid, here);
    let navigation = &mut state.navigation;
    if navigation.next != navigation.enters.map(|(cell, _)| cell) {
        navigation.enters = navigation.next.map(|cell| (cell, now_ns));
    }
    let is_late = |(cell, since_ns): (Cell, u64)| cell != here && now_ns.saturating_sub(since_ns) > TURN_BACK_NS;
    navigation.turns_back |= navigation.enters.is_some_and(is_late);
    if (x_m - middle_x).hypot(y_m - middle_y) > IN_CELL_M {
        return;
    }
    if std::mem::take(&mut navigation.turns_back) {
        traffic.turned_back();
        // Something that no plan knows is in the way: the robot goes elsewhere, if it may choose.
        navigation.destination = None;
    }
    traffic.set_place(Some(here));
}

fn targets(state: &State) -> Vec<Target> {
    let certain = state.team.view().objects().into_iter().filter(|object| object.certain);
    let target = |object: rohrpost_team::view::Object| {
        Some(Target { id: object.id, cells: vec![state.ground.cell_at(object.position)?] })
    };
    certain.filter_map(target).collect()
}

/// Where it is the first to be while it wanders, near where the intruder was while it searches.
fn goal(state: &mut State, traffic: &Traffic, now_ns: u64) -> Option<Cell> {
    let here = state.cell()?;
    let is_near = traffic.steps_left().is_some_and(|steps| steps <= STEPS_AHEAD);
    let is_over = |(_, since_ns): (Cell, u64)| is_near || now_ns.saturating_sub(since_ns) > GOAL_NS;
    let is_time = state.navigation.chose_ns.is_none_or(|at_ns| now_ns.saturating_sub(at_ns) >= CHOICE_NS);
    if is_time && state.navigation.destination.is_none_or(is_over) {
        state.navigation.chose_ns = Some(now_ns);
        let others: Vec<Cell> = traffic.others(now_ns).collect();
        let near = match state.mode {
            Mode::Searching => {
                let last = state.intruders(false);
                let last = state.navigation.one_of(&last)?;
                state.cells_near(last, state.settings.search_steps)
            }
            Mode::Wandering | Mode::Blocking => state.cells_nearest(here, &others),
        };
        let free: Vec<Cell> = near.into_iter().filter(|cell| !others.contains(cell)).collect();
        state.navigation.destination = state.navigation.one_of(&free).map(|cell| (cell, now_ns));
    }
    state.navigation.destination.map(|(cell, _)| cell)
}
