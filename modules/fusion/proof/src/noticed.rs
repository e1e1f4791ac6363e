//! Runs promises with and without a mistake.

use crate::catalog::MISTAKES;
use rohrpost_planted::{Verdict, run};

pub(crate) fn is_noticed(name: &str) {
    let mistake = MISTAKES.iter().find(|mistake| mistake.name == name).unwrap();
    let ran = run(&["--exact", mistake.promise], Some(name));
    assert_eq!(ran.verdict(), Verdict::Failed, "{} should notice {name}:\n{}", mistake.promise, ran.text);
}

#[test]
fn without_a_mistake_all_promises_are_kept() {
    let ran = run(&[], None);
    assert!(ran.passed && !ran.text.contains("running 0 tests"), "{}", ran.text);
}
