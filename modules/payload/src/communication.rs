//! Leaves of the branch communication (seed 000, 4.5.1): position, view and hello.

use crate::event::{Event, Types};
use crate::ground::told;
use crate::mode::{Branches, Mode};
use crate::state::{LostCause, News, Seen, State};
use rohrpost_robot::lookout::Lookout;
use rohrpost_supervision::Command;
use rohrpost_team::Position;
use rohrpost_team::events::Turn;
use rohrpost_team::view::Records;

/// Position freshness detector: a robot that does not know its cell is lost, and stands.
pub(crate) fn position_freshness(state: &mut State, now_ns: u64) {
    let before = state.lost.take();
    let max_age_ns = state.settings.position_max_age_ns;
    let cell = state.cell();
    state.lost = match state.fix.map(|fix| now_ns.saturating_sub(fix.at_ns)) {
        None => Some(LostCause::NoPose),
        Some(age_ns) if age_ns > max_age_ns => Some(LostCause::Old(age_ns / 1_000_000)),
        Some(_) => cell.is_none().then_some(LostCause::NoCell),
    };
    match (before, state.lost, cell) {
        (None, Some(cause), _) => state.tell(News::Lost(cause)),
        (Some(_), None, Some(cell)) => state.tell(News::Found(cell)),
        _ => {}
    }
    if state.lost.is_some() {
        state.command = Some(Command::STOP);
    }
}

/// Hello sender.
pub(crate) fn hello(state: &mut State, now_ns: u64) {
    let pose = state.fix.filter(|_| state.lost.is_none()).and_then(|fix| told(fix.pose, fix.speed_m_s));
    let beat = state.team.beat(now_ns, pose);
    let records = [beat.objects, beat.synchro].into_iter().flatten().map(|records| records.encode());
    state.outbox.extend(records.chain([beat.hello.encode()]));
}

/// Obstacle analyser: what no wall explains is something, but not of a robot that may be anywhere, nor before it knows
/// its friends.
pub(crate) fn analyse(state: &State, event: &Event, turn: &mut Turn<'_, Event>, types: Types) {
    if let Event::Obstacle(obstacles) = event
        && state.lost.is_none()
        && turn.now_ns >= state.listens_until_ns
    {
        turn.emit(types.object, Event::Object(obstacles.clone()));
    }
}

/// View updater: takes what is seen here, and what teammates say.
pub(crate) fn update_view(state: &mut State, now_ns: u64, event: &Event) {
    match event {
        Event::Object(obstacles) => state.team.look(now_ns, obstacles, |_| false),
        Event::Hello(hello) => state.team.hear_hello(now_ns, hello),
        Event::Records(records) => state.team.hear_records(now_ns, Records::clone(records)),
        _ => {}
    }
}

/// View freshness detector: what should be seen and is not, is no longer certain. Ages are counted with the hello.
pub(crate) fn refresh_view(state: &mut State, now_ns: u64) {
    let knows = state.lost.is_none() && now_ns >= state.listens_until_ns;
    let Some(seen) = state.seen_now(now_ns).filter(|_| knows).cloned() else { return };
    let Seen { scan, pose, obstacles, .. } = seen;
    let (ground, gate_m) = (state.ground.clone(), state.settings.gate_m);
    let lookout = Lookout { world: &ground.world, pose, scan: &scan, error_m: state.settings.error_m };
    let metres = |mm: i32| f64::from(mm) / 1000.0;
    let can_see = |place: Position| lookout.can_see(metres(place.x_mm), metres(place.y_mm), gate_m);
    state.team.look(now_ns, &obstacles, can_see);
}

/// After each change of the view: the mode that it asks for, and a new route.
pub(crate) fn revise(state: &mut State, turn: &mut Turn<'_, Event>, types: Types, branches: Branches) {
    let objects = state.team.view().objects();
    let mode = match objects.iter().any(|object| object.certain) {
        true => Mode::Blocking,
        false if objects.is_empty() => Mode::Wandering,
        false => Mode::Searching,
    };
    if mode != state.mode {
        turn.switch(branches.of(state.mode), false);
        turn.switch(branches.of(mode), true);
        state.mode = mode;
        state.navigation.forget();
        state.tell(News::Mode(mode));
    }
    turn.emit(types.moved, Event::Move);
}
