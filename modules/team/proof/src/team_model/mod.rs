//! Three robots that hear each other, every order of what they send.
//!
//! | of the world | is in the model |
//! | --- | --- |
//! | beats | each robot beats once in a round, in any order, another one in each round |
//! | radio | a channel from each robot to each other one, first in, first out; what is sent in a round comes in it |
//! | a loss | one message, at any time; where there are records, one with records |
//! | a delay | the last messages of one channel come in the next round |
//! | a death | one robot, at any time |
//! | its restart | at any later time: with its store, without, and with an older one |
//! | the start | each robot was alone; then without records, or with those of one of three stories (`bounds.rs`) |
//!
//! A state is of the very core and never altered; `key.rs` says which states are alike, so that they are finitely many.
//! Liveness is counted in beats: stateright's `eventually` forgets what closes a cycle.
//!
//! What happens at one robot and reaches no other one comes in one order only: a robot takes messages just before its
//! beat, or at the end of a round. To all others it is the same whether it took them earlier. So a step of the model is
//! a turn: a robot takes some messages and beats, or takes all that is left. Of two orders of the same messages after
//! which the robot is the same, one goes on. Promises are looked at after each message of each order.
//!
//! Not in the model: robots out of range of each other, lost hellos and death while records are on their way (`walk.rs`
//! has both, by chance), ageing of objects, `time`. The simulation has these (`modules/team/tests/simulation`).

pub(crate) mod bounds;
pub(crate) mod key;
mod promises;
mod robot;
mod team;
mod walk;
pub(crate) mod world;

use crate::check;
use bounds::{Bounds, Loss, STORIES, Story};
pub(crate) use walk::{walks, walks_of_changed_places};
pub(crate) use world::Teams;

/// No fault.
const CALM: Bounds = Bounds {
    story: Story::Nothing,
    may_lose: Loss::Nothing,
    may_delay: false,
    may_die: false,
    calm_max: promises::PAIRS,
};

/// Robots without records: one dies and comes back, or one message is lost.
pub(crate) fn groups_hold() {
    holds("groups of three, one death and restart", Bounds { may_die: true, ..CALM });
    holds("groups of three, one loss", Bounds { may_lose: Loss::Anything, ..CALM });
}

/// One message is lost, and others come a round later.
pub(crate) fn groups_hold_after_two_faults() {
    holds("groups of three, one loss, one delay", Bounds { may_lose: Loss::Anything, may_delay: true, ..CALM });
}

/// One robot dies and comes back, and one message is lost, in either order.
pub(crate) fn groups_hold_after_a_death_and_a_loss() {
    let left = Bounds { may_die: true, may_lose: Loss::Anything, ..CALM };
    holds("groups of three, one death and restart, one loss", left);
}

/// Robots with records.
pub(crate) fn views_hold() {
    STORIES.into_iter().for_each(|story| holds("views of three", Bounds { story, calm_max: promises::KNOWN, ..CALM }));
}

/// One message with records is lost.
pub(crate) fn views_hold_after_a_loss() {
    let left = Bounds { story: Story::Unheard, calm_max: promises::KNOWN, may_lose: Loss::Records, ..CALM };
    holds("views of three, one loss", left);
}

fn holds(name: &str, left: Bounds) {
    check::holds(&format!("{name}, {:?}", left.story), Teams { first: team::begun(left, 0, 0) });
}

/// Each promise is broken by a mistake.
pub(crate) fn each_can_fail() {
    check::each_promise_can_fail(&Teams { first: team::begun(CALM, 0, 0) });
}
