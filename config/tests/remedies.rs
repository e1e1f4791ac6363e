//! The remedies in messages about a broken slot table are right.

use rohrpost_config::Installation;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/broken")
}

fn read(file: &str) -> String {
    fs::read_to_string(folder().join(format!("slots-{file}.toml"))).expect("a file of the tests")
}

/// All messages for a text; empty if it is accepted.
fn messages(text: &str) -> String {
    Installation::parse(text, Path::new("robot.toml")).err().map_or_else(String::new, |errors| errors.to_string())
}

/// Where to write something: in the section that begins in a line, or in a [[slot]] of its own.
#[derive(Clone, Copy)]
enum At {
    Line(usize),
    NewSlot,
}
use At::{Line, NewSlot};

/// Writes `key = value` in place of what the key says there, or besides.
fn write(text: &str, at: At, assignment: &str) -> String {
    let mut lines: Vec<&str> = text.lines().collect();
    let (key, _) = assignment.split_once(" = ").expect("a key and its value");
    let begin = match at {
        Line(line) => line,
        NewSlot if key == "node" => {
            lines.extend(["", "[[slot]]"]);
            lines.len()
        }
        NewSlot => lines.iter().rposition(|line| *line == "[[slot]]").expect("its node comes first") + 1,
    };
    assert!(lines[begin - 1].starts_with('['), "a section begins in line {begin}");
    let section = lines[begin..].iter().take_while(|line| !line.is_empty());
    let there = section.clone().position(|line| line.split(" = ").next() == Some(key));
    match there {
        Some(line) => lines[begin + line] = assignment,
        None => lines.insert(begin, assignment),
    }
    lines.join("\n")
}

type Changes = &'static [(At, &'static str)];

/// Files of `tests/broken`, and the remedies of their messages, word for word: all of it, or one of several offered.
const WRITTEN: &[(&str, Changes)] = &[
    ("all-guard", &[(Line(38), "length = \"410 us\"")]),
    (
        "deadline-another-slot",
        &[(NewSlot, "node = \"base\""), (NewSlot, "offset = \"2.5 ms\""), (NewSlot, "length = \"470 us\"")],
    ),
    ("cycle", &[(Line(26), "cycle = \"500 ms\"")]),
    ("deadline-far", &[(NewSlot, "node = \"base\""), (NewSlot, "offset = \"1 ms\""), (NewSlot, "length = \"410 us\"")]),
    ("deadline-too-far", &[(Line(63), "deadline = \"400.9 ms\"")]),
    ("deadline-later", &[(Line(70), "deadline = \"5.5 ms\"")]),
    ("deadline-longer-slot", &[(Line(33), "length = \"470 us\"")]),
    ("deadline-oftener", &[(Line(38), "period = 1"), (Line(38), "phase = 0")]),
    ("end-of-the-cycle", &[(Line(45), "offset = \"4 ms\"")]),
    ("far", &[(Line(38), "offset = \"149 ms\"")]),
    ("far", &[(Line(26), "guard = \"170 us\"")]),
    ("flow-too-quick", &[(Line(70), "period = \"10 ms\"")]),
    ("guard-too-large", &[(Line(26), "guard = \"240 us\"")]),
    ("guard-too-short-for-the-link", &[(Line(26), "guard = \"230 us\""), (Line(38), "length = \"630 us\"")]),
    ("guard-too-small", &[(Line(26), "guard = \"120 us\"")]),
    ("in-synchronisation", &[(Line(33), "offset = \"1 ms\"")]),
    ("in-the-way", &[(Line(33), "length = \"410 us\""), (Line(38), "offset = \"2.11 ms\"")]),
    ("more-than-the-link", &[(Line(73), "period = \"50 ms\"")]),
    ("more-waits-than-the-quota", &[(Line(24), "quota = \"256 KiB\"")]),
    (
        "node-without",
        &[(NewSlot, "node = \"brain\""), (NewSlot, "offset = \"2 ms\""), (NewSlot, "length = \"410 us\"")],
    ),
    (
        "nodes-without",
        &[
            (NewSlot, "node = \"brain\""),
            (NewSlot, "offset = \"2 ms\""),
            (NewSlot, "length = \"430 us\""),
            (NewSlot, "node = \"desk\""),
            (NewSlot, "offset = \"2.43 ms\""),
            (NewSlot, "length = \"430 us\""),
        ],
    ),
    ("outside-the-cycle", &[(Line(38), "offset = \"4 ms\""), (Line(45), "length = \"500 us\"")]),
    ("overlap", &[(Line(38), "offset = \"1.3 ms\"")]),
    ("overlap-at-once", &[(Line(45), "offset = \"2.5 ms\"")]),
    ("overlap-in-some-cycles", &[(Line(40), "offset = \"2.2 ms\"")]),
    ("overlap-in-some-cycles", &[(Line(33), "length = \"1 ms\"")]),
    ("periods", &[(Line(45), "period = 8")]),
    ("periods-64-and-3", &[(Line(44), "period = 2"), (Line(44), "phase = 0")]),
    ("seldom", &[(Line(38), "period = 4")]),
    ("seldom-with-phase", &[(Line(38), "period = 4"), (Line(38), "phase = 3")]),
    ("synchronisation-fills-the-cycle", &[(Line(26), "synchronisation = \"240 us\"")]),
    ("synchronisation-of-one-master", &[(Line(26), "synchronisation = \"240 us\"")]),
    ("synchronisation-too-short", &[(Line(26), "synchronisation = \"240 us\"")]),
    ("too-much", &[(NewSlot, "node = \"base\""), (NewSlot, "offset = \"2.5 ms\""), (NewSlot, "length = \"500 us\"")]),
    ("too-short", &[(Line(38), "length = \"410 us\"")]),
];

/// Remedies in other words, and their meaning.
const MEANT: &[(&str, &str, Changes)] = &[
    (
        "flow-not-real-time",
        "give the module that sends or subscribes a class from `bulk-below` of [network] up",
        &[(Line(7), "pilot = { id = 145 }")],
    ),
    (
        "node-without-and-no-room",
        "no 410 us of the cycle are free for one: shorten others",
        &[
            (Line(33), "length = \"3 ms\""),
            (NewSlot, "node = \"brain\""),
            (NewSlot, "offset = \"4 ms\""),
            (NewSlot, "length = \"410 us\""),
        ],
    ),
    (
        "periods-of-all",
        "write only powers of two up to 64 as periods",
        &[(Line(33), "period = 8"), (Line(39), "period = 8"), (Line(45), "period = 8")],
    ),
];

/// Applies the remedy. In a table without other mistakes deadlines are checked for the first time: they alone may be
/// too short.
fn check(file: &str, said: &str, changes: Changes) {
    let right = changes.iter().fold(read(file), |text, (at, assignment)| write(&text, *at, assignment));
    let after = messages(&right);
    let is_of_flows = |line: &str| line.contains(": [[flow]] ");
    assert!(after.lines().all(is_of_flows), "{file}: it said\n{said}\nand then\n{after}");
    assert!(after.is_empty() || !said.lines().any(is_of_flows), "{file}: it said\n{said}\nand then\n{after}");
}

#[test]
fn what_a_message_says_to_write_is_accepted() {
    for (file, changes) in WRITTEN {
        let said = messages(&read(file));
        for (_, assignment) in *changes {
            assert!(said.contains(&format!("`{assignment}`")), "{file}: `{assignment}` is not in\n{said}");
        }
        check(file, &said, changes);
    }
    for (file, words, changes) in MEANT {
        let said = messages(&read(file));
        assert!(said.contains(words), "{file}: `{words}` is not in\n{said}");
        check(file, &said, changes);
    }
}

#[test]
fn no_broken_table_is_left_out() {
    let names = fs::read_dir(folder()).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let slots = |name: String| Some(name.strip_prefix("slots-")?.strip_suffix(".toml")?.to_owned());
    let all: BTreeSet<String> = names.filter_map(slots).collect();
    let tried = WRITTEN.iter().map(|(file, _)| *file).chain(MEANT.iter().map(|(file, ..)| *file));
    assert_eq!(tried.map(String::from).collect::<BTreeSet<_>>(), all);
}

/// A random table by an author without knowledge of the rules.
fn random_table(mut random: impl FnMut(u64) -> u64) -> String {
    let (head, _) = include_str!("tdma.toml").split_once("[[slot]]").expect("slots");
    let mut pick = |of: &[u64]| of[random(of.len() as u64) as usize];
    let cycle_ms = pick(&[5, 5, 10, 20, 100, 200, 510]);
    let mut text = head
        .replace("[network]", "[nodes.desk]\naddress = \"10.77.0.3\"\ntools = [32, 47]\n\n[network]")
        .replace("cycle = \"5 ms\"", &format!("cycle = \"{cycle_ms} ms\""))
        .replace("guard = \"150 us\"", &format!("guard = \"{} us\"", pick(&[150, 150, 20, 100, 400, 1000])))
        .replace("= \"500 us\"", &format!("= \"{} us\"", pick(&[500, 500, 200, 300, 1000, 2500])))
        .replace("100 Mbit/s", &format!("{} Mbit/s", pick(&[50, 100, 1000])));
    for _ in 0..random(7) {
        let node = ["base", "brain", "desk"][random(3) as usize];
        let far = [60, 10 * cycle_ms + 10][random(2) as usize];
        let offset_us = 100 * random(far);
        let length_us = 100 + 50 * random(24);
        let period = [1, 1, 1, 2, 3, 4, 5, 7, 8, 10, 64][random(11) as usize];
        text += &format!("[[slot]]\nnode = \"{node}\"\noffset = \"{offset_us} us\"\nlength = \"{length_us} us\"\n");
        text += &format!("period = {period}\nphase = {}\n\n", random(period));
    }
    let masters = ["[\"base\"]", "[\"base\", \"brain\"]"][random(2) as usize];
    text += &format!("[time]\nsource = \"master\"\nmasters = {masters}\n\n");
    text + "[[module]]\nname = \"motor.0\"\nnode = \"base\"\nprogram = \"./motor\"\n"
}

/// The first remedy that a message offers, and its place; none if the message leaves that to people.
fn remedy(message: &str) -> Option<Vec<(At, String)>> {
    let line = |text: &str| text.split([':', ')']).next().and_then(|number| number.parse().ok());
    let (_, right) = message.rsplit_once("; ")?;
    let first = right.split(", or ").next()?;
    let at = if first.starts_with("add a [[slot]]") {
        NewSlot
    } else if first.ends_with(" there") {
        Line(line(message.rsplit_once("(line ")?.1)?)
    } else {
        Line(line(message.split_once(':')?.1)?)
    };
    let assignments = first.split('`').skip(1).step_by(2).filter(|quoted| quoted.contains(" = "));
    let changes: Vec<_> = assignments.map(|assignment| (at, assignment.to_owned())).collect();
    (!changes.is_empty()).then_some(changes)
}

/// Remedies conflict neither with each other nor with a rule.
#[test]
fn all_that_is_said_of_a_table_can_be_done_at_once() {
    let mut state = 1_u64;
    let mut fixed = 0;
    for _ in 0..1000 {
        let table = random_table(|below| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        });
        let said = messages(&table);
        let Some(remedies) = said.lines().map(remedy).collect::<Option<Vec<_>>>() else { continue };
        let (new, changed): (Vec<_>, Vec<_>) =
            remedies.into_iter().flatten().partition(|(at, _)| matches!(at, NewSlot));
        // Lines may be added: the last ones first, so that the others keep their numbers.
        let right = changed.iter().rev().chain(&new).fold(table.clone(), |text, (at, words)| write(&text, *at, words));
        assert_eq!(messages(&right), "", "of\n{table}\nit said\n{said}");
        fixed += usize::from(!said.is_empty());
    }
    assert!(fixed > 500, "only {fixed} tables");
}
