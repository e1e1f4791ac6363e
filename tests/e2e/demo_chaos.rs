//! The demo with chaos: its verdict, what happened, and its exit code.

use crate::harness::{Place, lacks_namespaces};

#[test]
fn it_tells_what_happened_how_long_each_lasted_and_that_nothing_was_touched() {
    let place = Place::new();
    let said = place.say(&["demo", "--nodes", "3", "--chaos", "7", "--seconds", "20"]);
    if lacks_namespaces(&said.err) {
        return;
    }
    assert_eq!(said.code, Some(0), "{said:?}");
    let verdict = said.out.split_once("The demo went well.\n").unwrap_or_else(|| panic!("{said:?}")).1;
    assert!(verdict.starts_with("0 touches count against the robot, of 0 in all; it drove "), "{verdict}");
    let rows: Vec<&str> = verdict.lines().skip_while(|line| !line.contains("what happened")).skip(1).collect();
    assert!(!rows.is_empty() && rows.iter().all(|row| !row.contains("never")), "{verdict}");
    for row in rows {
        let (_, fault) = row.trim().split_once(" s  the program").unwrap_or_else(|| panic!("{row}"));
        let lasted = ["ms", " s"].iter().any(|unit| fault.trim_end().ends_with(unit));
        assert!(lasted || fault.trim_end().ends_with("kept"), "{row}");
    }
    place.assert_empty();
}

#[test]
fn chaos_without_computers_or_an_end_is_refused() {
    let place = Place::new();
    place.say(&["demo", "--nodes", "1", "--chaos", "7", "--seconds", "5"]).fails_with(["use --nodes 3"]);
    for words in [&["demo", "--chaos", "7", "--seconds", "5"][..], &["demo", "--chaos", "7", "--nodes", "3"]] {
        assert_eq!(place.say(words).code, Some(2), "{words:?}");
    }
}
