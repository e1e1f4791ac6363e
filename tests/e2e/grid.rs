//! `rohrpost path` and `rohrpost entrances`, as the book shows them and as people mistype them.

use crate::docs_printed::shown;
use crate::harness::{Place, repository};
use serde_json::json;
use std::fs;

const PAGE: &str = "docs/src/tools.md";

/// A place with the files that the book shows, `lab.map` and `robots.txt`.
fn lab() -> Place {
    let place = Place::new();
    let page = fs::read_to_string(repository(PAGE)).unwrap();
    let blocks = page.split("\n```text\n").filter_map(|rest| rest.split_once("\n```"));
    let begins = |begin: &str| blocks.clone().map(|(block, _)| block).find(|block| block.starts_with(begin)).unwrap();
    place.write("lab.map", format!("{}\n", begins("****")));
    place.write("robots.txt", format!("{}\n", begins("8,4 N")));
    place
}

#[test]
fn the_book_shows_what_path_and_entrances_print() {
    let place = lab();
    let commands = shown(PAGE).into_iter().filter(|(command, _)| command.contains(" lab.map "));
    let mut count = 0;
    for (command, lines) in commands {
        let said = place.say(&command.split(' ').collect::<Vec<_>>());
        assert_eq!((said.out + &said.err).trim_end(), lines.join("\n"), "{command}");
        count += 1;
    }
    assert_eq!(count, 5);
}

#[test]
fn programs_read_cells_lengths_and_why_there_is_no_path() {
    let place = lab();
    let path = |to: &[&str]| place.say(&[&["path", "lab.map", "--from", "3,2", "--json"], to].concat());
    let cells = json!([[3, 2], [3, 3], [3, 4]]);
    assert_eq!(path(&["--to", "3,4"]).json(), json!({ "length": 2, "cells": cells }));
    assert_eq!(path(&["--to", "13,6", "--to", "3,4"]).json()["length"], 2, "the nearest goal");
    assert_eq!(path(&["--to", "3,2"]).json(), json!({ "length": 0, "cells": [[3, 2]] }));
    let said = path(&["--to", "5,3"]);
    assert_eq!((said.code, said.err.as_str()), (Some(1), ""));
    let why = "5,3 is a blank; a robot starts and ends on a path";
    let told: serde_json::Value = serde_json::from_str(&said.out).unwrap();
    assert_eq!(told, json!({ "length": null, "cells": [], "reason": why }));
    let entrances = ["entrances", "lab.map", "--intruder", "3,4", "--intruder", "3,5", "--from", "3,2", "--json"];
    let found = json!([{ "cell": [3, 3], "distance": 1 }, { "cell": [3, 6], "distance": 14 }]);
    assert_eq!(place.say(&entrances).json(), json!({ "entrances": found }));
    place.write("closed.txt", "4,2 W\n3,3 stopped\n");
    let said =
        place.say(&["entrances", "lab.map", "--robots", "closed.txt", "--intruder", "13,4", "--from", "3,2", "--json"]);
    assert_eq!((said.code, said.err.as_str()), (Some(1), "no entrance can be reached from 3,2\n"));
    let told: serde_json::Value = serde_json::from_str(&said.out).unwrap();
    let closed = json!([{ "cell": [13, 3], "distance": null }, { "cell": [13, 5], "distance": null }]);
    assert_eq!(told, json!({ "entrances": closed }));
}

#[test]
fn mistakes_in_files_and_words_are_told_with_what_would_be_right() {
    let place = lab();
    place.write("close.map", "***\n*.R\n");
    place.write("x.map", "***\n*x.\n");
    place.write("robots", "3,2 N\n3,3 up\n");
    let at = ["--from", "1,1", "--to", "2,1"];
    let close = "close.map: line 2, column 2: a path beside the bound of the map; expected a blank between\n\
                 close.map: line 2, column 3: a path beside the bound of the map; expected a blank between\n";
    let said = place.say(&[&["path", "close.map"], &at[..]].concat());
    let note = "note: robots and intruders that a map draws begin there; --robots says what is in the way\n";
    assert_eq!((said.code, said.out.as_str()), (Some(0), "1 step\n1,1 2,1\n"));
    assert_eq!(said.err, format!("warning: {close}{note}"));
    assert_eq!(place.say(&[&["path", "--strict", "close.map"], &at[..]].concat()).fails(), close);
    place.say(&[&["path", "x.map"], &at[..]].concat()).fails_with(["x.map: line 2, column 2: `x` is no square; "]);
    place.say(&[&["path", "none.map"], &at[..]].concat()).fails_with(["none.map: No such file"]);
    place.say(&[&["path", "/dev/zero"], &at[..]].concat()).fails_with(["/dev/zero: longer than 16000000 bytes; "]);
    let robots = ["path", "lab.map", "--robots", "robots", "--from", "3,2", "--to", "3,4"];
    place.say(&robots).fails_with(["robots: line 2, column 5: expected column,row and N, E, S, W", "found `up`"]);
    let said = place.say(&["entrances", "lab.map", "--intruder", "90,4", "--from", "3,2"]);
    assert_eq!(said.fails(), "no path is beside the intruder; the map may be another, or the intruder elsewhere\n");
    let said = place.say(&["path", "lab.map", "--from", "3;2", "--to", "3,4"]);
    assert_eq!(said.code, Some(2));
    assert!(said.err.contains("expected column,row, counted from 0 at the upper left, such as 3,4"), "{said:?}");
}
