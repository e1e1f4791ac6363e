//! The demo, as its user sees it.

use crate::harness::{PATIENCE, Place, lacks_namespaces, probe, runs, until, wait};
use crate::process::Running;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use rohrpost_launch::launcher::{AskLaunch, Phase, launcher_of};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};

const LOG: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../modules/robot/tests/data/small.log");

/// The number in front of these words.
fn number(text: &str, words: &str) -> u64 {
    let before = text.split(words).next().filter(|before| before.len() < text.len());
    let before = before.unwrap_or_else(|| panic!("no `{words}` in:\n{text}"));
    before.rsplit(|c: char| !c.is_ascii_digit()).next().unwrap().parse().unwrap()
}

#[test]
fn the_simulated_robot_maps_and_says_what_came_of_it() {
    let place = Place::new();
    let mut demo = place.start(&["demo", "--no-gui", "--quiet"]);
    wait("it has mapped", || {
        demo.assert_runs();
        let said = place.say(&["call", "mapper.0", "counts", "--json"]);
        let counts: serde_json::Value = serde_json::from_str(&said.out).ok()?;
        let enough = |what: &str, least: u64| counts[what].as_u64() > Some(least);
        (enough("mapped", 5) && enough("free", 1000) && enough("occupied", 50)).then_some(())
    });
    let said = demo.stop();
    // Not the mapper: it reads streams.
    for class in ["pilot", "output", "tool"] {
        assert!(said.lines().any(|line| line.starts_with(class)), "no class {class}:\n{said}");
    }
    assert!(number(&said, " packages received, ") > 20, "{said}");
    assert_eq!(number(&said, " lost\n"), 0, "{said}");
    assert!(number(&said, " scans mapped (") > 5, "{said}");
    assert!(number(&said, " cells free") > 1000 && number(&said, " occupied") > 50, "{said}");
    place.assert_empty();
}

/// Over three nodes scans, odometry and pictures are read by replicas alone.
#[test]
fn over_three_nodes_streams_come_by_replicas_and_no_record_is_lost_without_a_cause() {
    let place = Place::new();
    let said = place.say(&["demo", "--nodes", "3", "--seconds", "6", "--no-gui", "--quiet", "-v"]);
    if lacks_namespaces(&said.err) {
        return;
    }
    assert_eq!(said.code, Some(0), "{said:?}");
    let said = said.out;
    assert!(said.contains("The demo went well.\n") && said.contains("lost without a cause: 0\n"), "{said}");
    let (sent, came) = (number(&said, "; came whole: "), number(&said, "; incomplete: "));
    assert!(sent > 100 && came > 100 && came <= sent, "{said}");
    let ways: Vec<&str> = said.lines().filter(|line| line.contains("  base → ") && line.contains("0/")).collect();
    assert_eq!(ways.len(), 5, "all of config/demo-nodes.toml: {said}");
    for way in ways {
        let columns: Vec<_> = way.split("  ").map(str::trim).filter(|column| !column.is_empty()).collect();
        let [stream, _, sent, came, _, not_sent, _] = columns[..] else { panic!("{way}") };
        assert!(sent.parse::<u64>().unwrap() > 5 && came.parse::<u64>().unwrap() > 5, "{way}");
        assert_eq!(not_sent.contains(" sampled"), stream == "camera.0/image", "two of ten a second go: {way}");
    }
    assert!(number(&said, " scans mapped (") > 5, "{said}");
    assert!(!said.lines().any(|line| line.starts_with("mapper ")), "it reads streams, on another node, too: {said}");
    place.assert_empty();
}

/// The same robot over three nodes, on a network that loses, delays and reorders.
#[test]
fn over_three_nodes_and_a_bad_network_it_still_maps_and_nothing_is_unaccounted_for() {
    let place = Place::new();
    let bad = "loss=5%,delay=2ms,jitter=1ms,reorder=5%,seed=7";
    let said = place.say(&["demo", "--nodes", "3", "--seconds", "6", "--no-gui", "--quiet", "-v", "--impair", bad]);
    if lacks_namespaces(&said.err) {
        return;
    }
    assert_eq!(said.code, Some(0), "{said:?}");
    let said = said.out;
    assert!(said.contains("The demo went well.\n") && said.contains("the accounts balance\n"), "{said}");
    assert!(number(&said, " scans mapped (") > 5, "{said}");
    assert!(number(&said, " cells free") > 1000 && number(&said, " occupied") > 50, "{said}");
    let link = said.lines().find(|line| line.starts_with("base → brain")).unwrap();
    assert!(number(link, " lost") > 0, "5 % of some hundred datagrams:\n{said}");
    place.assert_empty();
}

/// The same robot, each node in its own time slots.
#[test]
fn in_time_slots_it_maps_as_well_and_says_how_they_were_kept() {
    let place = Place::new();
    let said = place.say(&["demo", "--nodes", "3", "--tdma", "--seconds", "5", "--no-gui", "--quiet", "-v"]);
    if lacks_namespaces(&said.err) {
        return;
    }
    assert_eq!(said.code, Some(0), "{said:?}");
    let said = said.out;
    assert!(said.contains("the accounts balance\n") && number(&said, " scans mapped (") > 5, "{said}");
    let slots = said.split("In time slots").nth(1).unwrap();
    let used = slots.lines().find_map(|line| line.strip_prefix("used ")).unwrap_or_else(|| panic!("{said}"));
    let used: Vec<u64> = used.split_whitespace().map(|count| count.parse().unwrap()).collect();
    assert!(used.len() == 3 && used.iter().all(|used| *used > 10), "slots used: {used:?}");
    let flows = slots.split("\nflow ").nth(1).and_then(|rest| rest.split("\n\n").next()).unwrap();
    let rows: Vec<_> = flows.lines().filter(|line| line.contains(" → ")).collect();
    assert_eq!(rows.len(), 11, "all of config/demo-tdma.toml: {flows}");
    for row in rows {
        let columns: Vec<_> = row.split("  ").map(str::trim).filter(|column| !column.is_empty()).collect();
        let [flow, _, packages, bound, kept, worst, _, _, within, _, kept_over_bound, ..] = columns[..] else {
            panic!("{row}")
        };
        assert!(packages.parse::<u64>().unwrap() > 0 && worst.ends_with('s') && bound.ends_with("ms"), "{row}");
        assert_eq!(kept_over_bound, "0", "a flow with kept slots is in time: {kept} of at most {bound}:\n{flows}");
        let is_known = match flow {
            "laser.0 → pilot.0 scan" => within == "10.00 ms",
            "laser.0 → pilot.0 subscribe answered" => within == "900.00 ms",
            _ => !flow.starts_with("laser.0 → pilot.0"),
        };
        assert!(is_known, "{row}");
    }
    place.assert_empty();
    place.say(&["demo", "--nodes", "1", "--tdma", "--no-gui"]).fails_with(["use --nodes 3"]);
}

#[test]
fn it_ends_by_itself_after_the_time_that_was_given() {
    let place = Place::new();
    let config = place.config(&[&probe("probe.0", "", "")]);
    let said = place.say(&["demo", "--config", config.to_str().unwrap(), "--seconds", "2", "--quiet"]);
    assert!(said.out.contains(" packages received, "), "{said:?}");
    place.assert_empty();
}

#[test]
fn a_log_is_played_to_its_end_and_nothing_of_it_is_lost() {
    let place = Place::new();
    let said = place.say(&["demo", "--log", LOG, "--speed", "50", "--no-gui"]).ok();
    // Counted here again, in another way. Good lines end with the logger's own stamp, 20 s and more; the robot repeats
    // its odometry with stamps next to zero, and two lines are broken.
    let text = std::fs::read_to_string(LOG).unwrap();
    let of = |word: &str| text.lines().filter(|line| line.starts_with(word)).count() as u64;
    let discarded = text.lines().filter(|line| line.contains("e-62 ")).count() as u64;
    let broken = number(&said, " broken\n");
    let (scans, odometry) = (number(&said, " scans and "), number(&said, " odometry lines played"));
    assert_eq!(number(&said, " discarded for their stamps"), discarded);
    assert_eq!(scans + odometry, of("FLASER ") + of("ODOM ") - discarded - broken, "{said}");
    assert_eq!((scans, odometry, discarded, broken), (20, 100, 20, 2), "{said}");
    assert!(
        said.contains(&format!("map: {scans} scans and {odometry} odometry received, {scans} scans mapped")),
        "{said}"
    );
    assert_eq!(number(&said, " lost\n"), 0, "{said}");
    place.assert_empty();
}

#[test]
fn a_packed_log_plays_like_the_plain_one() {
    let place = Place::new();
    let said = place.say(&["demo", "--log", &format!("{LOG}.gz"), "--speed", "100", "--no-gui", "--quiet"]);
    said.ok_with(["log: 20 scans and 100 odometry lines played, 20 discarded"]);
}

#[test]
fn ctrl_c_ends_the_demo_with_its_summary() {
    for log in [false, true] {
        let place = Place::new();
        let arguments: &[&str] =
            if log { &["demo", "--no-gui", "--log", LOG, "--speed", "0.01"] } else { &["demo", "--no-gui"] };
        let mut demo = place.start(arguments);
        until("the demo is on", || {
            let list = place.say(&["list", "--json"]);
            let all_on =
                |list: serde_json::Value| list["modules"].as_array().unwrap().iter().all(|m| m["state"] == "on");
            list.code == Some(0) && all_on(list.json())
        });
        let list = place.say(&["list", "--json"]).json();
        let pids: Vec<u64> = list["modules"].as_array().unwrap().iter().filter_map(|m| m["pid"].as_u64()).collect();
        assert!(pids.len() >= 3, "{list}");
        // An earlier signal, before launch has all modules on, would be a failed start.
        let robot =
            place.robot_at(Path::new(if log { "../config/demo-log.toml" } else { "../config/demo.toml" }), "main");
        let launcher = launcher_of(&robot.installation, "main").unwrap();
        wait("launch has switched all on", || {
            let children = robot.tool(PATIENCE).children(launcher).ok()?;
            children.iter().all(|child| child.phase == Phase::Running).then_some(())
        });
        let said = demo.stop();
        assert!(said.contains(" packages received, ") && said.contains("map: "), "{said}");
        assert_eq!(said.contains("log: "), log, "{said}");
        assert!(!pids.iter().any(|pid| runs(*pid as u32)));
        place.assert_empty();
    }
}

#[test]
fn mistakes_are_told_before_anything_runs() {
    let place = Place::new();
    for (arguments, words) in [
        (&["demo", "--log", "nowhere.log"][..], "nowhere.log: "),
        (&["demo", "--config", "nowhere.toml"], "nowhere.toml: no such file"),
        (&["demo", "--log", LOG, "--speed", "0", "--no-gui"], "speed"),
        (&["demo", "--log", LOG, "--speed=-3", "--no-gui"], "speed"),
        (&["demo", "--seconds=-1", "--no-gui"], "-1 s is no time to wait"),
    ] {
        place.say(arguments).fails_with([words]);
        place.assert_empty();
    }
}

#[test]
fn the_configuration_of_the_present_folder_is_taken_if_there_is_one() {
    let place = Place::new();
    let config = place.config(&[&probe("probe.0", "", "")]);
    std::fs::create_dir(place.path("config")).unwrap();
    std::fs::rename(config, place.path("config/demo.toml")).unwrap();
    let mut demo = place.start(&["demo"]);
    wait("the probe runs", || place.say(&["call", "probe.0", "count", "1"]).code.filter(|code| *code == 0));
    demo.signal(Signal::SIGTERM);
    assert!(demo.end().success());
    place.assert_empty();
}

#[test]
fn a_demo_without_its_gui_names_the_file_that_people_know() {
    let place = Place::new();
    let absent = "[[module]]\nname = \"probe.1\"\nprogram = \"../absent\"\noptional = true\n";
    let config = place.config(&[&probe("probe.0", "", ""), absent]);
    let text = std::fs::read_to_string(&config).unwrap();
    let line = text.lines().position(|line| line == "name = \"probe.1\"").unwrap(); // of [[module]], counted from 1
    std::fs::create_dir(place.path("config")).unwrap();
    std::fs::rename(config, place.path("config/demo.toml")).unwrap();
    let said = place.say(&["demo", "--no-gui", "--seconds", "0.1", "--quiet"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    let note = format!("config/demo.toml:{line}: module `probe.1`: `");
    assert!(format!("{}{}", said.out, said.err).contains(&note), "{note}: {said:?}");
    place.assert_empty();
}

#[test]
fn a_log_that_is_none_is_told_and_fails() {
    let place = Place::new();
    let log = place.write("poem.txt", "Fest gemauert in der Erden\nsteht die Form, aus Lehm gebrannt.\n");
    let said = place.say(&["demo", "--log", log.to_str().unwrap(), "--no-gui", "--quiet"]);
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(said.out.contains("is it a CARMEN log?"), "{said:?}");
    place.assert_empty();
}

/// Folders of demos among these temporary files.
fn folders(temp: &Path) -> Vec<PathBuf> {
    let mut folders: Vec<PathBuf> = std::fs::read_dir(temp).unwrap().map(|entry| entry.unwrap().path()).collect();
    folders.sort();
    folders
}

/// Starts a demo with these temporary files, and waits until all its modules are on; with its processes.
fn demo_on(place: &Place, temp: &Path) -> (Running, Vec<u32>) {
    let mut command = place.command(&["demo", "--no-gui", "--quiet"]);
    command.env("TMPDIR", temp).process_group(0);
    let mut demo = Running::start(command);
    let pids = wait("the demo is on", || {
        demo.assert_runs();
        let said = place.say(&["list", "--json"]);
        let list: serde_json::Value = serde_json::from_str(&said.out).ok()?;
        let modules = list["modules"].as_array()?;
        let pids =
            modules.iter().map(|module| module["pid"].as_u64().map(|pid| pid as u32)).collect::<Option<Vec<_>>>()?;
        modules.iter().all(|module| module["state"] == "on").then_some(pids)
    });
    (demo, pids)
}

#[test]
fn the_files_of_a_killed_demo_are_removed_and_those_of_one_that_runs_are_not() {
    for remover in [&["clean"][..], &["demo", "--no-gui", "--quiet", "--seconds", "0.1"]] {
        let (killed_place, place) = (Place::new(), Place::new());
        let temp = killed_place.path("temp");
        std::fs::create_dir(&temp).unwrap();
        let (mut killed, pids) = demo_on(&killed_place, &temp);
        let left = folders(&temp);
        assert_eq!(left.len(), 1, "{left:?}");
        let (mut runs_on, _) = demo_on(&place, &temp);
        assert_eq!(folders(&temp).len(), 2, "the first one runs, and the second leaves it alone");

        killed.kill();
        // Some have ended by themselves.
        for pid in &pids {
            let _ = kill(Pid::from_raw(*pid as i32), Signal::SIGKILL);
        }
        until("all its processes have ended", || !pids.iter().any(|pid| runs(*pid)));
        assert!(left[0].exists(), "nobody has removed it yet");

        let mut command = killed_place.command(remover);
        command.env("TMPDIR", &temp);
        let said = Running::start(command).said();
        assert_eq!(said.code, Some(0), "{said:?}");
        if remover == ["clean"] {
            let line = format!("removed {}, the files of a demo or a replay", left[0].display());
            assert_eq!(
                said.out.lines().filter(|told| told.contains("the files of a demo")).collect::<Vec<_>>(),
                [line]
            );
        }
        assert!(!left[0].exists(), "{remover:?} removes it");
        assert_eq!(folders(&temp).len(), 1, "and leaves the other alone");
        runs_on.assert_runs();
        runs_on.stop();
        assert_eq!(folders(&temp), Vec::<PathBuf>::new());
        killed_place.assert_empty();
        place.assert_empty();
    }
}
