//! `ping` and `send`: commands over and over, and what came of each.

use crate::harness::{PATIENCE, Place, halt, json_lines, probe, signal, until};
use nix::sys::signal::Signal;

#[test]
fn ping_counts_answers_and_ends_at_its_deadline() {
    let (place, _launch, robot) = Place::running(&[&probe("probe.0", "", "")]);
    let text = place.say(&["ping", "probe.0", "-c", "5", "--interval", "0"]).ok();
    assert!(text.contains("probe.0: answer 5 after "), "{text}");
    assert!(text.contains("probe.0: 5 sent, 5 answered, 0 lost\nround min "), "{text}");
    assert!(text.contains(" (there ") && text.contains("\nthere min ") && text.contains("\nback  min "), "{text}");
    let said = place.say(&["ping", "probe.0", "-c", "3", "--interval", "0", "--json"]).ok();
    let said = json_lines(&said);
    assert_eq!((said.len(), &said[3]["answered"], &said[3]["lost"]), (4, &3.into(), &0.into()));
    let figures = ["min_s", "p50_s", "p99_s", "max_s"].map(|figure| said[3][figure].as_f64().unwrap());
    assert!(figures.is_sorted() && figures[0] > 0.0, "{figures:?}");
    let ways = ["there_s", "back_s"].map(|way| said[0][way].as_f64().unwrap());
    assert!(ways.iter().all(|way| *way > 0.0) && said[0]["ways_error_s"] == 0.0, "{}", said[0]);
    let round_s = said[0]["round_trip_s"].as_f64().unwrap();
    assert!((ways[0] + ways[1] - round_s).abs() < 0.02 + round_s, "both ways are the round: {}", said[0]);
    assert_eq!((&said[3]["there"]["known"], &said[3]["back"]["known"]), (&3.into(), &3.into()));

    let pid = robot.pid("probe.0");
    halt(pid);
    let started = std::time::Instant::now();
    let said = place.say(&["ping", "probe.0", "-c", "2", "--interval", "0", "--timeout", "0.2"]);
    assert!(started.elapsed() < PATIENCE / 2, "{:?}", started.elapsed());
    assert!(said.out.contains("probe.0: none 2: no answer within 200ms"), "{said:#?}");
    assert!(said.out.contains("probe.0: 2 sent, 0 answered, 2 lost"), "{said:#?}");
    let error = said.fails();
    let why = format!("probe.0 answered nothing: its process {pid} is there, its state is on, and ");
    assert!(error.starts_with(&why) && error.contains(&format!("kill -CONT {pid} goes on")), "{error}");
    signal(pid, Signal::SIGCONT);
    place.say(&["ping", "probe.0", "-c", "1"]).ok();
    let said = place.say(&["ping", "probe.3", "-c", "1"]);
    said.fails_with(["the configuration has no module `probe.3`; there are probe.0"]);
}

#[test]
fn send_repeats_a_command_and_counts_what_came_of_it() {
    let (place, _launch, _robot) = Place::running(&[&probe("probe.0", "", "")]);
    let counts = place.say(&["send", "probe.0", "count", "7", "--rate", "10", "--count", "12", "--json"]).json();
    assert_eq!((&counts["sent"], &counts["answered"], &counts["timeouts"]), (&12.into(), &12.into(), &0.into()));
    assert_eq!(place.counted(), [7; 12]);
    let said = place.say(&["send", "probe.0", "refuse", "no", "--rate", "100", "--count", "3"]);
    // What a busy computer keeps from being sent in time is left out, and counted too.
    assert!(said.out.starts_with("3 sent, 0 answered, ") && said.out.ends_with("3 refused\n"), "{said:#?}");
    assert_eq!(said.code, Some(1), "{said:#?}");
    assert_eq!(said.err.matches("refuse: ").count(), 1, "told once: {said:#?}");
    place.say(&["call", "probe.0", "off"]).ok();
    let said = place.say(&["send", "probe.0", "count", "8", "--rate", "100", "--count", "3"]);
    assert!(said.out.starts_with("3 sent, 0 answered, ") && said.out.ends_with("3 faults\n"), "{said:#?}");
    assert_eq!(said.code, Some(1), "{said:#?}");
    assert_eq!(said.err, "probe.0: the module is off; switch it on first\n");
    place.say(&["call", "probe.0", "on"]).ok();
    let mut send = place.start(&["send", "probe.0", "count", "9", "--rate", "200"]);
    until("it goes on until it is stopped", || place.counted().iter().filter(|n| **n == 9).count() > 50);
    // A probe that stands still for 40 ms has eight calls under way, and is sent no further one.
    send.signal(Signal::SIGINT);
    send.end();
    let (told, complaints) = (send.out(), send.err());
    assert!(complaints.lines().all(|line| line.contains("too many calls to probe.0 are under way")), "{complaints}");
    let nines = place.counted().iter().filter(|n| **n == 9).count();
    assert!(told.starts_with(&format!("{nines} sent, {nines} answered")), "{told}");
    for (arguments, error) in [
        (&["send", "probe.0", "cound", "7"][..], "no function `cound`; it has: "),
        (&["send", "probe.0", "count"], "count <number: u32> takes 1 arguments, not 0"),
        (
            &["send", "probe.0", "count", "7", "--timeout", "1e19"],
            "10000000000000000000 s is no time to wait; write 0 to",
        ),
    ] {
        let said = place.say(arguments).fails();
        assert!(said.starts_with(error), "{said}");
    }
}
