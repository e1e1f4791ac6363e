//! A random walk of a wormhole that is never reduced, beside reduced ones.

use super::super::Wormhole;
use super::action::{Action, Bounds};
use super::promises::State;
use super::reaction::{PLAIN, take};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use stateright::Model;

/// Steps of a walk.
const STEPS: usize = 300_000;

/// Walks from the beginning, in absolute time and with numbers that only grow. At each step the wormhole does what the
/// reduced one does in the model, and is reduced to the same state.
pub(crate) fn walks() {
    let bounds = Bounds::chosen();
    let mut chance = ChaCha8Rng::seed_from_u64(1);
    let (mut now_ns, mut actions) = (0, Vec::new());
    let mut wormhole = Wormhole::new(bounds.settings());
    let mut state: State = bounds.init_states().remove(0);
    for step in 0..STEPS {
        bounds.actions(&state, &mut actions);
        // A death begins anew: rarely, so that numbers grow and the window fills.
        actions.retain(|action| *action != Action::Die || chance.random_ratio(1, 1000));
        // Time passes half of the time, if it may.
        let is_tick = actions[0] == Action::Tick && chance.random();
        let action = actions[if is_tick { 0 } else { chance.random_range(0..actions.len()) }];
        actions.clear();
        let voice = state.world.voice(&action, &bounds);
        let expected = bounds.take(&state.core, &action, voice, &PLAIN);
        let ahead = chance.random_range(1..0x8000_0000);
        let found = take(&mut wormhole, &mut now_ns, &action, voice, ahead);
        assert_eq!(found, expected, "step {step}, {action:?}, from {:?}", state.core);
        state.world.step(&action, voice, &bounds);
        state.core = found.core;
    }
}
