//! Recordings of strangers: nothing that a file names runs until the user says so, and what it says stays in its line.

use crate::exact::{launched, recording, wait_journaled};
use crate::harness::{OUTPUT, Place, program};
use crate::hostile_texts::{HOSTILE, assert_plain, structure};
use crate::process::Said;
use crate::record::recording_that_says;
use crate::recordings;
use crate::replayed_others::bag_that_says;
use crate::seer::entry;
use rohrpost::schema::Schema;
use rohrpost_recording::{ChannelSpec, Reader};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What of the file says that a seer has a journal.
const RECORD: &str =
    "[record]\ndirectory = \"recordings\"\nexact = [\"seer.0\"]\nleave-free = \"0 B\"\nflush = \"20 ms\"\n";

/// A recording of a seer that a shell starts, which leaves the file `ran`; that is removed again.
fn recorded(place: &Place) -> PathBuf {
    let script = format!("touch {:?}; shift; exec \"$@\"", place.path("ran"));
    let mut words = ["/bin/sh", "-c", script.as_str(), "sh", HOSTILE].map(toml_text).join(", ");
    words.push_str(&program("seer::module").replacen('[', ", ", 1));
    let entry = entry(0, "clock").replace(&program("seer::module"), &format!("[{words}"));
    let (mut launch, _robot) = launched(place, &format!("{entry}{RECORD}"));
    let file = recording(place, 1);
    wait_journaled(&file, "seer.0", 2);
    launch.stop();
    std::fs::remove_file(place.path("ran")).unwrap();
    file
}

/// As TOML writes a text.
fn toml_text(text: &str) -> String {
    let escaped = |c: char| match c {
        '"' | '\\' => format!("\\{c}"),
        c if c.is_control() => format!("\\u{:04x}", u32::from(c)),
        c => c.to_string(),
    };
    format!("\"{}\"", text.chars().map(escaped).collect::<String>())
}

/// The journals of a file, in one that says it was made with this configuration.
fn with_configuration(place: &Place, file: &Path, text: &str) -> PathBuf {
    let mut writer = recordings::begin(place, "other", recordings::session("main", "test.toml", text));
    let mut reader = Reader::open(file).unwrap();
    while let Some((channel, message)) = reader.next().unwrap() {
        if let (Some(number), Some(ty)) = (channel.texts.get("number"), &channel.ty) {
            let texts = BTreeMap::from([("number".to_owned(), number.clone())]);
            let id = writer.channel(&ChannelSpec { name: &channel.name, item: &channel.item, ty, texts }).unwrap();
            writer.write(id, &message).unwrap();
        }
    }
    recordings::end(place, "other", writer)
}

/// Exact replay with these words behind the file.
fn exact(place: &Place, file: &Path, words: &[&str]) -> Said {
    place.say(&[&["replay", "--exact", file.to_str().unwrap()], words].concat())
}

/// Exact replay by this test program, whatever the recording names.
fn exact_by_own(place: &Place, file: &Path, before: &[&str]) -> Said {
    let me = std::env::current_exe().unwrap();
    let words = ["--", "--exact", "seer::module", "--nocapture", "--test-threads", "2"];
    exact(place, file, &[before, &["--program", me.to_str().unwrap()], &words[..]].concat())
}

#[test]
fn a_recorded_command_is_shown_and_runs_when_the_user_says_so() {
    let place = Place::new();
    let file = recorded(&place);
    let ran = place.path("ran");
    let said = exact(&place, &file, &["seer.0"]);
    assert_eq!(said.code, Some(1), "{said:?}");
    assert_plain(&["out"], &said.out);
    assert_plain(&["err"], &said.err);
    let script = format!("'touch \"{}\"; shift; exec \"$@\"'", ran.display());
    for words in [
        &format!("seer.0: the recording would run\n  /bin/sh -c {script} sh $'x\\u001b[2J")[..],
        " seer::module --nocapture ",
        "no local configuration to compare with; name one: --config FILE",
    ] {
        assert!(said.out.contains(words), "no `{words}` in:\n{}", said.out);
    }
    let command = format!("\n  rohrpost replay --exact --run-recorded {} seer.0\n", file.display());
    assert!(said.err.starts_with("nothing was run: ") && said.err.contains(&command), "{}", said.err);

    let own = place.path("test.toml");
    let own = own.to_str().unwrap();
    let said = exact(&place, &file, &["--config", own]);
    assert!(said.code == Some(1) && said.out.contains(&format!("the same as in {own}")), "{said:?}");
    let text = std::fs::read_to_string(own).unwrap();
    let other = place.write("other.toml", text.replace("/bin/sh", "/bin/true").replace("\"clock\"", "\"map\""));
    let other = other.to_str().unwrap();
    let said = exact(&place, &file, &["--config", other]);
    assert!(said.out.contains(&format!("{other} has another command: /bin/true -c ")), "{said:?}");
    assert!(
        said.out.contains(&format!("{other} has other settings: source = \"map\" (recorded: \"clock\")")),
        "{said:?}"
    );
    let said = exact(&place, &file, &["--json"]);
    let run: serde_json::Value = serde_json::from_str(&said.out).unwrap();
    assert_eq!((said.code, &run["result"], &run["command"][0]), (Some(1), &"not run".into(), &"/bin/sh".into()));
    assert_eq!(run["command"][4], HOSTILE, "{run:#}");
    assert!(!ran.exists(), "nobody has said that it may run");

    let text = exact_by_own(&place, &file, &[]).ok();
    assert!(text.starts_with("seer.0: identical: ") && !ran.exists(), "no word of the recording runs: {text}");
    let said = exact_by_own(&place, &file, &["--config", other]);
    let note = format!("seer.0: {other} has other settings: source = \"map\" (recorded: \"clock\")");
    assert!(said.out.starts_with("seer.0: identical: ") && said.err.contains(&note), "{said:?}");
    let text = exact(&place, &file, &["--run-recorded"]).ok();
    assert!(text.starts_with("seer.0: identical: ") && ran.exists(), "{text}");
}

#[test]
fn what_a_journal_names_that_contradicts_its_recording_is_not_run() {
    let place = Place::new();
    let file = recorded(&place);
    let text = std::fs::read_to_string(place.path("test.toml")).unwrap();
    let benign = text.replace("/bin/sh", "/opt/robot/seer");
    let other = with_configuration(&place, &file, &benign);
    for said in [exact(&place, &other, &[]), exact(&place, &other, &["--run-recorded"])] {
        let told = format!("{}{}", said.out, said.err);
        assert_plain(&["out", "err"], &told);
        let words = "the configuration in its journal is not the one that the recording says it was made with";
        assert!(told.contains(words) && told.contains("/opt/robot/seer"), "{told}");
        assert!(!place.path("ran").exists(), "{told}");
    }
    assert_eq!(exact(&place, &other, &["--run-recorded"]).code, Some(1));
    // The user's own program repeats it: a configuration may be edited before a module is restarted.
    let own = exact_by_own(&place, &other, &[]).ok();
    assert!(own.starts_with("seer.0: identical: ") && !place.path("ran").exists(), "{own}");
    exact(&place, &other, &["--list"]).ok();
    std::fs::remove_file(&other).unwrap();
    let same = with_configuration(&place, &file, &text);
    let told = exact(&place, &same, &["--run-recorded"]).ok();
    assert!(told.starts_with("seer.0: identical: "), "{told}");
}

/// A file that says this in each text that MCAP has: packed in this way, of this topic, schema and encodings, with an
/// attachment and metadata.
fn packed_by(place: &Place, text: &str) -> PathBuf {
    let mut bytes = mcap::MAGIC.to_vec();
    let word = |text: &str| [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat();
    let mut record = |op: u8, body: Vec<u8>| {
        bytes.push(op);
        bytes.extend((body.len() as u64).to_le_bytes());
        bytes.extend(body);
    };
    let texts = |text: &str| {
        let pair = [word(text), word(text)].concat();
        [&(pair.len() as u32).to_le_bytes()[..], &pair].concat()
    };
    record(1, [word("rohrpost"), word(text)].concat());
    record(3, [&1_u16.to_le_bytes()[..], &word(text), &word(text), &word(text)].concat());
    let ids = [1_u16.to_le_bytes(), 1_u16.to_le_bytes()].concat();
    record(4, [ids, word(text), word(text), texts(text)].concat());
    record(12, [word(text), texts(text)].concat());
    let times = [7_u64.to_le_bytes(), 7_u64.to_le_bytes()].concat();
    record(9, [times.clone(), word(text), word(text), 0_u64.to_le_bytes().into(), vec![0; 4]].concat());
    // A chunk: times, unpacked length, sum, how it is packed, packed length.
    record(6, [times, 9_u64.to_le_bytes().into(), vec![0; 4], word(text), 0_u64.to_le_bytes().into()].concat());
    record(15, vec![0; 4]);
    record(2, vec![0; 20]);
    bytes.extend(mcap::MAGIC);
    place.write("packed.mcap", bytes)
}

#[test]
fn no_text_of_a_file_leaves_its_line() {
    let place = Place::new();
    let packed = packed_by(&place, HOSTILE);
    let ours = recording_that_says(&place, HOSTILE, &structure(String::schema()));
    let bag = bag_that_says(&place, HOSTILE);
    let config = place.config(&[OUTPUT]);
    let config = config.to_str().unwrap();
    let [packed, ours, bag] = [&packed, &ours, &bag].map(|path| path.to_str().unwrap());
    let mut number = 0;
    let mut new = || {
        number += 1;
        place.path(&format!("new-{number}.mcap")).display().to_string()
    };
    let mut commands: Vec<Vec<String>> = Vec::new();
    let words = |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>();
    for file in [packed, ours, bag] {
        commands.push(words(&["record", "info", file]));
        commands.push(words(&["record", "info", "--json", file]));
        commands.push(words(&["record", "recover", file, "--output", &new()]));
        commands.push(words(&["record", "recover", file, "--json", "--output", &new()]));
        commands.push(words(&["record", "cut", file, "-o", &new()]));
        commands.push(words(&["record", "cut", file, "-o", &new(), "--names", HOSTILE]));
        commands.push(words(&["record", "merge", file, "-o", &new()]));
        for other in [packed, ours, bag] {
            commands.push(words(&["record", "merge", file, other, "-o", &new()]));
        }
        commands.push(words(&["record", "export", file, "-o", &new(), "--format", "drawn"]));
        commands.push(words(&["record", "export", file, "-o", "-", "--format", "json"]));
        commands.push(words(&["log", "--file", file]));
        commands.push(words(&["replay", file]));
        commands.push(words(&["replay", file, "--run", "x"]));
        commands.push(words(&["replay", file, "--config", config]));
        commands.push(words(&["replay", "--exact", file]));
        commands.push(words(&["replay", "--exact", file, HOSTILE]));
        commands.push(words(&["replay", "--exact", file, "--list"]));
        commands.push(words(&["replay", "--exact", file, "--run-recorded"]));
    }
    for command in commands {
        let command: Vec<&str> = command.iter().map(String::as_str).collect();
        let said = place.say(&command);
        assert!(!said.err.contains("panicked"), "{command:?}: {said:?}");
        assert!(!(said.out.is_empty() && said.err.is_empty()), "{command:?} says nothing");
        assert_plain(&command, &said.out);
        assert_plain(&command, &said.err);
    }
}
