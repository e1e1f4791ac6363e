//! Python's reader of MCAP, which others wrote, reads whole and recovered files, with all checksums, and counts alike.
//! It decodes what is drawn, and its writer makes files that are listed here, as does that of `rosbags`. Rerun's
//! converter finds what is drawn, too.
//!
//! `cargo xtask test --all` installs both and names the programs.

#![allow(clippy::unwrap_used, reason = "these are tests")]

mod bags;
#[path = "../common/mod.rs"]
mod common;
mod drawn;
mod foreign;
mod rerun;
#[path = "../common/sights.rs"]
mod sights;

use common::{Running, busy_options, channels, in_role, recover_all, session, with_message};
use rohrpost_recording::{Options, Selection, Writer, cut, info, merge};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

const PYTHON: &str = "ROHRPOST_MCAP_PYTHON";

/// Times that a recorder is killed.
const KILLS: usize = 8;

#[test]
fn role() {
    let Some((_, folder)) = common::role() else { return };
    let mut writer = Writer::start(busy_options(&folder), session()).unwrap();
    let channels = channels(&mut writer);
    let mut has_told = false;
    for number in 0.. {
        with_message(number, |channel, message| writer.write(channels[channel], message)).unwrap();
        while writer.status().waiting > 3_000 {
            std::thread::sleep(Duration::from_millis(1));
        }
        if !has_told && writer.status().files_closed >= 3 {
            common::tell("three");
            has_told = true;
        }
    }
}

/// What a script says of files.
fn python(script: &str, files: &[PathBuf]) -> Vec<String> {
    let python = std::env::var_os(PYTHON);
    let python =
        python.unwrap_or_else(|| panic!("{PYTHON} is not set; run `cargo xtask test --all`, which installs it"));
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python").join(script);
    let told = Command::new(python).arg("-B").arg(script).args(files).output().unwrap();
    assert!(told.status.success(), "{}", String::from_utf8_lossy(&told.stderr));
    String::from_utf8(told.stdout).unwrap().lines().map(String::from).collect()
}

/// What `read.py` says, by us: messages of each topic, with those that are repeated.
fn ours(path: &Path) -> String {
    let told = info(path).unwrap();
    let channels =
        told.channels.iter().map(|channel| format!(" {}={}", channel.topic, channel.messages + channel.repeated));
    format!("{}{}", told.messages + told.repeated, channels.collect::<String>())
}

#[test]
fn python_reads_what_killed_recorders_left_and_what_is_cut_and_merged_of_it() {
    for _ in 0..KILLS {
        check_killed();
    }
}

fn check_killed() {
    let folder = tempfile::tempdir().unwrap();
    let recordings = folder.path().join("recordings");
    std::fs::create_dir(&recordings).unwrap();
    let mut running = Running::start(in_role("record", &recordings));
    assert_eq!(running.hear().as_deref(), Some("three"));
    running.child.kill().unwrap();
    running.child.wait().unwrap();
    let (messages, reports) = recover_all(&recordings);
    let mut files: Vec<PathBuf> = reports.iter().map(|report| report.path.clone()).collect();
    let merged = folder.path().join("merged.mcap");
    assert_eq!(merge(&files, &merged, &mut |_, _| {}).unwrap().0, u64::from(messages));
    let part = folder.path().join("part.mcap");
    let selection = Selection { from_ns: Some(1_100_000), names: vec!["laser.0".into()], ..Selection::default() };
    cut(&merged, &part, &selection, &mut |_, _| {}).unwrap();
    files.extend([merged, part]);
    let wanted: Vec<String> = files.iter().map(|path| ours(path)).collect();
    assert_eq!(python("read.py", &files), wanted);
}

#[test]
fn python_reads_a_file_without_messages() {
    let folder = tempfile::tempdir().unwrap();
    let mut writer = Writer::start(Options::new(folder.path(), "base"), session()).unwrap();
    channels(&mut writer);
    writer.finish().1.unwrap();
    let path = folder.path().join("base-0001.mcap");
    assert_eq!(python("read.py", &[path]), ["0"]);
}
