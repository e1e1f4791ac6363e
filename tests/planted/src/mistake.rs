//! A mistake, and the run of a test that must notice it.

use crate::{Edit, Verdict, run};

/// A mistake that one could make.
pub struct Mistake {
    /// A sentence; a test has this name, too.
    pub name: &'static str,
    /// Where it is planted.
    pub edits: &'static [Edit],
    /// The test that fails.
    pub test: &'static str,
    /// What it says then, beside its name. A model says the promise that is broken.
    pub says: &'static str,
}

/// A mistake that makes a test fail, whatever that says.
pub const fn mistake(name: &'static str, edits: &'static [Edit], test: &'static str) -> Mistake {
    Mistake { name, edits, test, says: "" }
}

/// Mistakes of one crate's copy, in groups.
pub type Catalog = [&'static [Mistake]];

impl Mistake {
    /// The one of this name in a catalogue.
    ///
    /// # Panics
    /// If there is none.
    pub fn named(catalog: &Catalog, name: &str) -> &'static Self {
        let mut mistakes = catalog.iter().copied().flatten();
        mistakes.find(|mistake| mistake.name == name).unwrap_or_else(|| panic!("no mistake is called {name}"))
    }

    /// Names and edits, as [`planted`](crate::planted) takes them.
    pub(crate) fn edits<'a>(mistakes: impl IntoIterator<Item = &'a Self>) -> Vec<(&'a str, &'a [Edit])> {
        mistakes.into_iter().map(|mistake| (mistake.name, mistake.edits)).collect()
    }
}

/// That a mistake makes its test fail.
///
/// # Panics
/// If it does not.
pub fn is_noticed(catalog: &Catalog, name: &str) {
    let Mistake { test, says, .. } = Mistake::named(catalog, name);
    let ran = run(&["--nocapture", "--exact", test], Some(name));
    assert_eq!(ran.verdict(), Verdict::Failed, "{test} should notice {name}:\n{}", ran.text);
    assert!(ran.text.contains(says), "it should say {says:?}, not:\n{}", ran.text);
}

/// That all tests which notice mistakes pass without one; what they say.
///
/// # Panics
/// If one does not, or there is none.
pub fn all_pass_without_a_mistake() -> String {
    let ran = run(&["--nocapture"], None);
    assert!(ran.passed && !ran.text.contains("running 0 tests"), "{}", ran.text);
    ran.text
}
