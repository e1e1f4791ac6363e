//! Completions of a shell at the tab key, by the scripts that `rohrpost completions` prints.

use crate::harness::{OUTPUT, Place, probe};
use crate::network::NETWORK;
use rohrpost_testbed::report::skipped;
use std::process::Command;

/// Completions of bash for the last of these words.
pub(crate) fn offered(place: &Place, words: &[&str]) -> Vec<String> {
    let [before @ .., last] = words else { panic!("no words") };
    let list = words.iter().map(|word| format!("'{word}'")).collect::<Vec<_>>().join(" ");
    // As bash itself does at the key: sets the words, and calls the function with the command, the word and the one
    // before.
    let script = format!(
        "set -e; source <(\"$ROHRPOST\" completions bash); complete -p rohrpost >/dev/null
         COMP_WORDS=({list}); COMP_CWORD={}; COMP_TYPE=9
         _clap_complete_rohrpost rohrpost '{last}' '{}'
         printf '%s\\n' \"${{COMPREPLY[@]}}\"",
        words.len() - 1,
        before.last().unwrap(),
    );
    let said = Command::new("bash")
        .args(["--norc", "-c", &script])
        .env("ROHRPOST", env!("CARGO_BIN_EXE_rohrpost"))
        .env("ROHRPOST_DIR", place.memory())
        .current_dir(place.path("."))
        .output()
        .unwrap();
    assert!(said.status.success() && said.stderr.is_empty(), "{said:?}");
    let said = String::from_utf8(said.stdout).unwrap();
    // Options are offered everywhere.
    said.lines()
        .filter(|line| !line.is_empty() && line.starts_with('-') == last.starts_with('-'))
        .map(str::to_owned)
        .collect()
}

#[test]
fn words_that_are_no_text_are_no_panic() {
    use std::os::unix::ffi::OsStrExt;
    let place = Place::new();
    let mut command = place.command(&["--", "rohrpost", "call"]);
    command.args([std::ffi::OsStr::from_bytes(b"caf\xe9"), std::ffi::OsStr::new("")]);
    command.env("ROHRPOST_COMPLETE", "bash").env("_CLAP_COMPLETE_INDEX", "3").env("_CLAP_COMPLETE_COMP_TYPE", "9");
    command.env("_CLAP_COMPLETE_SPACE", "true").env("_CLAP_IFS", "\n");
    let said = crate::process::Running::start(command).said();
    assert_eq!((said.code, said.err.as_str()), (Some(0), ""), "{said:?}");
    assert!(said.out.contains("output-level"), "{said:?}");
}

#[test]
fn bash_offers_what_the_running_node_has() {
    let (place, mut launch, robot) = Place::running(&[OUTPUT, &probe("probe.0", "", "")]);
    let all = offered(&place, &["rohrpost", ""]);
    for command in ["check", "launch", "call", "echo", "doctor", "completions"] {
        assert!(all.iter().any(|offer| offer == command), "{command}: {all:?}");
    }
    assert_eq!(offered(&place, &["rohrpost", "com"]), ["completions"]);
    assert_eq!(offered(&place, &["rohrpost", "completions", ""]), ["bash", "zsh", "fish"]);
    assert_eq!(offered(&place, &["rohrpost", "call", "--js"]), ["--json"]);
    // From the configuration.
    let received = |name: &str| {
        let mailbox = robot.node.look_at(robot.name(name)).unwrap();
        mailbox.classes.iter().map(|class| class.received).sum::<u64>()
    };
    let before = (received("probe.0"), received("output.0"));
    assert_eq!(offered(&place, &["rohrpost", "call", ""]), ["output.0", "probe.0"]);
    assert_eq!(offered(&place, &["rohrpost", "status", "pro"]), ["probe.0"]);
    assert_eq!(offered(&place, &["rohrpost", "log", "--module", "o"]), ["output.0"]);
    assert_eq!(offered(&place, &["rohrpost", "log", "--level", "d"]), ["debug"]);
    assert_eq!(offered(&place, &["rohrpost", "run", "ma"]), ["mapper"]);
    // From modules' own descriptions, built in or the user's.
    assert_eq!(offered(&place, &["rohrpost", "call", "output.0", "li"]), ["lines_from"]);
    assert_eq!(offered(&place, &["rohrpost", "echo", "output.0", ""]), ["line"]);
    let functions = offered(&place, &["rohrpost", "call", "probe.0", ""]);
    assert!(["count", "tell", "on", "get"].iter().all(|name| functions.iter().any(|f| f == name)), "{functions:?}");
    assert_eq!(offered(&place, &["rohrpost", "call", "probe.0", "cou"]), ["count", "count_again"]);
    assert_eq!(offered(&place, &["rohrpost", "call", "probe.0", "get", "be"]), ["beat"]);
    assert_eq!(offered(&place, &["rohrpost", "echo", "probe.0", "si"]), ["silence"]);
    assert_eq!((received("probe.0"), received("output.0")), before, "nobody was sent anything for this");
    place.end(&mut launch);
}

#[test]
fn without_a_node_the_named_configuration_is_asked() {
    let place = Place::new();
    place.config_of(
        "arm",
        &format!(
            "[nodes.base]\naddress = \"127.0.0.1\"\ntools = [0, 1]\n[nodes.desk]\naddress = \"127.0.0.2\"\n\
             tools = [2, 3]\n{NETWORK}"
        ),
        &["[[module]]\nname = \"probe.7\"\nnode = \"desk\"\nprogram = \"nowhere\"\n"],
    );
    assert_eq!(offered(&place, &["rohrpost", "call", ""]), [""; 0], "nothing runs, and nothing is said of it");
    assert_eq!(offered(&place, &["rohrpost", "call", "--config", "arm.toml", "pro"]), ["probe.7"]);
    assert_eq!(offered(&place, &["rohrpost", "check", "arm.toml", "--node", ""]), ["base", "desk"]);
    assert_eq!(offered(&place, &["rohrpost", "check", "ar"]), ["arm.toml"]);
    // A wrong configuration must not disturb the user's typing.
    place.write("wrong.toml", "nonsense");
    assert_eq!(offered(&place, &["rohrpost", "call", "--config", "wrong.toml", ""]), [""; 0]);
    assert_eq!(offered(&place, &["rohrpost", "new", "pro"]), [""; 0], "a name that there is not yet");
}

#[test]
fn every_shell_can_read_its_script() {
    let place = Place::new();
    for shell in ["bash", "zsh", "fish"] {
        let script = place.say(&["completions", shell]).ok();
        assert!(script.contains("ROHRPOST_COMPLETE"), "{script}");
        let file = place.path(shell);
        std::fs::write(&file, script).unwrap();
        // Only installed shells can be asked.
        match Command::new(shell).arg("-n").arg(&file).output() {
            Ok(said) => assert!(said.status.success(), "{shell}: {said:?}"),
            Err(error) => skipped(&format!("whether {shell} can read its completions ({shell}: {error})")),
        }
    }
    let said = place.say(&["completions", "csh"]);
    assert_eq!(said.code, Some(2));
    assert!(said.err.contains("bash, zsh, fish"), "{}", said.err);
}
