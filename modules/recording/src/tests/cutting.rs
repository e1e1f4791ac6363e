//! A file cut anywhere is recovered to what was before the cut; a part is taken by time and name.

use super::support::{Said, cut_off, file_of, memory_folder, options, read, said, session};
use crate::{
    CutError, LastMessage, Mark, ReadError, Reader, RecoverError, RewriteError, SelectError, Selection, Writer, cut,
    info, last_message, merge, recover, recovered_path,
};
use std::path::{Path, PathBuf};
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(60);

/// Recovers bytes as a file, and reads it.
fn recovered(folder: &Path, bytes: &[u8]) -> (crate::Recovered, Vec<Said>) {
    let path = folder.join("cut.mcap");
    std::fs::write(&path, bytes).unwrap();
    let to = recovered_path(&path);
    let _ = std::fs::remove_file(&to);
    let report = recover(&path, &to, &mut |_, _| {}).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), bytes, "the old file stays as it is");
    let told = info(&to).unwrap();
    assert!(told.is_closed && told.messages == report.messages && told.bytes == report.bytes, "{told:?}");
    let (all, damages) = read(&to);
    assert_eq!((all.len() as u64, damages), (report.messages, 0));
    (report, all)
}

#[test]
fn a_file_cut_at_any_byte_is_recovered_to_what_was_before() {
    let folder = memory_folder();
    let all = said(60, 40);
    let bytes = std::fs::read(file_of(folder.path(), "base", &all)).unwrap();
    let mut before = 0;
    for len in 0..=bytes.len() {
        let (report, found) = recovered(folder.path(), &bytes[..len]);
        assert_eq!(found, all[..found.len()], "cut at {len}");
        assert!(found.len() >= before, "cut at {len}: a byte more, and fewer messages");
        assert_eq!(report.was_closed, len == bytes.len());
        before = found.len();
    }
    assert_eq!(before, all.len());
}

/// A closed file with a chunk for each ten messages, since a mark is behind them.
fn file_of_chunks(folder: &Path, all: &[Said]) -> PathBuf {
    let mut writer = Writer::start(options(folder), session()).unwrap();
    for said in all.chunks(10) {
        said.iter().for_each(|one| one.write(&mut writer));
        writer.mark(Mark { time_ns: 1, epoch: 1, text: "ten".into() }).unwrap().wait(PATIENCE).unwrap().unwrap();
    }
    writer.finish().1.unwrap();
    folder.join("base-0001.mcap")
}

/// The last of these that are of a topic.
fn last_of(all: &[Said], topic: &str) -> Option<LastMessage> {
    let Said { epoch, stamp_ns, sequence, data, .. } = all.iter().rfind(|said| said.topic == topic)?.clone();
    Some(LastMessage { epoch, stamp_ns, sequence, data })
}

#[test]
fn the_last_message_of_a_file_cut_at_any_byte_is_that_which_is_recovered() {
    let folder = memory_folder();
    // The last channel has two messages, far from the end, and so has the second epoch of another.
    let mut all = said(90, 40);
    for said in &mut all[30..] {
        said.topic = said.topic.replace("laser.2", "laser.1");
    }
    for said in all[60..].iter_mut().filter(|said| said.topic == "laser.0/scan") {
        said.epoch = 2;
    }
    let path = file_of_chunks(folder.path(), &all);
    let bytes = std::fs::read(&path).unwrap();
    let cut = folder.path().join("cut.mcap");
    let mut found = 0;
    for len in (mcap::MAGIC.len()..=bytes.len()).rev() {
        std::fs::write(&cut, &bytes[..len]).unwrap();
        let whole = read(&cut).0;
        for topic in ["laser.0/scan", "laser.1/scan", "laser.2/scan", "laser.3/scan"] {
            let last = last_message(&cut, topic).unwrap();
            assert_eq!(last, last_of(&whole, topic), "{topic}, cut at {len}");
            found += usize::from(last.is_some());
        }
    }
    assert!(found > 1_000, "{found}");
    assert!(last_message(&folder.path().join("none.mcap"), "laser.0/scan").is_err());
}

#[test]
fn of_a_chunk_that_is_cut_what_is_there_is_taken() {
    let folder = memory_folder();
    let all = said(900, 1_000);
    let bytes = std::fs::read(file_of(folder.path(), "base", &all)).unwrap();
    // Most of the bytes are those of one chunk.
    let (report, found) = recovered(folder.path(), &bytes[..bytes.len() / 2]);
    assert_eq!(found, all[..found.len()]);
    assert!(found.len() > 300, "{}", found.len());
    assert_eq!(report.unchecked, found.len() as u64);
    assert_eq!(report.damage_count, 1);
}

#[test]
fn what_is_no_recording_is_told_and_nothing_is_made() {
    let folder = memory_folder();
    let path = folder.path().join("text.mcap");
    std::fs::write(&path, "no recording at all").unwrap();
    let to = recovered_path(&path);
    let error = recover(&path, &to, &mut |_, _| {}).unwrap_err();
    assert!(matches!(error, RecoverError::Read(ReadError::NotMcap { .. })), "{error}");
    assert!(!to.exists());
    let error = recover(&folder.path().join("none.mcap"), &to, &mut |_, _| {}).unwrap_err();
    assert!(matches!(error, RecoverError::Read(ReadError::Io { .. })), "{error}");
    let pipe = folder.path().join("pipe.mcap");
    nix::unistd::mkfifo(&pipe, nix::sys::stat::Mode::S_IRWXU).unwrap();
    let error = recover(&pipe, &to, &mut |_, _| {}).unwrap_err().to_string();
    assert!(error.contains("it is no regular file"), "a pipe is not waited for: {error}");
}

#[test]
fn what_is_recovered_overwrites_nothing() {
    let folder = memory_folder();
    let path = file_of(folder.path(), "base", &said(3, 10));
    let to = recovered_path(&path);
    assert_eq!(to, folder.path().join("base-0001.recovered.mcap"));
    recover(&path, &to, &mut |_, _| {}).unwrap();
    let error = recover(&path, &to, &mut |_, _| {}).unwrap_err();
    assert_eq!(error.existing().map(|shown| shown.0.clone()), Some(to));
}

#[test]
fn no_file_of_a_user_is_taken_for_a_temporary_one() {
    let folder = memory_folder();
    let path = file_of(folder.path(), "base", &said(3, 10));
    let to = folder.path().join("new.mcap");
    let parts = ["new.mcap.part", "new.mcap.2.part"].map(|name| folder.path().join(name));
    let files = || std::fs::read_dir(folder.path()).unwrap().count();
    std::fs::write(&parts[0], "a user's").unwrap();
    std::os::unix::fs::symlink(&parts[0], &parts[1]).unwrap();
    let before = files();
    for what in ["recover", "cut", "merge"] {
        match what {
            "recover" => drop(recover(&path, &to, &mut |_, _| {}).unwrap()),
            "cut" => drop(cut(&path, &to, &Selection::default(), &mut |_, _| {}).unwrap()),
            _ => drop(merge(std::slice::from_ref(&path), &to, &mut |_, _| {}).unwrap()),
        }
        assert_eq!(std::fs::read_to_string(&parts[1]).unwrap(), "a user's", "{what}");
        assert_eq!(files(), before + 1, "{what} leaves the new file alone");
        std::fs::remove_file(&to).unwrap();
    }
}

#[test]
fn a_part_is_taken_by_time_and_name() {
    let folder = memory_folder();
    let all = said(3_000, 1_500);
    let path = file_of(folder.path(), "base", &all);
    let (from_ns, until_ns) = (all[1_000].arrival_ns, all[2_000].arrival_ns);
    for (names, why) in [
        (vec![], "all names"),
        (vec!["laser.1".to_owned()], "a name"),
        (vec!["laser.0/scan".to_owned(), "laser.2".to_owned()], "a topic and a name"),
    ] {
        let to = folder.path().join("part.mcap");
        let selection = Selection {
            from_ns: Some(from_ns),
            until_ns: Some(until_ns),
            names: names.clone(),
            ..Selection::default()
        };
        let (messages, bytes) = cut(&path, &to, &selection, &mut |_, _| {}).unwrap();
        let is_wanted = |said: &&Said| names.is_empty() || names.iter().any(|name| said.topic.starts_with(name));
        let wanted: Vec<Said> = all[1_000..2_000].iter().filter(is_wanted).cloned().collect();
        assert_eq!(read(&to), (wanted.clone(), 0), "{why}");
        let told = info(&to).unwrap();
        assert_eq!((told.messages, told.bytes), (messages, bytes), "{why}");
        assert_eq!(told.others[0].0, "rohrpost.cut");
        assert_eq!(told.session["node"], "base", "{why}");
        std::fs::remove_file(&to).unwrap();
    }
}

/// Whichever epochs its messages are of.
#[test]
fn a_part_in_which_nothing_came_begins_with_what_came_before_it() {
    let folder = memory_folder();
    for epochs in [[1, 1, 1], [1, 1, 2], [1, 2, 2]] {
        let mut all = said(3, 10);
        for (said, (arrival_ns, epoch)) in all.iter_mut().zip([1_000, 25_000, 26_000].into_iter().zip(epochs)) {
            *said = Said { topic: "laser.0/scan".into(), arrival_ns, stamp_ns: arrival_ns, epoch, ..said.clone() };
        }
        let path = file_of(folder.path(), &format!("{epochs:?}"), &all);
        let to = path.with_extension("part");
        let selection = Selection { from_ns: Some(10_000), until_ns: Some(20_000), ..Selection::default() };
        assert_eq!(cut(&path, &to, &selection, &mut |_, _| {}).unwrap().0, 0);
        let (mut reader, mut stamps) = (Reader::open(&to).unwrap(), Vec::new());
        while let Some((channel, message)) = reader.next().unwrap() {
            stamps.push((channel.is_repeated(), message.stamp_ns));
        }
        assert_eq!(stamps, [(true, 1_000)], "{epochs:?}");
    }
}

#[test]
fn a_part_that_cannot_be_is_explained() {
    let folder = memory_folder();
    let path = file_of(folder.path(), "base", &said(9, 10));
    let to = folder.path().join("part.mcap");
    let selection = Selection { names: vec!["lasr.0".into()], ..Selection::default() };
    let error = cut(&path, &to, &selection, &mut |_, _| {}).unwrap_err();
    assert_eq!(error.to_string(), "the recording has no `lasr.0`; it has laser.0/scan, laser.1/scan, laser.2/scan");
    let selection = Selection { from_ns: Some(5), until_ns: Some(5), ..Selection::default() };
    let error = cut(&path, &to, &selection, &mut |_, _| {}).unwrap_err();
    assert!(matches!(error, CutError::Select(SelectError::NoTime { from_ns: 5, until_ns: 5 })), "{error}");
    cut_off(&path, 1);
    let error = cut(&path, &to, &Selection::default(), &mut |_, _| {}).unwrap_err();
    assert!(matches!(&error, CutError::Select(SelectError::Read(ReadError::NotClosed { .. }))), "{error}");
    assert!(!to.exists());
    let error = cut(&path, &path, &Selection::default(), &mut |_, _| {}).unwrap_err();
    assert!(matches!(error, CutError::Select(_) | CutError::Rewrite(RewriteError::Exists(_))), "{error}");
}
