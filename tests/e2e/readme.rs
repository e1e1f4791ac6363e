//! The module that README shows is launched by the very lines that README shows.

use crate::docs_printed::{Compared, difference, shown};
use crate::harness::{Place, json_lines, until};
use std::fs;
use std::path::Path;

/// README's code blocks of this language.
fn blocks(fence: &str) -> Vec<String> {
    let readme = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../README.md")).unwrap();
    let open = format!("\n```{fence}\n");
    readme.split(&open).skip(1).map(|part| part.split("\n```").next().unwrap().to_owned()).collect()
}

#[test]
fn the_module_of_the_readme_is_launched_by_five_lines_and_known_to_all_tools() {
    let place = Place::new();
    let lines = blocks("toml");
    let class = lines.iter().find(|block| block.starts_with("compass = ")).unwrap();
    let module = lines.iter().find(|block| block.starts_with("[[module]]")).unwrap();
    assert_eq!(class.lines().count() + module.lines().count(), 5);
    // The example was built beside this test: target/debug/{deps/e2e-…, examples/compass}.
    let built = std::env::current_exe().unwrap().parent().unwrap().parent().unwrap().join("examples/compass");
    let module = module.replace("../target/debug/examples/compass", built.to_str().unwrap());
    // Whether the bridge was built, or not.
    let demo = include_str!("../../config/demo.toml").replace("rohrpost-gui-bridge\"", "not-there\"");
    let demo = demo.replacen("[nodes.main]", &format!("{class}\n\n[nodes.main]"), 1);
    let config = place.write("demo.toml", format!("{demo}\n{module}\n"));
    place.copy("config/building.map");
    let mut launch = place.launch(&config);
    let robot = place.robot(&config, "main", &mut launch);
    until("compass.0 is on", || robot.state("compass.0") == "on");
    assert!(place.say(&["list"]).ok().contains("compass.0"));
    assert!(place.say(&["call", "compass.0"]).ok().contains("calibrate <bearing_deg: f64> -> f64"));
    assert_eq!(place.say(&["call", "compass.0", "calibrate", "90"]).ok(), "0\n");
    let echoed = place.say(&["echo", "compass.0", "--count", "2", "--json"]).ok();
    let values = json_lines(&echoed);
    assert_eq!(values.len(), 2);
    assert!(values.iter().all(|line| line["value"].as_f64().is_some_and(|bearing| (0.0..360.0).contains(&bearing))));
    let shown = shown("README.md");
    assert_eq!(shown.len(), 4, "what README shows of tools");
    let wrong = |(command, lines): &(String, Vec<String>)| difference(&place, command, lines, Compared::Whole);
    let wrong: Vec<String> = shown.iter().filter_map(wrong).collect();
    assert!(wrong.is_empty(), "README.md is to be corrected:\n\n{}", wrong.join("\n\n\n"));
    // How the kernel schedules what is not real time is no matter of rights.
    let listed = place.say(&["list", "--json"]).json();
    let nice = |name: &str| {
        listed["modules"].as_array().unwrap().iter().find(|m| m["module"] == name).unwrap()["scheduling"].clone()
    };
    assert_eq!((nice("output.0"), nice("mapper.0")), ("nice 10".into(), "nice 0".into()));
    place.end(&mut launch);
}
