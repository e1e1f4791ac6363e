//! What a team promises, in words and as a check of one step; and what has to be possible, so that the promises are not
//! kept by robots that never meet.

use super::super::group::Notice;
use super::super::view::Record;
use super::super::{RobotId, Team, Version};
use super::bounds::{Bounds, Loss, Story};
use super::key::{ROBOTS, id};
use super::team::{MAX_AGE_BEATS, Message, is_certain, knows_its_end};
use super::world::{Action, Robot, State, Step, Teams};
use stateright::Property;
use std::sync::Arc;

/// Beats after the last fault until leaders and groups are right.
pub(super) const PAIRS: u8 = 3;
/// Until all robots have the same records: three beats after that.
pub(super) const VIEWS: u8 = PAIRS + 3;
/// Until all know that.
pub(super) const KNOWN: u8 = VIEWS + 1;
/// For so many beats a dead robot may be taken for fresh.
const GHOST: u8 = MAX_AGE_BEATS as u8 + 3;

/// A promise: its words, which are the property's name, and whether a step keeps it.
macro_rules! promises {
    ($($words:literal: $is_kept:expr;)*) => {
        const PROMISES: &[(&str, fn(&Step<'_, Team>) -> bool)] = &[$(($words, $is_kept)),*];

        fn always() -> Vec<Property<Teams<Team>>> {
            vec![$(Property::always($words, |_, state: &State<Team>| !state.broken.contains(&$words))),*]
        }
    };
}

promises! {
    "leader and group are right two beats after the last fault": |step| {
        let state = step.after;
        state.calm < PAIRS || state.alive().all(|place| is_right(state, place))
    };
    "a dead robot is forgotten after its greatest age and two beats": |step| {
        let state = step.after;
        state.dead_for < GHOST || !state.alive().any(|place| has_ghost(state, place))
    };
    "views are equal three beats after leader and group": |step| {
        let state = step.after;
        state.calm < VIEWS || same_records(state)
    };
    "a team that agrees sends no synchro": |step| {
        let sends = |place: usize| synchros(step.after, place) > synchros(step.before, place);
        step.before.calm < VIEWS || !(0..ROBOTS).any(sends)
    };
    "equal digests are equal records": |step| {
        let team = |place: usize| &step.after.robots[place];
        let is_told = |a: &Team, b: &Team| a.view().digests() != b.view().digests() || records(a) == records(b);
        changed(step).all(|a| step.after.alive().all(|b| a == b || is_told(team(a), team(b))))
    };
    "a robot knows that its view is everybody's": |step| {
        let state = step.after;
        state.calm < KNOWN || state.alive().all(|place| state.robots[place].agrees(state.now_ns(place)))
    };
    "what a robot knows of another one does not go back": |step| {
        has_restarted(step) || changed(step).all(|place| {
            let newer = |robot| step.after.robots[place].group().member(robot).map(|member| member.version);
            let mut before = step.before.robots[place].group().members();
            before.all(|(robot, member)| newer(robot) >= Some(member.version))
        })
    };
    "a robot names only robots that it hears": |step| step.after.alive().all(|place| {
        let mut members = step.after.robots[place].group().members();
        members.all(|(_, it)| it.hops > 0 || it.direct.as_ref().is_some_and(|direct| direct.version == it.version))
    });
    "no record is lost": |step| has_restarted(step) || changed(step).all(|place| {
        let after = records(&step.after.robots[place]);
        let kept = |old: &(_, _, &Record)| after.iter().any(|new| (new.0, new.1) == (old.0, old.1) && new.2 >= old.2);
        records(&step.before.robots[place]).iter().all(kept)
    });
    "nobody is certain of what was seen to be gone": |step| {
        let state = step.after;
        state.left.story != Story::Refuted || !changed(step).any(|place| {
            knows_its_end(&state.robots[place]) && is_certain(&state.robots[place])
        })
    };
    "what has ended does not come back": |step| {
        let knew = |place: usize| knows_its_end(&step.before.robots[place]);
        step.after.left.story != Story::Ended
            || !changed(step).any(|place| knew(place) && is_certain(&step.after.robots[place]))
    };
    "an earlier record that was lost is fetched though a later one came": |step| {
        let state = step.after;
        let has_both = |place: usize| records(&state.robots[place]).len() == 2;
        let is_there = state.left.story == Story::Unheard && state.alive().any(has_both);
        !is_there || state.calm < VIEWS || state.alive().all(has_both)
    };
    "a restarted robot is not taken for two": |step| {
        let is_told = |place: usize| {
            let mut notices = step.after.robots[place].group().notices().iter();
            notices.any(|notice| matches!(notice, Notice::Duplicate(_)))
        };
        !step.after.alive().any(is_told)
    };
}

/// Promises that a step breaks.
pub(super) fn broken(step: &Step<'_, Team>) -> Vec<&'static str> {
    PROMISES.iter().filter(|(_, is_kept)| !is_kept(step)).map(|(words, _)| *words).collect()
}

/// What has to happen somewhere in a model: its words, and the state in which it has.
macro_rules! possible {
    ($model:ident: $($words:literal: $has_happened:expr;)*) => {
        fn $model() -> Vec<Property<Teams<Team>>> {
            vec![$(Property::<Teams<Team>>::sometimes($words, $has_happened)),*]
        }
    };
}

possible! { with_a_death:
    "all agree on leader and group": |_, state| state.calm >= PAIRS && state.alive().count() == ROBOTS;
    "two agree without the third": |_, state| state.calm >= PAIRS && state.dead_for >= GHOST;
    "a dead robot is taken for fresh": |_, state| {
        state.alive().any(|place| has_ghost(state, place))
    };
    "a robot goes above its earlier incarnation": |_, state| {
        state.alive().any(|place| state.robots[place].group().has_raised())
    };
}

possible! { with_a_loss:
    "a robot is known through another one alone": |_, state| state.alive().any(|place| {
        state.robots[place].group().fresh(state.now_ns(place)).any(|(_, member)| member.hops > 0)
    });
    "a lost hello makes a robot a dead one": |_, state| {
        state.left.may_lose == Loss::Nothing && state.calm > 0 && !state.alive().all(|place| is_right(state, place))
    };
}

possible! { in_views:
    "all have the same records, and know it": |_, state| state.calm >= KNOWN && same_records(state);
    "a synchro is on its way": |_, state| (0..ROBOTS).any(|from| synchros(state, from) > 0);
    "leaders agree, views do not": |_, state| (0..ROBOTS).all(|place| is_right(state, place)) && !same_records(state);
}

/// All of both.
pub(super) fn properties(bounds: Bounds) -> Vec<Property<Teams<Team>>> {
    let sometimes = match bounds {
        Bounds { story: Story::Nothing, may_die: true, .. } => with_a_death(),
        Bounds { story: Story::Nothing, .. } => with_a_loss(),
        _ => in_views(),
    };
    always().into_iter().chain(sometimes).collect()
}

/// Whether those that a robot takes for fresh are all that live, itself among them, and so its leader and group are the
/// least and the greatest of these; a ghost may be one as long as it may be one.
fn is_right(state: &State<Team>, place: usize) -> bool {
    let fresh = state.robots[place].group().fresh(state.now_ns(place)).map(|(robot, _)| robot);
    let fresh: Vec<RobotId> = fresh.collect();
    let is_it = |all: Vec<usize>| all.into_iter().filter(|it| *it != place).map(id).eq(fresh.iter().copied());
    is_it(state.alive().collect()) || state.dead_for < GHOST && is_it((0..ROBOTS).collect())
}

/// Whether a robot takes a dead one for fresh.
fn has_ghost(state: &State<Team>, place: usize) -> bool {
    let mut fresh = state.robots[place].group().fresh(state.now_ns(place));
    fresh.any(|(robot, _)| (0..ROBOTS).any(|it| state.is_dead[it] && id(it) == robot))
}

fn records(team: &Team) -> Vec<(RobotId, Version, &Record)> {
    let mut all = Vec::new();
    for (observer, ledger) in team.view().ledgers() {
        all.extend(ledger.records.iter().map(|(number, kept)| (*observer, *number, &kept.record)));
    }
    all
}

fn same_records(state: &State<Team>) -> bool {
    let mut all = state.alive().map(|place| records(&state.robots[place]));
    let first = all.next();
    all.all(|it| Some(it) == first)
}

/// Robots that the step has changed.
fn changed<'a>(step: &'a Step<'_, Team>) -> impl Iterator<Item = usize> + 'a {
    step.after.alive().filter(|place| !Arc::ptr_eq(&step.after.robots[*place], &step.before.robots[*place]))
}

fn has_restarted(step: &Step<'_, Team>) -> bool {
    matches!(step.action, Action::Restart(..))
}

/// Synchros of a robot that are on their way.
fn synchros(state: &State<Team>, from: usize) -> usize {
    let is_synchro = |message: &Message| matches!(message, Message::Records(records) if records.is_synchro);
    state.channels.iter().flat_map(|to| &to[from]).filter(|message| is_synchro(message)).count()
}
