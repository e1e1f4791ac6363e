//! `rohrpost top`, used as a person uses it: keys, and what is on the screen then.

use crate::harness::{OUTPUT, PATIENCE, Place, Robot, halt, probe, signal, until};
use crate::process::Running;
use crate::terminal::Terminal;
use nix::sys::signal::Signal;
use rohrpost_launch::launcher::{AskLaunch, ChildState, Phase};
use std::process::Stdio;

/// Top refreshes often, so that tests need not wait.
const TOP: [&str; 3] = ["top", "--interval", "0.2"];

fn robot() -> (Place, Running, Robot) {
    let never = "restart = { policy = \"never\" }";
    Place::running(&[OUTPUT, &probe("probe.0", "rate-hz = 50.0", ""), &probe("probe.1", "", never)])
}

/// A robot, and `top` in a terminal of this size, which shows all its modules.
fn shown(rows: u16, columns: u16) -> (Place, Running, Robot, Terminal, Running) {
    let (place, launch, robot) = robot();
    let (terminal, top) = Terminal::start(&place, &TOP, rows, columns);
    for module in ["output.0", "probe.0", "probe.1"] {
        terminal.wait_row(module, &["on"]);
    }
    (place, launch, robot, terminal, top)
}

fn end(mut top: Running, terminal: &Terminal) {
    terminal.keys("q");
    assert!(top.end().success(), "{}", terminal.drawn());
    terminal.assert_restored();
    assert!(!terminal.drawn().contains("panicked"), "{}", terminal.drawn());
}

#[test]
fn modules_are_selected_switched_sorted_and_filtered_by_keys() {
    let (place, mut launch, robot, terminal, top) = shown(24, 80);
    terminal.wait_screen("the head", |screen| screen.starts_with("test.main") && screen.contains("3 modules: 3 on"));
    terminal.keys("j");
    terminal.wait_screen("the mark at probe.0", |screen| screen.contains("> probe.0"));
    terminal.keys("f");
    terminal.wait_row("probe.0", &["off"]);
    assert_eq!((robot.state("probe.0"), robot.state("probe.1")), ("off", "on"));
    terminal.wait_screen("what it came to", |screen| screen.contains("probe.0 is off"));
    terminal.keys("o");
    terminal.wait_row("probe.0", &["on"]);
    assert_eq!(robot.state("probe.0"), "on");
    let order = |screen: &str, modules: [&str; 3]| {
        let at = modules.map(|module| screen.find(&format!(" {module} ")));
        at.iter().all(Option::is_some) && at.is_sorted()
    };
    terminal.keys("s");
    terminal.wait_screen("sorted by name", |screen| {
        screen.contains("modulev") && order(screen, ["output.0", "probe.0", "probe.1"])
    });
    terminal.keys("S");
    terminal.wait_screen("the other way", |screen| {
        screen.contains("module^") && order(screen, ["probe.1", "probe.0", "output.0"])
    });
    terminal.keys("/be.1\r");
    terminal.wait_screen("one module", |screen| screen.contains("only `be.1`") && !screen.contains(" probe.0 "));
    terminal.keys("\x1b");
    terminal.wait_row("probe.0", &["on"]);
    terminal.keys("?");
    terminal.wait_screen("help", |screen| screen.contains("restart it, after y"));
    terminal.keys("\x1b");
    terminal.wait_row("probe.0", &["on"]);
    terminal.keys("p");
    terminal.wait_screen("a pause", |screen| screen.contains("PAUSED"));
    end(top, &terminal);
    place.end(&mut launch);
}

#[test]
fn all_keys_move_the_mark_and_a_pause_stands_still() {
    let (place, _launch, robot, terminal, top) = shown(24, 100);
    let (down, up, home, end_key) = ("\x1b[B", "\x1b[A", "\x1b[H", "\x1b[F");
    for (keys, marked) in [
        (down, "probe.0"),
        (down, "probe.1"),
        (up, "probe.0"),
        ("k", "output.0"),
        ("j", "probe.0"),
        (end_key, "probe.1"),
        (home, "output.0"),
        ("G", "probe.1"),
        ("g", "output.0"),
        // There is nothing beyond the ends.
        ("k", "output.0"),
        ("\x1b[F\x1b[B", "probe.1"),
    ] {
        terminal.keys(keys);
        terminal.wait_screen(&format!("the mark at {marked} after {keys:?}"), |screen| {
            screen.lines().any(|line| line.starts_with(&format!("> {marked} ")))
        });
    }
    terminal.keys("p");
    terminal.wait_screen("a pause", |screen| screen.contains("PAUSED"));
    let row = |screen: &str| screen.lines().find(|line| line.contains(" probe.0 ")).unwrap_or_default().to_owned();
    // What it draws next is read after all that it drew before.
    terminal.keys(home);
    terminal.wait_screen("the mark at the start", |screen| screen.contains("> output.0 "));
    let before = terminal.screen();
    // Something changes that a refresh would show.
    place.say(&["call", "probe.0", "off"]).ok();
    assert_eq!(robot.state("probe.0"), "off");
    // The mark still moves, so it has drawn since; all else is as it was.
    for keys in [home, end_key, home, end_key] {
        let drawn = terminal.drawn().len();
        terminal.keys(keys);
        until("it draws", || terminal.drawn().len() > drawn);
    }
    terminal.wait_screen("the mark at the end", |screen| screen.contains("> probe.1 "));
    let paused = terminal.screen();
    assert_eq!((row(&paused), paused.lines().next()), (row(&before), before.lines().next()));
    terminal.keys("p");
    terminal.wait_row("probe.0", &["off"]);
    terminal.wait_screen("that it goes on", |screen| !screen.contains("PAUSED"));
    end(top, &terminal);
}

#[test]
fn details_show_mailboxes_and_what_the_module_says_of_itself() {
    let (place, _launch, _robot, terminal, top) = shown(120, 100);
    place.say(&["call", "probe.0", "count", "1"]).ok();
    terminal.keys("j\r");
    for words in
        ["Does what tests ask of it", "probe.0 commands", "how long packages waited", "data beat: u64", "receives from"]
    {
        terminal.wait_screen(words, |screen| screen.contains(words));
    }
    terminal.keys("f");
    terminal.wait_screen("off, among the details", |screen| screen.contains("probe.0: off"));
    // On a small screen, the rest is found by scrolling.
    terminal.resize(&top, 12, 40);
    terminal.wait_screen("the beginning", |screen| screen.lines().count() <= 12 && screen.contains("probe.0: off"));
    for _ in 0..20 {
        terminal.keys("\x1b[6~");
    }
    terminal.wait_screen("the end", |screen| screen.contains("Never published"));
    terminal.keys("\x1b[D");
    terminal.wait_row("probe.0", &["off"]);
    end(top, &terminal);
}

#[test]
fn a_module_is_restarted_only_after_yes() {
    let (place, _launch, robot, terminal, top) = shown(24, 80);
    let pid = robot.pid("probe.0");
    terminal.keys("jr");
    terminal.wait_screen("the question", |screen| screen.contains("restart probe.0? y/n"));
    terminal.keys("n");
    terminal.wait_screen("the answer", |screen| screen.contains("not restarted"));
    assert_eq!(robot.pid("probe.0"), pid);
    terminal.keys("ry");
    robot.wait_restarted("probe.0", pid);
    terminal.wait_row("probe.0", &["on"]);
    assert_eq!(place.recorded("start"), 3, "two modules, and one again: {:?}", place.record());
    end(top, &terminal);
}

#[test]
fn a_death_is_seen_and_said() {
    let (_place, _launch, robot, terminal, top) = shown(24, 160);
    let pid = robot.pid("probe.0");
    signal(robot.pid("probe.1"), Signal::SIGKILL);
    terminal.wait_row("probe.1", &["failed"]);
    terminal.wait_screen("why", |screen| screen.contains("killed by signal 9"));
    terminal.wait_screen("it among all", |screen| screen.contains("1 failed, 2 on"));
    // This one comes again.
    signal(pid, Signal::SIGKILL);
    robot.wait_restarted("probe.0", pid);
    terminal.wait_row("probe.0", &["on", "1"]);
    end(top, &terminal);
}

#[test]
fn what_modules_say_is_followed_and_filtered() {
    let (place, _launch, _robot, terminal, top) = shown(24, 100);
    terminal.wait_screen("what was said before", |screen| screen.contains("probe.0: is on"));
    place.say(&["call", "probe.0", "say", "warn", "a line of zero"]).ok();
    place.say(&["call", "probe.1", "say", "info", "a line of one"]).ok();
    terminal.wait_screen("new lines", |screen| screen.contains("a line of zero") && screen.contains("a line of one"));
    terminal.keys("jl");
    terminal.wait_screen("one module's", |screen| {
        screen.contains("info and above, probe.0")
            && screen.contains("a line of zero")
            && !screen.contains("a line of one")
    });
    terminal.keys("lLLLL");
    terminal.wait_screen("warnings", |screen| {
        screen.contains("warn and above, all") && screen.contains("a line of zero") && !screen.contains("a line of one")
    });
    end(top, &terminal);
}

#[test]
fn a_module_that_hangs_does_not_freeze_the_screen() {
    let (_place, _launch, robot, terminal, top) = shown(24, 80);
    let pid = robot.pid("probe.0");
    halt(pid);
    terminal.keys("jf");
    terminal.wait_screen("that it is tried", |screen| screen.contains("switching probe.0 off"));
    // Meanwhile it is usable: the other one is switched.
    terminal.keys("jf");
    terminal.wait_row("probe.1", &["off"]);
    terminal.wait_screen("that it was in vain", |screen| screen.contains("probe.0: no answer within 1 s"));
    signal(pid, Signal::SIGCONT);
    end(top, &terminal);
}

#[test]
fn a_module_in_error_says_why() {
    let (place, _launch, robot) = Place::begun(&[&probe("probe.0", "refuse-on = true", "")]);
    until("it is in error", || robot.state("probe.0") == "error");
    let (terminal, top) = Terminal::start(&place, &TOP, 24, 160);
    terminal.wait_row("probe.0", &["error"]);
    terminal.wait_screen("why", |screen| screen.contains("a probe was asked not to work"));
    terminal
        .wait_screen("that nobody collects", |screen| screen.contains("no output: the configuration has no module"));
    end(top, &terminal);
    let json = place.say(&["top", "--json", "--interval", "0.1"]).json();
    assert!(json["modules"][0]["error"].as_str().unwrap().contains("a probe was asked not to work"), "{json}");
}

#[test]
fn any_size_will_do() {
    let (_place, _launch, _robot, terminal, top) = shown(24, 80);
    for (rows, columns) in [(12, 40), (1, 1), (2, 7), (100, 300), (24, 80)] {
        let before = terminal.drawn().len();
        terminal.resize(&top, rows, columns);
        until("it is drawn anew", || terminal.drawn().len() > before);
    }
    terminal.resize(&top, 12, 40);
    // The larger drawing is cut at first, and has this column.
    terminal.wait_screen("the small one, with the columns for which there is room", |screen| {
        screen.lines().all(|line| line.chars().count() <= 40)
            && screen.contains("> output.0")
            && screen.contains("in/s")
            && !screen.contains("sched")
    });
    end(top, &terminal);
}

#[test]
fn signals_and_control_c_give_the_terminal_back() {
    let (place, _launch, _robot) = robot();
    for how in [Some(Signal::SIGTERM), Some(Signal::SIGINT), Some(Signal::SIGHUP), None] {
        let (terminal, mut top) = Terminal::start(&place, &TOP, 24, 80);
        terminal.wait_row("probe.0", &["on"]);
        match how {
            Some(number) => top.signal(number),
            None => terminal.keys("\x03"),
        }
        assert!(top.end().success(), "{how:?}: {}", terminal.drawn());
        terminal.assert_restored();
    }
}

#[test]
fn a_terminal_that_is_closed_ends_it() {
    let (_place, _launch, _robot, terminal, mut top) = shown(24, 80);
    terminal.close();
    top.end();
}

#[test]
fn without_colours_the_words_are_the_same() {
    let (place, _launch, _robot) = robot();
    let coloured = |drawn: &str| drawn.contains("\x1b[38;5;2;");
    let (terminal, top) = Terminal::start(&place, &TOP, 24, 80);
    terminal.wait_row("probe.0", &["on"]);
    assert!(coloured(&terminal.drawn()), "{:?}", terminal.drawn());
    end(top, &terminal);
    let (terminal, top) = Terminal::start(&place, &[&TOP[..], &["--no-color"]].concat(), 24, 80);
    terminal.wait_row("probe.0", &["on"]);
    assert!(!coloured(&terminal.drawn()), "{:?}", terminal.drawn());
    end(top, &terminal);
}

#[test]
fn looking_sends_nothing_to_those_it_looks_at() {
    let (place, _launch, robot) = robot();
    let traffic = |module: &str| {
        let all = robot.node.mailboxes().unwrap().into_iter().filter(|name| name.module() == robot.name(module));
        let all = all.filter_map(|name| robot.node.look_at(name));
        all.map(|mailbox| mailbox.sent).sum::<u64>()
    };
    let before = ["probe.0", "probe.1"].map(traffic);
    let (terminal, top) = Terminal::start(&place, &TOP, 24, 80);
    terminal.wait_row("probe.0", &["on"]);
    let drawn = terminal.drawn().len();
    terminal.keys("j\r");
    terminal.wait_screen("the description", |screen| screen.contains("probe.0: on"));
    until("some looks later", || terminal.drawn().len() > drawn + 2000);
    end(top, &terminal);
    place.say(&["top", "--json", "--interval", "0.1"]).json();
    assert_eq!(["probe.0", "probe.1"].map(traffic), before);
}

#[test]
fn it_waits_for_a_node_to_be_launched_again() {
    let (place, mut launch, robot) = robot();
    let config = robot.installation.path.clone();
    let (terminal, top) = Terminal::start(&place, &TOP, 24, 80);
    terminal.wait_row("probe.0", &["on"]);
    // Stopped before all modules are on, launch reports a failed start.
    let mut tool = robot.tool(PATIENCE);
    let through = |children: Vec<ChildState>| children.iter().all(|child| child.phase == Phase::Running);
    until("launch is through with all", || through(tool.children(tool.launcher()).unwrap()));
    tool.close();
    launch.stop();
    terminal.wait_screen("that launch is gone", |screen| screen.contains("NOT LAUNCHED"));
    let (_launch, _robot) = place.launched_from(&config);
    terminal.wait_row("probe.0", &["on"]);
    terminal.wait_screen("launched", |screen| !screen.contains("NOT LAUNCHED"));
    terminal.keys("jf");
    terminal.wait_row("probe.0", &["off"]);
    end(top, &terminal);
}

#[test]
fn programs_get_one_object_and_pipes_one_table() {
    let (place, _launch, robot) = robot();
    let json = place.say(&["top", "--json", "--interval", "0.5"]).json();
    assert_eq!(
        (&json["installation"], &json["node"], &json["launched"]),
        (&"test".into(), &"main".into(), &true.into())
    );
    let row = json["modules"].as_array().unwrap().iter().find(|row| row["module"] == "probe.0").unwrap();
    assert_eq!((&row["state"], &row["pid"]), (&"on".into(), &robot.pid("probe.0").into()));
    assert!(row["memory_bytes"].as_u64().unwrap() > 1 << 16, "{row}");
    assert!(row["cpu_percent"].as_f64().is_some() && row["uptime_s"].as_f64().unwrap() > 0.0, "{row}");
    assert!(json["mailboxes"].as_array().unwrap().len() >= 9, "{json}");
    // The three tools use the same words.
    let list = place.say(&["list", "--json"]).json();
    let status = place.say(&["status", "--json"]).json();
    let states = |lines: &serde_json::Value| -> Vec<String> {
        lines.as_array().unwrap().iter().map(|line| line["state"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(states(&json["modules"]), ["on"; 3]);
    assert_eq!((states(&list["modules"]), states(&status)), (states(&json["modules"]), states(&json["modules"])));
    let table = place.say(&["top", "--once", "--interval", "0.1"]).ok();
    assert!(table.contains("probe.0") && table.contains("memory") && !table.contains('\x1b'), "{table}");
    let mut command = place.command(&["top"]);
    command.stdin(Stdio::null());
    Running::start(command).said().fails_with(["use `top --once` or `top --json`"]);
    for interval in ["0", "-1", "nan", "1e9"] {
        place.say(&["top", "--json", &format!("--interval={interval}")]).fails_with(["it takes 0.1 to 3600"]);
    }
}
