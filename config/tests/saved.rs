//! Saved values of parameters: contents of a file, and what overrides what.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_config::{Installation, Saved, SavedValue, explain};
use serde::Deserialize;
use std::path::Path;

const DEMO: &str = include_str!("../demo.toml");

#[derive(Debug, Deserialize, PartialEq)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
struct Pilot {
    laser: String,
    motor: String,
    cruise_m_s: f64,
    seed: u64,
}

fn demo() -> Installation {
    Installation::parse(DEMO, Path::new("demo.toml")).unwrap_or_else(|errors| panic!("{errors}"))
}

/// The demo with a file of saved values beside it.
fn with(text: &str) -> Installation {
    let mut demo = demo();
    let saved = Saved::parse(text, Path::new("tuned.toml"), &demo).unwrap_or_else(|errors| panic!("{errors}"));
    demo.saved = Some(saved);
    demo
}

fn pilot(installation: &Installation) -> Result<Pilot, String> {
    let name = installation.classes.parse_module("pilot.0").unwrap();
    installation.document().settings_as(installation.module(name).unwrap()).map_err(|error| error.to_string())
}

#[test]
fn saved_values_go_before_settings_and_the_rest_stays() {
    let before = pilot(&demo()).unwrap();
    let after = pilot(&with("[\"pilot.0\"]\ncruise-m-s = 0.4\n")).unwrap();
    assert_eq!((before.cruise_m_s, after.cruise_m_s), (0.6, 0.4));
    assert_eq!(after, Pilot { cruise_m_s: 0.4, ..before });
    for text in ["", "[\"pilot.0\"]\n", "[\"motor.0\"]\nlaser-rate-hz = 5.0\n"] {
        assert_eq!(pilot(&with(text)).unwrap(), pilot(&demo()).unwrap(), "{text}");
    }
    let page = explain(&with("[\"pilot.0\"]\ncruise-m-s = 0.4\n"), None);
    assert!(page.contains("  saved         cruise-m-s = 0.4\n"), "{page}");
}

#[test]
fn what_is_wrong_with_a_saved_value_is_told_with_its_own_file_and_line() {
    for (text, says) in [
        (
            "# tuned\n[\"pilot.0\"]\n# fast\ncruise-m-s = \"x\"\n",
            "tuned.toml:4: settings of module `pilot.0`: invalid type",
        ),
        ("[\"pilot.0\"]\ncruise = 1.0\n", "tuned.toml:2: settings of module `pilot.0`: unknown field `cruise`"),
    ] {
        let said = pilot(&with(text)).unwrap_err();
        assert!(said.starts_with(says), "{text}\n  says: {said}\n  should say: {says}");
    }
    // Settings must be complete and right by themselves: then the saved values are to blame.
    let wrong = DEMO.replace("cruise-m-s = 0.6", "cruise-m-s = \"x\"");
    let line = 1 + wrong.lines().position(|line| line.contains("cruise-m-s")).unwrap();
    let mut demo = Installation::parse(&wrong, Path::new("demo.toml")).unwrap();
    let saved = Saved::parse("[\"pilot.0\"]\ncruise-m-s = 0.4\n", Path::new("tuned.toml"), &demo).unwrap();
    demo.saved = Some(saved);
    let said = pilot(&demo).unwrap_err();
    assert!(said.starts_with(&format!("demo.toml:{line}: settings of module `pilot.0`: ")), "{said}");
}

#[test]
fn mistakes_in_the_file_are_told_by_line() {
    for (text, says) in [
        ("cruise-m-s = 0.4", "tuned.toml:1: `cruise-m-s` names no module; the modules are output.0, motor.0"),
        ("[pilot.0]", "tuned.toml:1: `pilot` names no module; did you mean [\"pilot.0\"]?"),
        ("\n[\"pilto.0\"]", "tuned.toml:2: `pilto.0` names no module; did you mean [\"pilot.0\"]?"),
        ("[\"laser.0\"]", "tuned.toml:1: `laser.0` names no module; it is an alias; write [\"motor.0\"]"),
        ("\"pilot.0\" = 3", "tuned.toml:1: `pilot.0` is 3; write a table"),
        ("[\"pilot.0\"]\na = [1]", "tuned.toml:2: [\"pilot.0\"]: `a`: a parameter is a number, a text, true or false"),
        ("[\"pilot.0\"]\na = 1979-05-27", "tuned.toml:2: [\"pilot.0\"]: `a`: a parameter is a number"),
        ("[\"pilot.0\"]\na = { b = 1 }", "tuned.toml:2: [\"pilot.0\"]: `a`: a parameter is a number"),
        (
            "[\"pilot.0\"]\na = 0x",
            "tuned.toml:2: [\"pilot.0\"]: `a`: an integer has a digit, and is -9223372036854775808 to",
        ),
        ("[\"pilot.0\"]\na = 18446744073709551616", "tuned.toml:2: [\"pilot.0\"]: `a`: an integer has a digit"),
        ("[\"pilot.0\"]\na = 1\na = 2", "tuned.toml:3: `a` is given twice; drop one of them"),
        ("[\"pilot.0\"]\na = = 1", "tuned.toml:2: this is no TOML: "),
        ("\0", "tuned.toml:1: this is no TOML: "),
    ] {
        let said = Saved::parse(text, Path::new("tuned.toml"), &demo()).unwrap_err().to_string();
        assert!(said.starts_with(says), "{text:?}\n  says: {said}\n  should say: {says}");
    }
}

#[test]
fn values_of_what_is_no_parameter_are_refused() {
    let installation = with("[\"pilot.0\"]\ncruise-m-s = 0.4\nlaser = \"laser.0\"\n");
    let document = installation.document();
    let saved = document.saved().unwrap();
    let name = installation.classes.parse_module("pilot.0").unwrap();
    let module = installation.module(name).unwrap();
    let check = |known: &[&str]| saved.check_names(module, known).map_err(|error| error.to_string());
    assert_eq!(check(&["cruise-m-s", "laser"]), Ok(()));
    for (known, says) in [
        (
            &["cruise-m-s"][..],
            "tuned.toml:3: settings of module `pilot.0`: `laser` is no parameter; there are cruise-m-s;",
        ),
        (&["cruise-m-s", "laser-x"], "`laser` is no parameter; did you mean `laser-x`?"),
        (&[], "is no parameter; the module has none; drop this line"),
    ] {
        let said = check(known).unwrap_err();
        assert!(said.contains(says), "{said}\n  should say: {says}");
    }
    let values: Vec<SavedValue<toml::Value>> = saved.values(name).unwrap();
    let told: Vec<_> = values.iter().map(|saved| (saved.name.as_str(), saved.line, saved.value.to_string())).collect();
    assert_eq!(told, [("cruise-m-s", 2, "0.4".into()), ("laser", 3, "\"laser.0\"".into())]);
}

#[test]
fn the_file_is_read_with_the_configuration_if_it_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let (config, tuned) = (folder.path().join("demo.toml"), folder.path().join("tuned.toml"));
    std::fs::write(&config, format!("parameters = \"tuned.toml\"\n{DEMO}")).unwrap();
    assert_eq!(pilot(&Installation::load(&config).unwrap()).unwrap().cruise_m_s, 0.6, "nothing was saved yet");
    std::fs::write(&tuned, "[\"pilot.0\"]\ncruise-m-s = 0.3\n").unwrap();
    assert_eq!(pilot(&Installation::load(&config).unwrap()).unwrap().cruise_m_s, 0.3);
    std::fs::write(&tuned, "[\"pilto.0\"]\n").unwrap();
    let errors = Installation::load(&config).unwrap_err();
    assert_eq!((errors.path(), errors.problems()[0].line), (tuned.as_path(), Some(1)));
    std::fs::remove_file(&tuned).unwrap();
    std::fs::create_dir(&tuned).unwrap();
    let said = Installation::load(&config).unwrap_err().to_string();
    assert!(said.contains("saved parameters cannot be read"), "{said}");
}
