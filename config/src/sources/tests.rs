use super::resolved_with;
use crate::Installation;
use std::fs;
use std::path::PathBuf;

const COMMON: &str = r#"
installation = "fleet"
[system]
name = "robot"
id = 1
[classes]
motor = { id = 200, text = "Drives" }
tool = { id = 16 }
[nodes.main]
[[module]]
name = "motor.0"
program = "./motor"
settings = { port = { env = "MOTOR_PORT", or = "/dev/ttyUSB0" }, speed-m-s = 0.5 }
"#;

struct Folder(tempfile::TempDir);

impl Folder {
    fn new(files: &[(&str, &str)]) -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        files.iter().for_each(|(name, text)| fs::write(folder.path(name), text).unwrap());
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn text(&self, name: &str, variable: Option<&str>) -> Result<String, String> {
        let text = resolved_with(&self.path(name), |_| variable.map(Into::into));
        text.map_err(|errors| errors.to_string().replace(&format!("{}/", self.0.path().display()), ""))
    }

    fn read(&self, name: &str) -> Result<Installation, String> {
        let text = self.text(name, None)?;
        let told = |errors: crate::Errors| errors.to_string().replace(&format!("{}/", self.0.path().display()), "");
        Installation::parse(&text, &self.path(name)).map_err(told)
    }
}

#[test]
fn a_robot_says_its_differences_alone() {
    let own = "include = [\"common.toml\"]\ninstallation = \"seven\"\n[[module]]\nname = \"motor.0\"\n\
               settings.speed-m-s = 0.3\n[[module]]\nname = \"motor.1\"\nprogram = \"./motor\"\n";
    let folder = Folder::new(&[("common.toml", COMMON), ("seven.toml", own)]);
    let installation = folder.read("seven.toml").unwrap();
    assert_eq!((&*installation.name, installation.modules.len()), ("seven", 2));
    let motor = &installation.modules[0];
    assert_eq!(motor.settings["speed-m-s"].as_float(), Some(0.3));
    assert_eq!(motor.settings["port"].as_str(), Some("/dev/ttyUSB0"), "what it does not say stays");
    assert_eq!(installation.place(motor.line), (folder.path("common.toml"), 10));
    assert_eq!(installation.place(installation.modules[1].line), (folder.path("seven.toml"), 6));
    assert_eq!(installation.included().collect::<Vec<_>>(), [folder.path("common.toml")]);
    let variable = installation.text.lines().position(|line| line.contains("$MOTOR_PORT")).unwrap();
    assert_eq!(installation.place(variable + 1), (folder.path("common.toml"), 13));
    let text = folder.text("seven.toml", Some("/dev/ttyACM3")).unwrap();
    for line in [
        "installation = \"seven\" #@ seven.toml:2",
        "port = \"/dev/ttyACM3\" #@ common.toml:13 by $MOTOR_PORT",
        "speed-m-s = 0.3 #@ seven.toml:5",
        "motor = { id = 200, text = \"Drives\" } #@ common.toml:7",
    ] {
        assert!(text.lines().any(|found| found == line), "{line} is not in\n{text}");
    }
    assert_eq!(resolved_with(&folder.path("seven.toml"), |_| None).unwrap(), installation.text, "the same again");
}

#[test]
fn the_digest_is_of_what_it_resolves_to() {
    let whole = COMMON.replace("{ env = \"MOTOR_PORT\", or = \"/dev/ttyUSB0\" }", "\"/dev/ttyUSB0\"");
    let folder =
        Folder::new(&[("common.toml", COMMON), ("own.toml", "include = [\"common.toml\"]"), ("whole.toml", &whole)]);
    let digests = ["own.toml", "whole.toml"].map(|name| folder.read(name).unwrap().digest());
    assert_eq!(digests[0], digests[1]);
    assert_eq!(folder.text("whole.toml", None).unwrap(), whole, "a file alone stays as it is");
}

#[test]
fn mistakes_are_told_where_they_stand() {
    let broken = COMMON.replace("id = 200", "id = 900");
    for (files, told) in [
        (vec![("a.toml", "include = [\"common.toml\"]"), ("common.toml", &*broken)], "common.toml:7: class `motor`"),
        (vec![("a.toml", "include = [\"b.toml\"]"), ("b.toml", "x = = 1")], "b.toml:1: this is no TOML"),
        (vec![("a.toml", "\ninclude = [\"none.toml\"]")], "a.toml:2: `none.toml` cannot be read"),
        (
            vec![("a.toml", "include = [\"b.toml\"]"), ("b.toml", "\ninclude = [\"a.toml\"]")],
            "b.toml:2: `a.toml` leads back to itself (a.toml → b.toml → a.toml); drop one",
        ),
        (
            vec![("a.toml", "include = [\"b.toml\", \"c.toml\"]"), ("b.toml", "name = 1"), ("c.toml", "\nname = 2")],
            "a.toml:1: `name` is 1 in b.toml:1, and 2 in c.toml:2; drop one, or say in this file which counts",
        ),
        (
            vec![("a.toml", "[network]\nport = { env = \"P\", or = 1 }")],
            "a.toml:2: `network.port`: nodes must agree on it",
        ),
        (
            vec![("a.toml", "[[module]]\nsettings.port = { env = \"P\" }")],
            "a.toml:2: `module.settings.port`: write `{ env = \"NAME\", or = ... }`",
        ),
    ] {
        let folder = Folder::new(&files);
        let errors = folder.read("a.toml").unwrap_err();
        assert!(errors.contains(told), "{told}: {errors}");
    }
}

#[test]
fn files_beside_each_other_may_say_the_same_and_be_overruled() {
    let files = [
        ("a.toml", "include = [\"b.toml\", \"c.toml\"]\n[x]\nk = 3\n"),
        ("b.toml", "include = [\"d.toml\"]\n[x]\nk = 1\n"),
        ("c.toml", "include = [\"d.toml\"]\n[x]\nk = 2\n"),
        ("d.toml", "[[flow]]\nfrom = \"m.0\"\n[x]\nsame = [\n  1,\n  2,\n]\n"),
    ];
    let text = Folder::new(&files).text("a.toml", None).unwrap();
    assert_eq!(text.matches("[[flow]]").count(), 1, "{text}");
    assert!(
        text.contains("k = 3 #@ a.toml:3\n") && text.contains("]  #@ d.toml:7\n".replace("  ", " ").as_str()),
        "{text}"
    );
}

#[test]
fn a_variable_is_of_the_kind_that_stands_behind_or() {
    let file = |or: &str| format!("[[module]]\nsettings = {{ it = {{ env = \"IT\", or = {or} }} }}\n");
    for (or, said, written) in [
        ("\"a\"", "b\"c", Ok("it = 'b\"c' ")),
        ("1", "-7", Ok("it = -7 ")),
        ("1.5", "2", Ok("it = 2.0 ")),
        ("true", "false", Ok("it = false ")),
        ("1", "two", Err("the variable IT is `two`; it must be a whole number, as what stands behind `or`")),
        ("true", "1", Err("it must be true or false")),
        ("[1]", "1", Err("it must be a text, a number, true or false")),
    ] {
        let folder = Folder::new(&[("a.toml", &file(or))]);
        match (folder.text("a.toml", Some(said)), written) {
            (Ok(text), Ok(line)) => assert!(text.contains(line), "{line}: {text}"),
            (Err(errors), Err(told)) => assert!(errors.contains(told), "{told}: {errors}"),
            (found, _) => panic!("{or}, {said}: {found:?}"),
        }
    }
}
