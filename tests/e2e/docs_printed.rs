//! What README and the book show of the tools is what the tools print: each command that needs no more than the demo is
//! run on it; those of README in `readme.rs`. Numbers and times differ from run to run, and how the kernel schedules
//! from user to user; headers, rows and words do not.

use crate::harness::{Place, until};
use std::fs;
use std::path::Path;

/// How much of what a command prints is compared.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Compared {
    /// All of it; a line `…` in the book stands for any lines, one at the end of a line for the rest of that.
    Whole,
    /// The header: the rows show something that the demo does not have.
    Header,
}
use Compared::{Header, Whole};

/// Commands of `docs/src/tools.md`, in the order in which they are run.
const TOOLS: [(&str, Compared); 44] = [
    ("log", Whole),
    ("log --text MAP --last 1", Whole),
    ("list -m", Whole),
    ("status", Header),
    ("call odometry.0 get odometry", Whole),
    ("call motor.0 drive 0.1", Whole),
    ("call motor.0 drive NaN 0", Whole),
    ("data", Whole),
    ("echo odometry.0 -c 2", Whole),
    ("echo laser.0 --rate 1 -c 1", Whole),
    ("hz odometry.0 --count 2", Whole),
    ("bw pilot.0 --count 1", Whole),
    ("delay laser.0 --count 1", Whole),
    ("mailbox pilot.0.2", Whole),
    ("stream list", Whole),
    ("stream read odometry.0 odometry", Whole),
    ("graph", Whole),
    ("ping motor.0 -c 3 --interval 0.1", Whole),
    ("restart pilot.0", Whole),
    ("stop pilot.0", Whole),
    ("start pilot.0", Whole),
    ("param list", Whole),
    ("param get pilot.0", Whole),
    ("param set pilot.0 cruise-m-s 0.4", Whole),
    ("param set pilot.0 cruise-m-s 7", Whole),
    ("param set pilot.0 cruis-m-s 1", Whole),
    ("param save", Whole),
    ("param set pilot.0 cruise-m-s 0.5", Whole),
    ("param load --dry-run", Whole),
    ("log --level pilot.0=debug", Whole),
    ("log --level motor=debug", Whole),
    ("log --levels", Whole),
    ("interface export motor.0", Whole),
    ("interface export motor.0 --json -o motor.json", Whole),
    ("interface generate --lang rust motor.json -o motor.rs", Whole),
    ("interface generate --lang python motor.json -o motor.py", Whole),
    ("interface generate --lang c motor.json -o motor.h", Whole),
    ("version", Whole),
    ("check config/demo.toml", Whole),
    ("new WindVane", Whole),
    ("call pilot.0 off", Whole),
    ("send motor.0 drive 0.3 0.5 --rate 20 --count 40", Whole),
    ("send motor.0 drive NaN 0 --count 3", Whole),
    ("clean", Whole),
];

/// Commands of that page that are not run, by how they begin, and why.
const NOT_RUN: [(&str, &str); 18] = [
    ("check robot.toml", "a file with mistakes; `check.rs` has such"),
    ("launch", "it goes on; its words are those of `launch.rs`"),
    ("stop pilot.0", "the second time, of a module that is stopped already"),
    ("arena", "it goes on; its words are those of `arena.rs`"),
    ("demo", "a run of its own; `demo.rs` reads its summary"),
    ("top", "a screen; golden files of `top` have it"),
    ("log --file", "needs a recording that lost something"),
    ("ping pilot.0", "of a module that hangs; see `ping_send.rs`"),
    ("record", "needs a recording"),
    ("replay", "needs a recording"),
    ("net", "needs several nodes; see `lan_tools.rs`"),
    ("doctor", "tells of this computer; golden files of `doctor` have it"),
    ("keys", "writes keys; its own tests have its words"),
    ("new wind-vane", "see `new.rs`"),
    ("time", "needs several nodes"),
    ("team", "needs several systems; see `team.rs`"),
    ("path", "needs a map; see `grid.rs`"),
    ("entrances", "the same"),
];

/// The commands that a page shows, each with the lines that it prints there.
pub(crate) fn shown(page: &str) -> Vec<(String, Vec<String>)> {
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(page)).unwrap();
    let blocks = text.split("\n```text\n").skip(1).map(|rest| rest.split("\n```").next().unwrap());
    let mut all: Vec<(String, Vec<String>)> = Vec::new();
    for block in blocks.filter(|block| block.starts_with("$ ")) {
        for line in block.lines() {
            match line.strip_prefix("$ rohrpost ") {
                Some(command) => all.push((command.to_owned(), Vec::new())),
                None => all.last_mut().unwrap().1.push(line.to_owned()),
            }
        }
    }
    for (_, lines) in &mut all {
        lines.truncate(lines.iter().rposition(|line| !line.is_empty()).map_or(0, |last| last + 1));
    }
    all
}

/// A screen of `top`, as its own tests have it.
const SCREEN: &str = include_str!("../../cli/src/running/top/golden/table-80x24.txt");

/// Units that a number takes, depending on how large it is.
const UNITS: [&str; 13] = ["ns", "µs", "ms", "s", "min", "h", "B", "kB", "MB", "KiB", "MiB", "B/s", "kB/s"];

/// What may stand behind a unit.
const BEHIND: [char; 3] = [',', ';', ')'];

/// A line without what differs from run to run: `nice 10` becomes a word, `1.2 ms` and `-` become `#`.
fn masked(line: &str) -> String {
    let mut words: Vec<String> = Vec::new();
    for word in line.split_whitespace() {
        let last = words.last_mut();
        match last {
            Some(last) if last.ends_with('#') && UNITS.contains(&word.trim_end_matches(BEHIND)) => {
                last.extend(word.matches(BEHIND));
            }
            Some(last) if *last == "fifo" || *last == "nice" => *last = "sched".into(),
            _ if word == "-" => words.push("#".into()),
            _ if word.chars().all(|c| c == '█') => words.push("█".into()),
            _ => words.push(without_numbers(word)),
        }
    }
    words.join(" ")
}

/// Each number of a word as `#`, with its sign, its fraction and its unit.
fn without_numbers(word: &str) -> String {
    let mut text = String::new();
    let mut chars = word.chars().peekable();
    while let Some(c) = chars.next() {
        let is_sign = c == '-' && chars.peek().is_some_and(char::is_ascii_digit) && !text.ends_with('#');
        if !c.is_ascii_digit() && !is_sign {
            text.push(c);
            continue;
        }
        while chars.next_if(|next| next.is_ascii_digit() || matches!(next, '.' | ':')).is_some() {}
        text.push('#');
    }
    let unit = UNITS.iter().find(|unit| text.strip_suffix(**unit).is_some_and(|number| number.ends_with('#')));
    unit.map_or(text.clone(), |unit| text[..text.len() - unit.len()].to_owned())
}

/// Whether a line is that of the book, where `<…>` stands for one or more characters, and `…` at the end for the rest.
fn is_line(wanted: &str, line: &str) -> bool {
    match wanted.split_once("<…>") {
        Some((front, behind)) => line.strip_prefix(front).is_some_and(|rest| {
            rest.char_indices().any(|(at, varies)| is_line(behind, &rest[at + varies.len_utf8()..]))
        }),
        None => match wanted.strip_suffix('…') {
            Some(front) => line.starts_with(front.trim_end()),
            None => wanted == line,
        },
    }
}

/// Whether these lines are those of the book, where `…` stands for any.
pub(crate) fn fits(wanted: &[String], lines: &[String]) -> bool {
    match wanted {
        [] => lines.is_empty(),
        [any, rest @ ..] if any == "…" => (0..=lines.len()).any(|from| fits(rest, &lines[from..])),
        [first, rest @ ..] => lines.first().is_some_and(|line| is_line(first, line)) && fits(rest, &lines[1..]),
    }
}

/// What a command prints here, masked: its output and its errors, in both orders.
fn printed(place: &Place, command: &str) -> [Vec<String>; 2] {
    let said = place.say(&command.split(' ').collect::<Vec<_>>());
    [said.out.clone() + &said.err, said.err + &said.out].map(|all| {
        let all = all.replace(place.path("").to_str().unwrap(), "/home/robot/");
        let all = all.replace(place.memory().to_str().unwrap(), "/dev/shm/rohrpost-0");
        all.trim_end().lines().map(masked).collect()
    })
}

/// What a page shows and a command does not print; asked more than once, as a robot that has just started has not all
/// figures yet.
pub(crate) fn difference(place: &Place, command: &str, shown: &[String], how: Compared) -> Option<String> {
    let count = if how == Header { 1 } else { shown.len() };
    let wanted: Vec<String> = shown[..count].iter().map(|line| masked(line)).collect();
    let mut last = Vec::new();
    let is_so = (0..5).any(|_| {
        let all = printed(place, command);
        let fits = |all: &Vec<String>| fits(&wanted, &all[..if how == Header { all.len().min(1) } else { all.len() }]);
        let is_so = all.iter().any(fits);
        [last, _] = all;
        is_so
    });
    let (wanted, last) = (wanted.join("\n"), last.join("\n"));
    (!is_so).then(|| format!("`rohrpost {command}` is shown as\n{wanted}\n\nand prints\n{last}"))
}

#[test]
fn what_the_page_of_tools_shows_is_what_they_print() {
    const PAGE: &str = "docs/src/tools.md";
    let shown = shown(PAGE);
    for (command, _) in &shown {
        let is_run = TOOLS.iter().any(|(run, _)| run == command);
        let is_known = NOT_RUN.iter().any(|(begins, _)| command.starts_with(begins));
        assert!(is_run || is_known, "{PAGE} shows `rohrpost {command}`; compare it here, or say why it is not");
    }
    let place = Place::new();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config");
    fs::create_dir(place.path("config")).unwrap();
    fs::copy(folder.join("building.map"), place.path("config/building.map")).unwrap();
    let text = fs::read_to_string(folder.join("demo.toml")).unwrap();
    place.write("config/demo.toml", &text);
    // The same with a file for parameters, whether this user may have real time, and the bridge was built, or not.
    let saves = place.path("config/saves.toml");
    let text = text.replace("rohrpost-gui-bridge\"", "not-there\"");
    let text = text.replace("[nodes.main]", "[scheduling]\nreal-time-from = 256\n\n[nodes.main]");
    fs::write(&saves, format!("parameters = \"tuned.toml\"\n{text}")).unwrap();
    let mut launch = place.launch(&saves);
    let robot = place.robot(&saves, "main", &mut launch);
    until("all are on", || robot.state("pilot.0") == "on");
    until("the log has all", || place.say(&["log"]).out.contains("pilot.0: is on"));
    let (_, screen) = shown.iter().find(|(command, _)| command == "top").unwrap();
    for line in screen.iter().filter(|line| line.starts_with(['─', '?']) || line.contains(" module ")) {
        assert!(SCREEN.contains(line), "{PAGE} shows of `top` a line that it does not have: {line}");
    }
    let mut differences = Vec::new();
    for (command, how) in TOOLS {
        let found = shown.iter().find(|(text, _)| text == command);
        let (_, lines) = found.unwrap_or_else(|| panic!("{PAGE} shows `rohrpost {command}` no more; drop it here"));
        differences.extend(difference(&place, command, lines, how));
    }
    assert!(differences.is_empty(), "{PAGE} is to be corrected:\n\n{}", differences.join("\n\n\n"));
}

#[test]
fn what_differs_from_run_to_run_is_masked_and_nothing_else() {
    for (line, expected) in [
        ("  pilot  140   811  none       41 µs  3.65 ms  7.28 ms", "pilot # # none # # #"),
        ("output.0  on  32  nice 10  14726  0 (most 1)", "output.# on # sched # # (most #)"),
        ("{x_m: -0.5, y: [1.25, -3], n: NaN}", "{x_m: #, y: [#, #], n: NaN}"),
        ("1.laser.0.0  commands  tool  0  -  49 µs", "#laser.# commands tool # # #"),
        ("32 x 1 KiB   = 34 KiB    full", "# x # = # full"),
        ("at most 5 times in 60 s; stays", "at most # times in #; stays"),
    ] {
        assert_eq!(masked(line), expected, "{line}");
    }
    let lines = |all: &[&str]| all.iter().map(|line| (*line).to_owned()).collect::<Vec<_>>();
    for (wanted, printed, is_so) in [
        (&["a", "…", "d"][..], &["a", "b", "c", "d"][..], true),
        (&["a", "…"], &["a"], true),
        (&["a", "d"], &["a", "b", "d"], false),
        (&["a b…"], &["a b c"], true),
        (&["a"], &["a", "b"], false),
        (&["<…> a, <…> b"], &["12 a, 3 b"], true),
        (&["<…> a, <…> b"], &["12 a,  b"], false),
        (&["<…> s"], &["12 s, 3 ms"], false),
    ] {
        assert_eq!(fits(&lines(wanted), &lines(printed)), is_so, "{wanted:?} {printed:?}");
    }
}
