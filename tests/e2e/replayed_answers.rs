//! Commands to modules that are played: they get the answers that the modules' journals have, or a fault that says why
//! not.

use crate::exact::count;
use crate::harness::{Place, RECORDED_CLASSES, until, wait};
use crate::replayed::{call, position, replay};
use rohrpost_recording::info;

const MODULES: &str = r#"
[time]
source = "simulation"
speed = 4.0
[[module]]
name = "logd.0"
builtin = "logd"
stop-within = "60 s"
[[module]]
name = "motor.0"
aliases = ["odometry.0", "laser.0"]
builtin = "sim"
settings = { map = "building.map", seed = 1 }
[module.stream.odometry]
record = "128 B"
keep = 1024
[[module]]
name = "mapper.0"
builtin = "mapper"
calls = ["laser.0", "odometry.0"]
settings = { laser = "laser.0", odometry = "odometry.0" }
[record]
directory = "recordings"
streams = ["odometry.0/*"]
exact = ["motor.0", "mapper.0"]
leave-free = "0 B"
flush = "20 ms"
"#;

#[test]
fn a_command_to_a_played_module_gets_the_answer_that_was_recorded_for_it() {
    let place = Place::new();
    place.copy("config/building.map");
    let file = place.path("recordings/main-0001.mcap");
    let (mut launch, _robot) = place.launched(&[&RECORDED_CLASSES, MODULES]);
    let journaled = || ["motor.0", "mapper.0"].map(|module| count(&file, module, |_| true));
    until("journals are recorded", || journaled().iter().all(|count| *count > 0));
    let drive = ["call", "motor.0", "drive", "0.25", "0.125"];
    let driven = place.say(&drive).ok();
    let early = call(&place, "mapper.0", &["counts"]);
    until("it maps on", || call(&place, "mapper.0", &["counts"])["mapped"] != early["mapped"]);
    let before = journaled();
    until("the journals go on", || {
        let now = journaled();
        now[0] > before[0] + 2 && now[1] > before[1] + 2
    });
    let late = call(&place, "mapper.0", &["counts"]);
    let before = journaled();
    until("the journals go on", || {
        let now = journaled();
        now[0] > before[0] + 2 && now[1] > before[1] + 2
    });
    launch.stop();
    assert_eq!(info(&file).unwrap().lost, 0);

    let mut replay = replay(&place, &file, &["--paused"]);
    let begun = wait("time begins", || {
        replay.assert_runs();
        let said = place.say(&["call", "replay.0", "position", "--json"]);
        (said.code == Some(0)).then(|| said.json()).filter(|position| position["time_ns"] != 0)
    });
    assert_eq!(place.say(&drive).ok(), driven);
    assert_eq!(call(&place, "mapper.0", &["counts"]), early, "that at the beginning");
    let near_end_s = begun["length_s"].as_f64().unwrap() - 0.3;
    place.say(&["call", "replay.0", "seek", &format!("{near_end_s:.6}")]).ok();
    until("it is near its end", || position(&place)["at_s"].as_f64() > Some(0.0));
    assert_eq!(call(&place, "mapper.0", &["counts"]), late, "that at the end");
    assert_eq!(place.say(&drive).ok(), driven, "it was given once");
    for (words, told) in [
        (&["call", "motor.0", "drive", "0.25", "0.5"][..], "motor.0 is played from a recording and has no answer: its"),
        (&["call", "motor.0", "halt"], "journal has no such command with these arguments"),
    ] {
        let refused = place.say(words);
        assert!(refused.code != Some(0) && refused.err.contains(told), "{refused:?}");
    }
    place.end(&mut replay);
}
