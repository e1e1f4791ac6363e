//! What people type: numbers below zero, texts that begin as JSON does, a class for its one module.

use crate::harness::{NoSettings, OUTPUT, Place, probe, program, run_if_launched, until, wait};
use crate::probe::{ProbingInterface, ProbingProxy, WORK};
use crate::tuned::{shown, tuned};
use rohrpost::{Context, Module, ModuleError, Rate, Received, Subscription};
use std::time::Duration;

#[test]
fn numbers_below_zero_and_texts_that_begin_as_json_are_values() {
    let (place, _launch, _robot) = Place::running(&[&probe("probe.0", "", ""), &tuned("probe.1", "", "")]);
    for (number, ratio, word, told) in [
        ("-3", "-1e-3", "[x", "-3 -0.001 [x"),
        ("-1e3", "-.5", "{x}", "-1000 -0.5 {x}"),
        ("-0x1f", "-inf", "[1, 2]", "-31 -inf [1, 2]"),
        ("1", "-5.", "\"x", "1 -5 \\\"x"),
        ("-7", "-1", "-2", "-7 -1 -2"),
    ] {
        let words = ["probe.0", "tell", number, ratio, word, "true", "[1,2]"];
        let expected = format!("\"{told} true [1, 2]\"\n");
        // An option has its meaning before, in between and behind.
        for at in [0, 1, 3, words.len()] {
            let (before, behind) = words.split_at(at);
            assert_eq!(place.say(&[&["call"], before, &["--json"], behind].concat()).ok(), expected, "{words:?}");
        }
        let sent = place.say(&[&["send", "--rate", "100"], &words[..], &["-c", "2", "--json"]].concat()).json();
        assert_eq!((&sent["answered"], &sent["faults"]), (&2.into(), &0.into()), "{words:?}");
    }
    for (parameter, value, told) in [
        ("gain", "-1e-3", "probe.1 gain: 1 -> -0.001\n"),
        ("gain", "-.5", "probe.1 gain: -0.001 -> -0.5\n"),
        ("label", "[x", "probe.1 label: \"a \\\"word\\\"\" -> \"[x\"\n"),
        ("label", "{\"x\": 1}", "probe.1 label: \"[x\" -> \"{\\\"x\\\": 1}\"\n"),
    ] {
        assert_eq!(place.say(&["param", "set", "probe.1", parameter, value]).ok(), told);
    }
    place.say(&["param", "set", "probe.1", "gain", "-inf"]).fails_with(["`gain` is -inf, out of range"]);
    let told = place.say(&["call", "probe.0", "tell", "1", "1", "x", "true", "[1"]).fails();
    assert!(told.starts_with("list: EOF while parsing a list"), "{told}");
    let said = place.say(&["call", "probe.0", "tell", "-x"]);
    assert_eq!(said.code, Some(2), "what is no number is an option: {said:?}");
}

#[test]
fn a_command_of_ros_2_is_answered_by_ours() {
    let place = Place::new();
    for (words, ours) in [
        (&["topic", "list"][..], "here it is: rohrpost data"),
        (&["topic", "echo", "/scan", "--once"], "here it is: rohrpost echo MODULE [DATA]"),
        (&["service", "call", "/drive"], "here it is: rohrpost call MODULE FUNCTION"),
        (&["bag"], "\n  bag record rohrpost record on\n"),
    ] {
        let said = place.say(words);
        assert!(said.code == Some(2) && said.err.contains(ours) && said.out.is_empty(), "{said:?}");
    }
}

#[test]
fn a_class_is_its_one_module_in_all_tools_and_of_several_all_are_named() {
    let (place, launch, _robot) = Place::running(&[OUTPUT, &tuned("probe.0", "", "")]);
    wait("its data are described", || place.say(&["hz", "probe", "--window", "0.2", "--count", "1"]).code);
    for (words, told) in [
        (&["call", "probe"][..], "class probe: "),
        (&["status", "probe"], "\nprobe.0  on "),
        (&["ping", "probe", "-c", "1"], "probe.0: answer 1 after "),
        (&["echo", "probe", "gain", "--count", "1"], " 1\n"),
        (&["mailbox", "output"], "output.0"),
        (&["param", "get", "probe", "gain", "--json"], "\"module\":\"probe.0\""),
        (&["param", "set", "probe", "gain", "2"], "probe.0 gain: 1 -> 2\n"),
        (&["param", "list", "probe", "--json"], "\"module\":\"probe.0\""),
        (&["log", "--module", "probe"], "probe.0: gain: 1 -> 2"),
        (&["interface", "export", "probe"], "class probe: "),
        (&["restart", "probe"], "probe.0 runs and is on after "),
    ] {
        until(format!("{words:?} tells {told:?}"), || place.say(words).out.contains(told));
    }
    drop(launch);
    let (place, _launch, robot) = Place::running(&[OUTPUT, &tuned("probe.0", "", ""), &tuned("probe.1", "", "")]);
    for words in [
        &["call", "probe"][..],
        &["status", "probe"],
        &["mailbox", "probe"],
        &["param", "get", "probe"],
        &["stop", "probe"],
        &["stream", "info", "probe", "1"],
        &["delay", "probe"],
        &["log", "--module", "probe"],
    ] {
        assert_eq!(place.say(words).fails(), "`probe` may be probe.0 or probe.1; say which\n", "{words:?}");
    }
    place.say(&["call", "prob"]).fails_with(["`prob` is no mailbox name; write class.instance"]);
    assert_eq!(shown(place.say(&["param", "get", "probe.1"]), "gain"), "1");
    assert_eq!(robot.state("probe.0"), "on");
}

#[test]
fn of_a_module_that_does_not_answer_all_tools_tell_what_list_knows() {
    let (place, _launch, robot) = Place::running(&[&probe("probe.0", "", "busy-after = \"100 ms\"")]);
    let mut tool = robot.tool(Duration::from_secs(60));
    robot.begin(&mut tool, "probe.0", WORK, &(600_000_u64,));
    until("it is busy", || place.say(&["list"]).ok().contains("busy"));
    for words in [
        &["call", "probe.0", "count", "1", "--timeout", "0.3"][..],
        &["call", "probe.0", "status", "--timeout", "0.3"],
        &["param", "get", "probe.0", "--timeout", "0.3"],
        &["send", "probe.0", "count", "1", "--count", "1", "--timeout", "0.3"],
    ] {
        let said = place.say(words);
        let told = "no answer from probe.0 within 300ms; it is busy: in `work` for ";
        assert!(said.err.contains(told), "{words:?}: {said:?}");
    }
    let said = place.say(&["ping", "probe.0", "-c", "1", "--timeout", "0.3"]);
    assert!(said.err.starts_with("probe.0 answered nothing: it is busy: in `work` for "), "{said:?}");
    tool.close();
}

#[test]
fn a_more_important_module_may_subscribe_and_is_warned_if_it_calls() {
    let place = Place::new();
    let seer = program("arguments::module");
    let config = place.config(&[
        OUTPUT,
        &format!(
            "[classes.hearer]\nid = 120\n[[module]]\nname = \"hearer.0\"\nprogram = {seer}\n\
             calls = [{{ to = \"probe.0\", subscribes = true }}]\n"
        ),
        &probe("probe.0", "rate-hz = 50", ""),
    ]);
    place.say(&["check", config.to_str().unwrap()]).ok_with(["subscribes    probe.0\n"]);
    let (_launch, _robot) = place.launched_from(&config);
    wait("it hears", || place.say(&["call", "hearer.0", "heard"]).ok().trim().parse::<u64>().unwrap().checked_sub(1));
    let log = || place.say(&["log", "--module", "hearer.0"]).out;
    assert!(!log().contains("it calls"), "{}", log());
    place.say(&["call", "hearer.0", "call"]).ok();
    until("it is warned", || log().contains("it calls probe.0, and its `calls` says that it only"));
}

/// Hears a less important one.
#[rohrpost::interface(class = "hearer")]
trait Hearing {
    /// How much came.
    #[command(16)]
    fn heard(&mut self) -> u64;
    /// Makes a proxy.
    #[command(17)]
    fn call(&mut self);
}

struct Hearer {
    beats: Subscription<u64>,
    heard: u64,
    wants_proxy: bool,
}

impl Hearing for Hearer {
    fn heard(&mut self) -> u64 {
        self.heard
    }

    fn call(&mut self) {
        self.wants_proxy = true;
    }
}

impl Module for Hearer {
    type Settings = NoSettings;
    type Interfaces = HearingInterface;

    fn new(_: NoSettings, context: &mut Context) -> Result<Self, ModuleError> {
        context.set_period(Duration::from_millis(5));
        let beats = context.subscribe(ProbingInterface::BEAT, "probe.0", Rate::Each)?;
        Ok(Self { beats, heard: 0, wants_proxy: false })
    }

    fn received(&mut self, _: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        self.heard += u64::from(data.read(&self.beats)?.is_some());
        Ok(())
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        if std::mem::take(&mut self.wants_proxy) {
            context.proxy::<ProbingProxy>("probe.0")?;
        }
        Ok(())
    }
}

/// Not a test: what launch starts. Run as a test it ends at once.
#[test]
fn module() {
    run_if_launched::<Hearer>();
}
