//! A computer that starts in 1970, as one without a battery does. Its clock is set while a node runs, and set back.

use crate::harness::{OUTPUT, Place, Robot, probe, until, wait};
use crate::network::{NETWORK, addresses, at, nodes};
use crate::process::{Running, Said};
use rohrpost_mailbox::{SystemClock, realtime_ns};
use std::ffi::OsString;
use std::fs::OpenOptions;
use std::io::{Seek, Write};
use std::path::PathBuf;
use std::process::Command;

const DAY_S: i64 = 86_400;

/// A wall clock that can be set, for the programs that are shown it.
pub(crate) struct WallClock {
    library: PathBuf,
    file: PathBuf,
}

impl WallClock {
    /// A clock that shows the right time.
    pub(crate) fn new(place: &Place) -> Self {
        let library = place.path("set_clock.so");
        let source = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/e2e/set_clock.c");
        let compiler = Command::new("cc")
            .args(["-shared", "-fPIC", "-O1", "-D_GNU_SOURCE", "-o"])
            .arg(&library)
            .arg(source)
            .output();
        let compiler = compiler.unwrap();
        assert!(compiler.status.success(), "{}", String::from_utf8_lossy(&compiler.stderr));
        let clock = Self { library, file: place.path("clock") };
        clock.set(0);
        clock
    }

    /// Sets it to so many seconds from the right time. Programs that run see the same file.
    pub(crate) fn set(&self, by_s: i64) {
        let mut file = OpenOptions::new().write(true).create(true).truncate(false).open(&self.file).unwrap();
        file.rewind().unwrap();
        file.write_all(&by_s.to_ne_bytes()).unwrap();
    }

    /// Environment of a program to which it is shown, and to those that this starts.
    pub(crate) fn environment(&self) -> [(&'static str, OsString); 2] {
        [("LD_PRELOAD", self.library.clone().into()), ("ROHRPOST_TEST_CLOCK", self.file.clone().into())]
    }
}

/// A computer with a clock that can be set.
struct Computer {
    place: Place,
    clock: WallClock,
}

impl Computer {
    /// A computer of which the clock shows this time, s since 1970.
    fn at(time_s: i64) -> Self {
        let place = Place::new();
        let computer = Self { clock: WallClock::new(&place), place };
        computer.set(time_s - now_s());
        computer
    }

    fn set(&self, by_s: i64) {
        self.clock.set(by_s);
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = self.place.command(arguments);
        command.envs(self.clock.environment());
        command
    }

    fn say(&self, arguments: &[&str]) -> Said {
        Running::start(self.command(arguments)).said()
    }

    /// Launches a node with a probe and the collector of output.
    fn launched(&self, time: &str) -> (Running, Robot) {
        let nodes = format!("[nodes.main]\n{time}");
        let config = self.place.config_of("test", &nodes, &[OUTPUT, &probe("probe.0", "", "")]);
        self.place.up(self.command(&["launch", "--quiet", config.to_str().unwrap()]), &config, "main")
    }
}

fn now_s() -> i64 {
    i64::try_from(realtime_ns() / 1_000_000_000).unwrap()
}

#[test]
fn a_node_that_began_in_1970_says_so_when_the_clock_is_set_and_goes_on_when_it_is_told_to() {
    let computer = Computer::at(60);
    let (mut launch, robot) = computer.launched("");
    let clock = SystemClock::open(&robot.node);
    assert!(clock.now().ns < 3_600_000_000_000 && clock.now().epoch == 1, "{:?}", clock.now());
    let quiet = computer.say(&["time"]).ok();
    assert!(quiet.contains("own") && !quiet.contains("days"), "{quiet}");
    computer.set(0);
    let ahead = " days ahead of system time";
    until("launch says so", || launch.out().contains(ahead));
    until("the log says so", || computer.say(&["log"]).out.contains(ahead));
    for arguments in [&["time"][..], &["top", "--once"], &["doctor"]] {
        let said = computer.say(arguments).out;
        assert!(said.contains(ahead), "{arguments:?}: {said}");
    }
    computer.say(&["time", "--json"]).ok_with(["\"clock_set_by_ns\":"]);
    assert_eq!(clock.now().epoch, 1, "nothing changes unasked");
    computer.say(&["time", "--new-epoch"]).ok_with(["epoch 2 of time: 20"]);
    let now = clock.now();
    assert!(now.epoch == 2 && now.ns.abs_diff(realtime_ns()) < 60_000_000_000, "{now:?}");
    for arguments in [&["time"][..], &["top", "--once"], &["doctor"]] {
        let said = computer.say(arguments).out;
        assert!(!said.contains(ahead), "{arguments:?}: {said}");
    }
    // Set back, as by a battery that is empty.
    computer.set(-400 * DAY_S);
    until("launch says that it is behind", || launch.out().contains("400 days behind system time"));
    launch.stop();
    computer.place.assert_empty();
}

#[test]
fn a_node_that_follows_its_clock_begins_an_epoch_when_that_is_set() {
    let computer = Computer::at(60);
    let (mut launch, robot) = computer.launched("[time]\nwhen-set = \"new-epoch\"\n");
    let clock = SystemClock::open(&robot.node);
    assert_eq!(clock.now().epoch, 1);
    computer.set(0);
    until("the epoch", || clock.now().epoch == 2);
    assert!(clock.now().ns.abs_diff(realtime_ns()) < 60_000_000_000, "{:?}", clock.now());
    launch.stop();
    computer.place.assert_empty();
}

/// Both nodes see the clock that is set; on whichever it is asked for, the master begins the epoch.
#[test]
fn nodes_follow_a_master_that_begins_an_epoch_when_it_is_asked_from_anywhere_or_by_itself() {
    for when_set in ["tell", "new-epoch"] {
        let computer = Computer::at(60);
        let [base, arm] = addresses();
        let nodes = nodes([("base", &base), ("arm", &arm)]) + NETWORK + &format!("when-set = \"{when_set}\"\n");
        let config = computer.place.config_of("test", &nodes, &[&at("arm", OUTPUT)]);
        let mut launches = ["base", "arm"].map(|node| {
            let file = config.to_str().unwrap();
            computer.place.up(computer.command(&["launch", "--quiet", file, "--node", node]), &config, node)
        });
        let clocks = [0, 1].map(|node: usize| SystemClock::open(&launches[node].1.node));
        let all_know = |in_1970: bool| {
            let knows = |clock: &SystemClock| {
                let is_known = clock.record().is_some_and(|record| record.is_known());
                is_known && (clock.now().ns < 3_600_000_000_000) == in_1970
            };
            clocks.iter().all(knows).then(|| clocks.each_ref().map(|clock| clock.now().epoch))
        };
        let before = wait("both have the time of the master", || all_know(true));
        computer.set(0);
        if when_set == "tell" {
            let ahead = || computer.say(&["time", "--config", config.to_str().unwrap()]).out.contains(" days ahead of");
            until("time says so", ahead);
            assert_eq!(all_know(true), Some(before), "nothing changes unasked");
            let words = ["time", "--config", config.to_str().unwrap(), "--node", "arm", "--new-epoch"];
            computer.say(&words).ok_with([" of time: 20"]);
        }
        let after = wait("both have the new time", || all_know(false));
        assert!(after[0] == after[1] && after[0] > before[0], "{before:?}, then {after:?}");
        launches.iter_mut().rev().for_each(|(launch, _)| drop(launch.stop()));
    }
}
