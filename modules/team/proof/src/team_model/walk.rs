//! Random walks of two teams that have nothing in common but the key.

use super::super::Team;
use super::bounds::{Bounds, Loss, STORIES};
use super::promises::KNOWN;
use super::team::begun;
use super::world::{Action, State, Teams, Turn};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use stateright::Model;
use std::collections::HashMap;

/// Walks of each story, and steps of each.
const WALKS: u64 = 60;
const STEPS: usize = 300;

/// Two teams take the same steps, one with other counters and clocks than the other: they may do the same in each
/// state, and go on to states of one key. So do all states of one key that any walk has met.
pub(crate) fn walks() {
    for story in STORIES {
        for may_die in [false, true] {
            walks_of(Bounds { story, may_lose: Loss::Anything, may_delay: !may_die, may_die, calm_max: KNOWN });
        }
    }
}

fn walks_of(left: Bounds) {
    let model = Teams { first: begun(left, 0, 0) };
    let mut known: HashMap<(u64, String), u64> = HashMap::new();
    let mut met_again = 0;
    for walk in 0..WALKS {
        let mut chance = ChaCha8Rng::seed_from_u64(walk);
        let mut teams = [begun(left, 0, 0), begun(left, 1 << 50, chance.random_range(1..1000))];
        for step in 0..STEPS {
            let [turns, others] = teams.each_ref().map(|team| possible(&model, team));
            assert_eq!(turns, others, "walk {walk}, step {step}");
            // Faults are rare, so that they come late, too.
            let is_fault = |turn: &Turn| matches!(turn[..], [Action::Lose { .. } | Action::Die(_)]);
            let often: Vec<&Turn> = turns.iter().filter(|it| !is_fault(it) || chance.random_ratio(1, 60)).collect();
            if often.is_empty() {
                break;
            }
            let turn = often[chance.random_range(0..often.len())];
            let before = teams[0].computed_key(0);
            teams = teams.map(|team| team.after(turn));
            assert_eq!(teams[0].broken, [""; 0], "walk {walk}, step {step}, {turn:?}, {left:?}");
            let [key, other] = teams.each_ref().map(|team| team.computed_key(0));
            assert_eq!(key, other, "walk {walk}, step {step}, {turn:?}");
            let seen = known.insert((before, format!("{turn:?}")), key);
            assert!(seen.is_none_or(|seen| seen == key), "walk {walk}, step {step}, {turn:?}");
            met_again += u64::from(seen.is_some());
        }
    }
    println!("{} steps of states that were met once, {met_again} of those that were met again", known.len());
    assert!(met_again > 1000, "{met_again} steps");
}

fn possible(model: &Teams<Team>, team: &State<Team>) -> Vec<Turn> {
    let mut turns = Vec::new();
    model.actions(team, &mut turns);
    turns
}
