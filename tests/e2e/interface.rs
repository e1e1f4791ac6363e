//! `rohrpost interface` where nothing runs; of modules that run, `languages` and `hostile_texts` export.

use crate::harness::Place;

#[test]
fn interfaces_of_built_in_classes_are_known_and_made_into_code_where_nothing_runs() {
    let place = Place::new();
    let listed = place.say(&["interface", "export", "motor"]).ok();
    assert!(
        listed.starts_with("class motor: Drives a robot in the plane.\n") && listed.contains("drive <"),
        "{listed}"
    );
    let file = place.write("motor.json", place.say(&["interface", "export", "motor", "--json"]).ok());
    let file = file.to_str().unwrap();
    for (lang, has) in [
        ("rust", "fn drive(&mut self, speed_m_s: f64, turn_rate_rad_s: f64) -> Result<(), DriveError>;"),
        ("python", "    def motion(self) -> rp.Twist:\n"),
        ("c", "#define MOTOR_FUNCTION_HALT 17\n"),
    ] {
        let code = place.say(&["interface", "generate", "--lang", lang, file]).ok();
        assert!(code.contains(has), "{has}: {code}");
        // Into a file whole, or not at all: what is there stays when nothing can be made.
        let output = place.path(lang);
        let into = ["interface", "generate", "--lang", lang, "-o", lang];
        assert_eq!(place.say(&[&into[..], &[file]].concat()).ok(), "");
        assert_eq!(std::fs::read_to_string(&output).unwrap(), code);
        place.say(&[&into[..], &["gone.json"]].concat()).fails();
        assert_eq!(std::fs::read_to_string(&output).unwrap(), code);
    }
    let config = place.config(&["[[module]]\nname = \"probe.0\"\nprogram = \"probe\"\n"]);
    let config = config.to_str().unwrap();
    for (words, why) in [
        (&["export", "motor.0"][..], "no interface of `motor.0`: no node runs here; launch one"),
        (&["export", "probe.0", "--config", config], "a module says its interface while it runs"),
        (&["export", "nobody"], "no interface of `nobody`: no node runs here"),
        (&["generate", "--lang", "rust", config], "test.toml: no JSON of an interface: expected"),
        (&["generate", "--lang", "c", "gone.json"], "gone.json: No such file"),
    ] {
        place.say(&[&["interface"], words].concat()).fails_with([why]);
    }
}
