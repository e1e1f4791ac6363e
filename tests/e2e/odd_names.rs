//! Names of files are bytes: one that is no text is a name like any other, for every command that takes a file.

use crate::harness::{OUTPUT, Place, head, probe, until};
use crate::process::{Running, Said};
use crate::recordings;
use rohrpost_recording::Message;
use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use std::path::PathBuf;

/// `ü` as Latin-1 has it.
fn odd(place: &Place, name: &str) -> PathBuf {
    let bytes = [b"T\xfcr-", name.as_bytes()].concat();
    place.path("").join(OsStr::from_bytes(&bytes))
}

/// A word that begins with `@` is a file of an odd name.
fn said(place: &Place, words: &[&str]) -> Said {
    let mut command = place.command(&[]);
    for word in words {
        match word.strip_prefix('@') {
            Some(name) => command.arg(odd(place, name)),
            None => command.arg(word),
        };
    }
    Running::start(command).said()
}

#[test]
fn recordings_are_described_changed_and_replayed() {
    let place = Place::new();
    let module = "[nodes.main]\n[[module]]\nname = \"laser.0\"\nprogram = \"laser\"\n";
    let session = recordings::session("", "robot.toml", &(head("laser 100, tool 16") + module));
    let mut writer = recordings::begin(&place, "main", session);
    let scan = recordings::channel(&mut writer, "laser.0", "scan", &rohrpost::schema::Type::U8);
    writer.write(scan, &Message { arrival_ns: 5, stamp_ns: 5, epoch: 1, sequence: 0, data: &[7] }).unwrap();
    std::fs::rename(recordings::end(&place, "main", writer), odd(&place, "ours.mcap")).unwrap();
    std::fs::rename(crate::replayed_others::bag_that_says(&place, "x"), odd(&place, "theirs.mcap")).unwrap();
    for words in [
        &["record", "info", "@ours.mcap"][..],
        &["record", "cut", "@ours.mcap", "-o", "@cut.mcap"],
        &["record", "merge", "@ours.mcap", "@theirs.mcap", "-o", "@merged.mcap"],
        &["record", "recover", "@ours.mcap", "-o", "@recovered.mcap"],
        &["record", "export", "@ours.mcap", "-o", "@lines.json", "--format", "json"],
        &["log", "--file", "@ours.mcap"],
        &["replay", "@theirs.mcap", "--into", "x=laser.0/scan", "--quiet", "--no-gui"],
    ] {
        let said = said(&place, words);
        assert_eq!(said.code, Some(0), "{words:?}: {said:?}");
    }
    for made in ["cut.mcap", "merged.mcap", "recovered.mcap", "lines.json"] {
        assert!(odd(&place, made).is_file(), "{made}");
    }
    place.assert_empty();
}

#[test]
fn a_node_runs_by_its_configuration_and_tools_find_it() {
    let place = Place::new();
    let config = place.config(&[OUTPUT, &probe("probe.0", "", "")]);
    std::fs::rename(config, odd(&place, "robot.toml")).unwrap();
    assert_eq!(said(&place, &["check", "@robot.toml"]).code, Some(0));
    let mut command = place.command(&["launch"]);
    command.arg(odd(&place, "robot.toml"));
    let mut launch = Running::start(command);
    until("the module is on", || {
        launch.assert_runs();
        let said = place.say(&["list"]);
        said.code == Some(0) && said.out.lines().any(|line| line.starts_with("probe.0 ") && line.contains(" on "))
    });
    for words in [&["list", "--config", "@robot.toml"][..], &["restart", "probe.0"], &["graph", "-o", "@graph.svg"]] {
        let said = said(&place, words);
        assert_eq!(said.code, Some(0), "{words:?}: {said:?}");
    }
    place.end(&mut launch);
}
