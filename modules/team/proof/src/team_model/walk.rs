//! Random walks of two teams that have nothing in common but the key.

use super::super::Team;
use super::bounds::{Bounds, Loss, STORIES, Story};
use super::key::{NAMINGS, Naming};
use super::promises::{KNOWN, PAIRS};
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
            let Some(turn) = drawn(&turns, &mut chance) else { break };
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

/// A robot that has changed places with another one does what that would do.
pub(crate) fn walks_of_changed_places() {
    let left =
        Bounds { story: Story::Nothing, may_lose: Loss::Anything, may_delay: true, may_die: true, calm_max: PAIRS };
    let model = Teams { first: begun(left, 0, 0) };
    for walk in 0..WALKS {
        let mut chance = ChaCha8Rng::seed_from_u64(walk);
        let naming = NAMINGS[chance.random_range(1..NAMINGS.len())];
        let (mut team, mut changed) = (begun(left, 0, 0), begun(left, 0, 0));
        for step in 0..STEPS {
            let turns = possible(&model, &team);
            let Some(turn) = drawn(&turns, &mut chance) else { break };
            team = team.after(turn);
            changed = changed.after(&turn.iter().map(|action| action.renamed(naming)).collect::<Turn>());
            let [named, own] = [team.named_key(0, naming), changed.named_key(0, NAMINGS[0])];
            assert_eq!(named, own, "walk {walk}, step {step}, {turn:?}");
            assert_eq!(team.computed_key(0), changed.computed_key(0), "walk {walk}, step {step}, {turn:?}");
        }
    }
}

/// One of these turns. Faults are rare, so that they come late, too.
fn drawn<'t>(turns: &'t [Turn], chance: &mut ChaCha8Rng) -> Option<&'t Turn> {
    let is_fault = |turn: &Turn| matches!(turn.last(), Some(Action::Lose { .. } | Action::Die(_)));
    let often: Vec<&Turn> = turns.iter().filter(|it| !is_fault(it) || chance.random_ratio(1, 60)).collect();
    (!often.is_empty()).then(|| often[chance.random_range(0..often.len())])
}

impl Action {
    /// What the robots do that have these names.
    fn renamed(self, naming: Naming) -> Self {
        match self {
            Self::Beat(place) => Self::Beat(naming[place]),
            Self::Take { from, to } => Self::Take { from: naming[from], to: naming[to] },
            Self::Lose { from, to, at } => Self::Lose { from: naming[from], to: naming[to], at },
            Self::Rest(place) => Self::Rest(naming[place]),
            Self::Tick => Self::Tick,
            Self::Die(place) => Self::Die(naming[place]),
            Self::Restart(place, store) => Self::Restart(naming[place], store),
        }
    }
}

fn possible(model: &Teams<Team>, team: &State<Team>) -> Vec<Turn> {
    let mut turns = Vec::new();
    model.actions(team, &mut turns);
    turns
}
