//! A user's commands at a running node, and the messages about mistakes.

use crate::harness::{OUTPUT, Place, assert_has, patient, probe, wait};
use crate::process::Running;
use std::process::{Command, Stdio};

/// All subcommands, as the command itself lists them.
pub(crate) fn commands(place: &Place) -> Vec<String> {
    let help = place.say(&["--help"]).ok();
    // In groups, each under a head; a name is indented by two, and its text may go on in lines that are indented
    // further.
    let listed = help.lines().take_while(|line| *line != "Options:").filter_map(|line| line.strip_prefix("  "));
    let named = listed.filter(|line| line.starts_with(|letter: char| letter.is_ascii_lowercase()));
    let all: Vec<String> = named.filter_map(|line| line.split(' ').next()).map(str::to_owned).collect();
    assert!(all.len() > 20 && all.contains(&"top".to_owned()), "{help}");
    all.into_iter().filter(|command| command != "help").collect()
}

/// Arguments that make a command look at a node with `probe.0`; none for commands that look at no running
/// node. A new command must be added here.
pub(crate) fn at_a_node(command: &str) -> Option<Vec<&str>> {
    let after: &[&str] = match command {
        "list" | "status" | "log" => &[],
        "top" => &["--once", "--interval", "0.1"],
        "graph" | "data" => &["--seconds", "0.1"],
        "call" | "mailbox" | "hz" | "bw" | "delay" | "ping" | "restart" | "stop" | "start" => &["probe.0"],
        "echo" => &["probe.0", "beat"],
        "send" => &["probe.0", "count", "1", "--count", "1"],
        "param" | "stream" => &["list"],
        "interface" => &["export", "probe.0"],
        "check" | "launch" | "demo" | "clean" | "doctor" | "bench" | "new" | "completions" | "version" | "run"
        | "keys" | "man" | "record" | "replay" | "path" | "entrances" | "arena" | "bundle" => {
            return None;
        }
        // Of a robot with a wormhole, see `supervised`.
        "halt" | "resume" => return None,
        // Of several nodes, see `lan`; of several systems, see `beyond`, `team` and `station`.
        "net" | "time" | "router" | "tcp-router" | "tcp-client" | "team-router" | "team" | "wormhole" | "station" => {
            return None;
        }
        other => panic!("`{other}` is new: say here how it is tested"),
    };
    Some([&[command], after].concat())
}

/// A node with a collector and a probe.
fn node() -> (Place, Running) {
    let (place, launch, _) = Place::running(&[OUTPUT, &probe("probe.0", "rate-hz = 50.0", "")]);
    (place, launch)
}

#[test]
fn each_command_has_a_manual_page() {
    let place = Place::new();
    let folder = place.path("deep/man1");
    place.say(&["man", folder.to_str().unwrap()]).ok();
    for command in commands(&place) {
        let page = std::fs::read_to_string(folder.join(format!("rohrpost-{command}.1"))).unwrap();
        assert!(page.contains("\n.SH SYNOPSIS\n") && page.contains("\n.SH OPTIONS\n"), "{command}: {page}");
    }
    place.say(&["man", "/proc/man1"]).fails_with(["/proc/man1: ", "name a folder that you may write"]);
}

#[test]
fn a_module_of_ones_own_is_known_by_its_description() {
    let (place, _launch) = node();
    let text = place.say(&["call", "probe.0"]).ok();
    assert_has(
        &text,
        [
            "class probe: Does what tests ask of it.",
            "count <number: u32> -> u64",
            "Writes the number into the record",
            "refuse <why: text> -> u32, or error {Refused: {why: text}}",
            "beat: u64",
            "every module: on, off, status, get DATA, output-level LEVEL",
        ],
    );
    let json = place.say(&["call", "probe.0", "--json"]).json();
    assert_eq!(json["class"], "probe");
    assert_eq!(json["functions"][0]["name"], "count");
}

#[test]
fn calls_take_arguments_as_people_type_them() {
    let (place, _launch) = node();
    for (arguments, answer) in [
        (&["count", "7"][..], "1"),
        (&["tell", "-3", "-0.5", "a word", "true", "[1, 2]"], "\"-3 -0.5 a word true [1, 2]\""),
        (&["tell", "3", "1e3", "\"{}\"", "false", "[]"], "\"3 1000 {} false []\""),
        (&["tell", "3", "2", "", "false", "[65535]"], "\"3 2  false [65535]\""),
        (&["say", "info", "grüß dich"], "ok"),
        (&["output-level", "debug"], "ok"),
        (&["count", "8", "--timeout", "60", "--json"], "2"),
    ] {
        assert_eq!(place.say(&[&["call", "probe.0"], arguments].concat()).ok(), format!("{answer}\n"));
    }
    let status = place.say(&["call", "probe.0", "--json", "status"]).json();
    assert_eq!(status["state"], "on");
    let beat = wait("a beat", || place.say(&["call", "probe.0", "get", "beat"]).ok().trim().parse::<u64>().ok());
    assert!(beat > 0);
    let refused = place.say(&["call", "probe.0", "refuse", "too late"]);
    assert_eq!((refused.code, refused.err.as_str()), (Some(1), ""), "{refused:?}");
    assert_eq!(refused.out, "probe.0 answers with an error: Refused({why: \"too late\"})\n");
    let refused = place.say(&["call", "--json", "probe.0", "refuse", "too late"]);
    let json: serde_json::Value = serde_json::from_str(&refused.out).unwrap();
    assert_eq!((refused.code, &json["Err"]["Refused"]["why"]), (Some(1), &"too late".into()));
    assert_eq!(place.counted(), [7, 8]);
}

#[test]
fn mistakes_are_told_with_what_would_be_right() {
    let (place, _launch) = node();
    for (arguments, words) in [
        (&["call", "prob.0"][..], &["prob"][..]),
        (&["call", "prob"], &["`prob` is no mailbox name; write class.instance"]),
        (&["call", "probe.x", "count", "1"], &["probe.x"]),
        (&["call", "probe.999", "count", "1"], &["999"]),
        (
            &["call", "probe.1", "count", "1"],
            &["the configuration has no module `probe.1`; there are output.0, probe.0"],
        ),
        (&["call", "probe.0", "cuont", "1"], &["no function `cuont`", "count, count_again", "on, off, status"]),
        (&["call", "probe.0", "count"], &["count <number: u32> takes 1 arguments, not 0"]),
        (&["call", "probe.0", "count", "1", "2"], &["takes 1 arguments, not 2"]),
        (&["call", "probe.0", "count", "-1"], &["number: "]),
        (&["call", "probe.0", "count", "4294967296"], &["number: "]),
        (&["call", "probe.0", "count", "x"], &["number: "]),
        (&["call", "probe.0", "tell", "1", "x", "w", "true", "[]"], &["ratio: "]),
        (&["call", "probe.0", "tell", "1", "1", "w", "maybe", "[]"], &["flag: "]),
        (&["call", "probe.0", "tell", "1", "1", "w", "true", "[1"], &["list: "]),
        (&["call", "probe.0", "tell", "1", "1", "w", "true", "[65536]"], &["list: "]),
        (&["call", "probe.0", "on", "x"], &["`on` takes nothing, not 1 arguments"]),
        (&["call", "probe.0", "get"], &["`get` takes the name of one kind of data, not 0 arguments"]),
        (&["call", "probe.0", "output-level", "a", "b"], &["`output-level` takes one level (error, warn", "not 2"]),
        (&["call", "probe.0", "get", "baet"], &["no data `baet`; it has: beat, silence"]),
        (&["call", "probe.0", "get", "silence"], &["no such data has been made yet"]),
        (&["call", "probe.0", "output-level", "loud"], &["no level `loud`; there are error, warn, info, debug, trace"]),
        (&["call", "--timeout=-1", "probe.0", "status"], &["-1 s is no time to wait"]),
        (&["echo", "probe.0"], &["which data? it has: beat, silence"]),
        (&["echo", "probe.0", "baet"], &["no data `baet`; it has: beat, silence"]),
        (&["echo", "probe.0", "silence", "--timeout", "0.2"], &["no data within 200ms"]),
        (&["echo", "probe.3", "beat"], &["no module `probe.3`"]),
        (&["status", "probe.3"], &["no module `probe.3`"]),
        (&["log", "--level", "loud"], &["no level `loud`"]),
        (&["log", "--module", "prob.0"], &["prob"]),
        (&["log", "--level", "warn", "--level", "probe.0=debug"], &["shows no lines", "add --follow"]),
        (&["log", "--module", "probe.0", "--level", "probe.0=debug"], &["shows no lines", "add --follow"]),
        (&["send", "probe.0", "off"], &["`rohrpost call probe.0 off`"]),
        (&["call", "--timeout", "1e19", "probe.0", "status"], &["s is no time to wait; write 0 to 31536000"]),
        (&["send", "--timeout", "1e19", "probe.0", "count", "1"], &["s is no time to wait"]),
        (&["ping", "--interval", "nan", "probe.0"], &["NaN s is no time to wait"]),
        (&["demo", "--seconds", "1e19", "--no-gui"], &["s is no time to wait"]),
        (&["hz", "probe.0", "--window=-5"], &["a window of -5 s is empty; try --window 1"]),
        (&["hz", "probe.0", "--window", "nan"], &["a window of NaN s is empty; try --window 1"]),
        (&["list", "--config", "nowhere.toml"], &["nowhere.toml"]),
    ] {
        let said = place.say(arguments);
        let told = said.fails();
        for words in words {
            assert!(told.contains(words), "{arguments:?}: no `{words}` in: {told}");
        }
    }
    assert!(place.counted().is_empty(), "something was called all the same");
    let config = place.path("test.toml");
    let twice = place.say(&["run", "output", "--config", config.to_str().unwrap(), "--name", "output.0"]);
    assert_eq!(twice.code, Some(1), "{twice:?}");
    assert!(twice.err.contains("output.0") && !twice.err.contains("1.32.0.0"), "named as the file does: {twice:?}");
}

#[test]
fn a_mistaken_command_line_is_usage() {
    let place = Place::new();
    for arguments in [
        &["cal"][..],
        &["call"],
        &["echo", "--rate", "fast", "x.0"],
        &["echo", "--rate=-1", "x.0"],
        &["echo", "-c", "0", "x.0"],
        &["hz", "-c", "0", "x.0"],
        &["ping", "-c", "0", "x.0"],
        &["send", "-c", "0", "x.0", "f"],
        &["send", "--rate", "0", "x.0", "f"],
        &["send", "--rate", "1e-19", "x.0", "f"],
        &["demo", "--no-gui", "--viewer"],
        &[],
    ] {
        let said = place.say(arguments);
        assert_eq!(said.code, Some(2), "{arguments:?}: {said:?}");
        assert!(said.err.contains("--help") || said.err.contains("Usage"), "{arguments:?}: {said:?}");
    }
    assert!(place.say(&["--help"]).ok().contains("rohrpost demo"));
    for command in commands(&place) {
        let help = place.say(&[&command, "--help"]).ok();
        assert!(help.contains("Example"), "{command} has no example:\n{help}");
    }
}

#[test]
fn tools_say_what_to_do_while_nothing_runs() {
    let place = Place::new();
    let commands = commands(&place);
    for arguments in commands.iter().filter_map(|command| at_a_node(command)) {
        place.say(&arguments).fails_with(["no node runs here; launch one: `rohrpost launch FILE`"]);
    }
    let config = place.config(&[OUTPUT]);
    place.say(&["list", "--config", config.to_str().unwrap()]).fails_with(["is it launched?"]);
    let said = place.say(&["run", "output"]);
    assert_eq!(said.code, Some(2), "{said:?}");
    assert!(said.err.contains("--config FILE --name CLASS.INSTANCE"), "{said:?}");
    let said = place.say(&["run", "mop", "--config", config.to_str().unwrap(), "--name", "output.0"]);
    assert_eq!(said.code, Some(2), "{said:?}");
    let builtins = "sim, carmen, mapper, pilot, mischief, wormhole, team, payload, station, arena, body, output";
    assert!(said.err.contains("'mop'") && said.err.contains(builtins), "{said:?}");
    let help = place.say(&["run", "--help"]).ok();
    let words: Vec<&str> = help.split_whitespace().collect();
    assert!(words.join(" ").contains(builtins), "{help}");
    place.assert_empty();
}

#[test]
fn many_tools_work_at_the_same_time() {
    let (place, mut launch) = node();
    let mut echo = place.start(&["echo", "probe.0", "beat", "--json"]);
    echo.wait_for("\n");
    let mut calls: Vec<Running> = (1..=8)
        .map(|number| place.start(&["call", "probe.0", "count", &number.to_string(), "--timeout", "30"]))
        .collect();
    let mut answers: Vec<u64> = Vec::new();
    for call in &mut calls {
        assert!(call.end().success(), "{}", call.err());
        answers.push(call.out().trim().parse().unwrap());
    }
    answers.sort_unstable();
    assert_eq!(answers, (1..=8).collect::<Vec<u64>>(), "each had an answer of its own");
    echo.stop();
    let out = launch.stop();
    assert_eq!(out, "node main of test runs: 2 modules\n", "every tool has tidied up after itself");
    place.assert_empty();
}

#[test]
fn a_tool_too_many_is_told_so() {
    let place = Place::new();
    let config = place.config_of("test", "[nodes.main]\ntools = [5, 6]\n", &[&probe("probe.0", "rate-hz = 50.0", "")]);
    let (mut launch, _robot) = place.launched_from(&config);
    // Launch is the first tool, and this the other.
    let mut echo = place.start(&["echo", "probe.0", "beat"]);
    echo.wait_for("\n");
    let said = place.say(&["call", "probe.0", "count", "1"]);
    said.fails_with(["no room for another tool on node `main`: programs run by hand have 1 instances"]);
    place.say(&["list"]).ok();
    echo.signal(nix::sys::signal::Signal::SIGKILL);
    echo.end();
    // The place of one that was killed is free again.
    assert_eq!(place.say(&["call", "probe.0", "count", "1"]).ok(), "1\n");
    place.end(&mut launch);
}

#[test]
fn without_a_collector_there_is_no_log() {
    let (place, _launch, _robot) = Place::running(&[&probe("probe.0", "", "")]);
    place.say(&["log"]).fails_with(["output.0 does not run, and the configuration has no such module"]);
}

#[test]
fn a_closed_pipe_ends_a_tool_quietly() {
    let (place, _launch) = node();
    let commands = commands(&place);
    let mut all: Vec<Vec<&str>> = commands.iter().filter_map(|command| at_a_node(command)).collect();
    all.extend([vec!["log", "--follow"], vec!["version"], vec!["completions", "bash"], vec!["clean"]]);
    for arguments in all {
        let mut command: Command = place.command(&patient(&arguments));
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        drop(child.stdout.take());
        if arguments[..] == ["log", "--follow"] {
            // It finds out when there is something to say.
            wait("the tool ends", || {
                place.say(&["call", "probe.0", "say", "info", "well"]).ok();
                child.try_wait().unwrap()
            });
        }
        let done = child.wait_with_output().unwrap();
        assert!(done.status.success(), "{arguments:?}: {done:?}");
        assert!(done.stderr.is_empty(), "{arguments:?}: {done:?}");
    }
}
