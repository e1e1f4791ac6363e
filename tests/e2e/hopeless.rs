//! Modules that cannot start, however often they are tried: their mistake is told once, and the truth about the others.

use crate::harness::{OUTPUT, Place, RECORDED_CLASSES, probe};
use nix::sys::signal::Signal;

/// A module of a program in Python that never becomes one.
fn python(place: &Place, code: &str, keys: &str) -> String {
    place.program("hand.py", format!("#!/usr/bin/env python3\n{code}\n"));
    format!("[[module]]\nname = \"pilot.0\"\nprogram = \"./hand.py\"\n{keys}\n")
}

#[test]
fn a_mistake_that_stays_is_told_once_and_not_tried_again() {
    const KEYS: &str = "required = false";
    let missing = "[[module]]\nname = \"pilot.0\"\nprogram = [\"sh\", \"-c\", \"exec nowhere-installed\"]\n";
    let of_python = |code: &'static str| move |place: &Place| python(place, code, KEYS);
    type Entry = Box<dyn Fn(&Place) -> String>;
    let cases: [(Entry, &str); 5] = [
        (Box::new(of_python("def hold(:")), "SyntaxError: "),
        (Box::new(of_python("import nowhere_installed")), "ModuleNotFoundError: No module named 'nowhere_installed'"),
        (Box::new(of_python("from os import not_in_there")), "ImportError: cannot import name 'not_in_there'"),
        (Box::new(move |_| format!("{missing}{KEYS}\n")), "nowhere-installed: not found"),
        (Box::new(|_| probe("probe.1", "watches = \"output.0\"", KEYS)), "`output.0` is of class `output`, but"),
    ];
    for (module, words) in cases {
        let place = Place::new();
        let hopeless = module(&place);
        let config = place.config(&[&RECORDED_CLASSES, &hopeless, OUTPUT, &probe("probe.0", "", "")]);
        let mut launch = place.launch(&config);
        launch.wait_for("runs: ");
        launch.wait_for(" does not start; the others go on without it");
        launch.stop_failed();
        let told = launch.out();
        assert!(told.contains("not started again, since that would end in the same way"), "{told}");
        let (times, is_tried_again) = (told.matches(words).count(), told.contains("starts again"));
        assert_eq!((times, is_tried_again), (1, false), "{words}: {told}");
        place.assert_empty();
    }
}

#[test]
fn what_may_get_better_is_told_whole_once_and_then_in_short() {
    let place = Place::new();
    let flaky = python(&place, "raise RuntimeError('the port is not there')", "required = false");
    let config = place.config(&[&RECORDED_CLASSES, &flaky, OUTPUT, &probe("probe.0", "", "")]);
    let mut launch = place.launch(&config);
    launch.wait_for("starts again in 800ms; as before");
    let told = launch.out();
    assert_eq!(told.matches("RuntimeError: the port is not there").count(), 1, "{told}");
    launch.signal(Signal::SIGINT);
    launch.end();
    place.assert_empty();
}

#[test]
fn nobody_is_said_to_go_on_where_there_are_no_others() {
    let place = Place::new();
    let config = place.config(&[&RECORDED_CLASSES, OUTPUT, &python(&place, "def hold(:", "required = false")]);
    let said = place.start(&["launch", config.to_str().unwrap()]).said();
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(said.err.contains("module pilot.0 did not become ready") && said.err.contains("SyntaxError"), "{said:?}");
    assert!(!said.err.contains("the others go on") && !said.out.contains("the others go on"), "{said:?}");
    place.assert_empty();
}
