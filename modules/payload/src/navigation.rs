//! Leaves of the branch self-coordination (seed 000, 4.5.2): obstacle avoidance, and `move` and `pilot` of each mode.

use crate::event::Event;
use crate::mode::Mode;
use crate::state::State;
use crate::steering::Heading;
use rohrpost_modules::fusion::wrap_rad;
use rohrpost_supervision::Command;
use rohrpost_team::grid::Cell;
use std::f64::consts::FRAC_PI_2;

/// Further beside the line of its next step, a robot goes to the middle of its cell first, metres.
const OFF_LINE_M: f64 = 0.15;

/// Obstacle avoidance: freezes before what is near and in front. It computes no new route: the order to freeze is not
/// to wait for that.
pub(crate) fn avoid(state: &mut State, event: &Event) {
    let (Event::Obstacle(obstacles), Some(fix)) = (event, state.fix) else { return };
    let near_m = state.settings.near_m;
    let is_in_front = |(ahead_m, aside_m): (f64, f64)| {
        let off_rad = wrap_rad(aside_m.atan2(ahead_m) - fix.pose.heading_rad);
        ahead_m.hypot(aside_m) < near_m && off_rad.abs() < FRAC_PI_2
    };
    let mut places = obstacles.iter().map(|place| (f64::from(place.x_mm) / 1000.0, f64::from(place.y_mm) / 1000.0));
    state.is_obstructed = places.any(|(x_m, y_m)| is_in_front((x_m - fix.pose.x_m, y_m - fix.pose.y_m)));
    if state.is_obstructed {
        state.command = Some(Command::STOP);
    }
}

/// Pilot: steers to the next cell, and takes the one after it when it has come there.
pub(crate) fn pilot(state: &mut State, now_ns: u64) {
    let (Some(here), Some(fix)) = (state.cell(), state.fix) else { return };
    if state.navigation.arrive(now_ns, here) {
        state.reroute(now_ns);
    }
    let speeds = state.settings.speeds;
    let speed_m_s = match state.mode {
        Mode::Wandering => speeds.wandering_m_s,
        Mode::Searching => speeds.searching_m_s,
        Mode::Blocking => speeds.blocking_m_s,
    };
    let Some((to_m, stands)) = waypoint(state, here, (fix.pose.x_m, fix.pose.y_m)) else {
        state.command = Some(Command::STOP);
        return;
    };
    let turn_rate_max_rad_s = state.settings.turn_rate_max_rad_s;
    let wanted = Heading { to_m, speed_m_s, turn_rate_max_rad_s, stands }.command(fix.pose);
    let speed_m_s = if state.is_obstructed { 0.0 } else { wanted.speed_m_s };
    state.command = Some(Command { speed_m_s, ..wanted });
}

/// Where the robot drives now, metres, and whether it is to stand there: the middle of its own cell, until it is on the
/// line to the next one. `None` if it finds no way: then it freezes where it is, as the seed's robots do.
fn waypoint(state: &State, here: Cell, (x_m, y_m): (f64, f64)) -> Option<((f64, f64), bool)> {
    let middle_m = |cell| state.ground.placement.middle_m(&state.ground.grid, cell);
    let (own, navigation) = (middle_m(here), &state.navigation);
    let Some(next) = navigation.next.filter(|next| *next != here) else {
        let is_there = state.traffic.is_some() || navigation.destination.is_some_and(|(cell, _)| cell == here);
        return is_there.then_some((own, true));
    };
    let to = middle_m(next);
    let (east_m, north_m) = (to.0 - own.0, to.1 - own.1);
    let beside_m = ((x_m - own.0) * north_m - (y_m - own.1) * east_m).abs() / east_m.hypot(north_m);
    Some(if beside_m > OFF_LINE_M { (own, true) } else { (to, false) })
}
