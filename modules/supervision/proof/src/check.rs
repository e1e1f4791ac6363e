//! Runs a model over its whole state space: all promises are kept there, and in a process that makes a mistake the one
//! that this breaks is not.

use crate::catalog::MISTAKES;
use rohrpost_planted::Mistake;
use stateright::{Checker, CheckerBuilder, Expectation, HasDiscoveries, Model};
use std::fmt::Debug;
use std::hash::Hash;
use std::time::Instant;

/// What can be kept, compared and told.
pub(crate) trait Kept: Clone + Debug + PartialEq {}

impl<T: Clone + Debug + PartialEq> Kept for T {}

/// A model with states that can be kept, compared and told.
pub(crate) trait Checkable:
    Model<State: Kept + Hash + Send + Sync, Action: Kept> + Send + Sync + 'static
{
}

impl<M: Model<State: Kept + Hash + Send + Sync, Action: Kept> + Send + Sync + 'static> Checkable for M {}

/// Whatever can be reached is reached, all promises are kept there, and what has to be possible is.
///
/// # Panics
/// If not; it says which promise is broken, and by which steps. In a process that makes a mistake only the promise of
/// that one is looked at.
pub(crate) fn holds(name: &str, model: impl Checkable) {
    holds_by(name, |checker| checker.spawn_bfs(), model);
}

/// As [`holds`], in an order of one's own: depth first keeps fewer states that wait.
pub(crate) fn holds_by<M: Checkable, C: Checker<M>>(name: &str, spawn: impl FnOnce(CheckerBuilder<M>) -> C, model: M) {
    let began = Instant::now();
    if let Some(mistake) = rohrpost_planted::made() {
        let promise = Mistake::named(MISTAKES, mistake).says;
        let checker = spawn(model.checker().finish_when(HasDiscoveries::AllOf([promise].into()))).join();
        if let Some(path) = checker.discovery(promise) {
            panic!("`{promise}` is broken by {:?}", path.into_actions());
        }
        return;
    }
    let checker = spawn(model.checker().finish_when(HasDiscoveries::AnyFailures)).join();
    println!(
        "{name}: {} states by {} steps, in {:.1} s",
        checker.unique_state_count(),
        checker.state_count(),
        began.elapsed().as_secs_f64()
    );
    checker.assert_properties();
}

/// That each promise of a model is broken by a mistake.
pub(crate) fn each_promise_can_fail<M: Model>(model: &M) {
    let mistakes = || MISTAKES.iter().copied().flatten();
    let promises = model.properties().into_iter().filter(|property| property.expectation == Expectation::Always);
    let cannot_fail: Vec<&str> =
        promises.map(|promise| promise.name).filter(|name| !mistakes().any(|it| it.says == *name)).collect();
    assert!(cannot_fail.is_empty(), "no mistake breaks {cannot_fail:?}: can they fail?");
}
