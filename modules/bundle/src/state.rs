//! What a node remembers of its bundles, in `state.toml`.

use crate::digest::Sha256;
use serde::Deserialize;

/// Bundles that a node keeps.
const KEPT: usize = 3;
/// A longer file is no such file.
pub(crate) const STATE_BYTES_MAX: usize = 4096;
const PREAMBLE: &str = "# Written by rohrpost: the bundles of this node, the newest first.\n";

/// How far the trial of a bundle is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrialState {
    /// The next launch begins it.
    Due,
    /// A launch has begun it; if none runs, that one was killed.
    Running,
    /// All modules stayed up.
    Passed,
    /// A module did not stay up, or launch did not end the trial.
    Failed,
}

const WORDS: [(&str, TrialState); 4] = [
    ("due", TrialState::Due),
    ("running", TrialState::Running),
    ("passed", TrialState::Passed),
    ("failed", TrialState::Failed),
];

impl TrialState {
    /// One word.
    pub fn name(self) -> &'static str {
        WORDS.iter().find(|(_, state)| *state == self).map_or("", |(word, _)| word)
    }
}

/// A bundle that the node has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Kept {
    pub(crate) bundle: Sha256,
    pub(crate) version: u64,
    pub(crate) trial: TrialState,
}

/// What a node remembers of its bundles.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct State {
    /// The bundle with the highest version that was ever accepted.
    newest: Option<(u64, Sha256)>,
    /// The newest first: [`back`](crate::NodeFolder::back) goes to the one behind the current.
    order: Vec<Kept>,
}

/// Why bytes are no such state.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}; if nobody can repair it, remove it: then any version is accepted, and there is no way back")]
pub struct StateError(String);

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct RawState {
    newest_version: u64,
    newest_bundle: String,
    #[serde(rename = "bundle")]
    order: Vec<RawKept>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawKept {
    sha256: String,
    version: u64,
    trial: String,
}

impl State {
    /// Reads the bytes of the file.
    ///
    /// # Errors
    /// Everything that [`text`](Self::text) does not write in the same words.
    pub fn parse(bytes: &[u8]) -> Result<Self, StateError> {
        let wrong = |what: &str| StateError(format!("no state of bundles: {what}"));
        let text = std::str::from_utf8(bytes).map_err(|_| wrong("no text"))?;
        let raw: RawState =
            toml::from_str(text).map_err(|error| wrong(&error.message().replace(char::is_control, " ")))?;
        let digest = |text: &str| Sha256::parse(text).ok_or_else(|| wrong("no digest"));
        let kept = |raw: RawKept| {
            let trial = WORDS.iter().find(|(word, _)| *word == raw.trial).ok_or_else(|| wrong("no state of a trial"));
            Ok(Kept { bundle: digest(&raw.sha256)?, version: raw.version, trial: trial?.1 })
        };
        let newest = Some((raw.newest_version, digest(&raw.newest_bundle)?));
        let order: Vec<Kept> = raw.order.into_iter().map(kept).collect::<Result<_, _>>()?;
        if order.is_empty() || order.len() > KEPT {
            return Err(wrong("one to three bundles are right"));
        }
        Ok(Self { newest, order })
    }

    /// Text of the file; empty while there was no bundle.
    pub fn text(&self) -> String {
        let Some((version, bundle)) = self.newest else { return String::new() };
        let mut text = format!("{PREAMBLE}newest-version = {version}\nnewest-bundle = \"{bundle}\"\n");
        for Kept { bundle, version, trial } in &self.order {
            let trial = trial.name();
            text += &format!("\n[[bundle]]\nsha256 = \"{bundle}\"\nversion = {version}\ntrial = \"{trial}\"\n");
        }
        text
    }

    pub(crate) fn newest(&self) -> Option<(u64, Sha256)> {
        self.newest
    }

    pub(crate) fn order(&self) -> &[Kept] {
        &self.order
    }

    /// What is remembered of a bundle.
    pub(crate) fn of(&self, bundle: Sha256) -> Option<Kept> {
        self.order.iter().find(|kept| kept.bundle == bundle).copied()
    }

    /// The bundles before another, the nearest first.
    pub(crate) fn behind(&self, bundle: Sha256) -> impl Iterator<Item = Kept> {
        self.order.iter().skip_while(move |kept| kept.bundle != bundle).skip(1).copied()
    }

    pub(crate) fn set_trial(&mut self, bundle: Sha256, trial: TrialState) {
        self.order.iter_mut().filter(|kept| kept.bundle == bundle).for_each(|kept| kept.trial = trial);
    }

    /// A bundle is to be the current one, and `current` the one before it. Bundles newer than `current` are left out:
    /// the node has gone back from them.
    pub(crate) fn accept(&mut self, bundle: Sha256, version: u64, current: Option<Sha256>) {
        let rest = current.and_then(|current| self.order.iter().position(|kept| kept.bundle == current));
        let rest = rest.map_or(Vec::new(), |at| self.order.split_off(at));
        let new = Kept { bundle, version, trial: TrialState::Due };
        let rest = rest.into_iter().filter(|kept| kept.bundle != bundle);
        self.order = std::iter::once(new).chain(rest).take(KEPT).collect();
        self.newest = Some((version, bundle));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_bundles_are_kept_and_those_it_went_back_from_are_not() {
        let name = |version: u64| Sha256::of(&version.to_le_bytes());
        let mut state = State::default();
        assert_eq!(state.text(), "");
        let versions = |state: &State| state.order.iter().map(|kept| kept.version).collect::<Vec<_>>();
        for (version, current, order) in [
            (1, None, vec![1]),
            (2, Some(1), vec![2, 1]),
            (3, Some(2), vec![3, 2, 1]),
            (4, Some(3), vec![4, 3, 2]),
            (5, Some(3), vec![5, 3, 2]),
            (5, Some(3), vec![5, 3, 2]),
            (6, Some(2), vec![6, 2]),
        ] {
            state.accept(name(version), version, current.map(name));
            assert_eq!(versions(&state), order, "{version} after {current:?}");
            assert_eq!(state.newest(), Some((version, name(version))));
            assert_eq!(State::parse(state.text().as_bytes()).as_ref(), Ok(&state));
        }
        state.set_trial(name(6), TrialState::Failed);
        assert_eq!(state.of(name(6)).map(|kept| kept.trial), Some(TrialState::Failed));
        let behind = |version| state.behind(name(version)).map(|kept| kept.version).collect::<Vec<_>>();
        assert_eq!((behind(6), behind(2), behind(1)), (vec![2], vec![], vec![]));
        let text = state.text();
        for (from, to) in
            [("failed", "failing"), ("newest-version = 6", ""), ("[[bundle]]", "[[bundles]]"), ("6", "-6")]
        {
            assert!(State::parse(text.replacen(from, to, 1).as_bytes()).is_err(), "{from}");
        }
    }
}
