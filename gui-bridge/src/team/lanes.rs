//! Timelines of a team, a lane for each robot: its mode, and its group.

use crate::palette::Rgb;
use crate::scene::{Scene, entity};
use rerun::{StateChange, StateConfiguration};

/// States of a lane that have a colour of their own; others get one of the viewer's.
const STATES_MAX: usize = 64;

impl Scene {
    /// From now on the lane of a robot below `view` has this state. A state said again draws nothing.
    pub(super) fn robot_lane(&mut self, view: &str, robot: u8, state: &str, colour: Rgb) {
        let name = entity(&[view, &format!("robot-{robot}")]);
        let lane = self.lanes.entry(name.clone()).or_default();
        if lane.last == state {
            return;
        }
        state.clone_into(&mut lane.last);
        if lane.states.len() < STATES_MAX && !lane.states.iter().any(|(known, _)| known == state) {
            lane.states.push((state.into(), colour));
            let (states, colours): (Vec<_>, Vec<_>) = lane.states.iter().cloned().unzip();
            let colours = colours.into_iter().map(|[red, green, blue]| u32::from_be_bytes([red, green, blue, u8::MAX]));
            let configuration = StateConfiguration::new().with_values(states).with_colors(colours);
            self.log_static(name.clone(), &configuration);
        }
        self.log_event(name, &StateChange::single(state));
    }
}
