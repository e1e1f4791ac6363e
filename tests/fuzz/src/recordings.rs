//! Files of recordings, ours and others': described, read, recovered, cut, merged and drawn, or what is wrong with
//! them.

use rohrpost_recording::{DrawOptions, Reader, Selection, cut, draw, info, merge, recover};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A time in the middle of the recordings of the corpus, ns.
const LATER_NS: u64 = 1_000;

/// A folder for one input.
struct Files {
    folder: TempDir,
    path: PathBuf,
}

impl Files {
    fn new(data: &[u8]) -> Self {
        let folder = tempfile::tempdir().expect("a folder can be made");
        let path = folder.path().join("in.mcap");
        std::fs::write(&path, data).expect("a file can be written");
        Self { folder, path }
    }

    fn to(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// What was made is whole, has what was told, and nothing else is left.
    fn check(&self, to: &Path, messages: u64, bytes: u64) {
        let told = info(to).unwrap_or_else(|error| panic!("{}: {error}", to.display()));
        assert!(told.is_closed && told.damages.is_empty(), "{told:?}");
        assert_eq!((told.messages, told.bytes), (messages, bytes), "{}", to.display());
        std::fs::remove_file(to).expect("it is there");
        self.check_nothing_left();
    }

    fn check_nothing_left(&self) {
        let left = std::fs::read_dir(self.folder.path()).expect("the folder is there").count();
        assert_eq!(left, 1, "something is left beside the input");
    }
}

pub(crate) fn run(data: &[u8]) {
    let files = Files::new(data);
    described(&files.path);
    read(&files.path);
    let to = files.to("recovered.mcap");
    match recover(&files.path, &to, &mut |_, _| {}) {
        Ok(told) => files.check(&to, told.messages, told.bytes),
        Err(error) => refused(&files, &error),
    }
    // From the first bytes, so that ranges are tried, too.
    let from_ns = data.get(..9).map(|_| u64::from(data[8] & 7));
    for selection in [Selection::default(), Selection { from_ns, period_ns: Some(1_000), ..Selection::default() }] {
        let to = files.to("part.mcap");
        match cut(&files.path, &to, &selection, &mut |_, _| {}) {
            Ok((messages, bytes)) => files.check(&to, messages, bytes),
            Err(error) => refused(&files, &error),
        }
        let to = files.to("drawn.mcap");
        let options = DrawOptions { with_original: data.len().is_multiple_of(2), ..DrawOptions::default() };
        match draw(&files.path, &to, &selection, &options, &mut |_, _| {}) {
            Ok(told) => files.check(&to, told.messages, told.bytes),
            Err(error) => refused(&files, &error),
        }
    }
    let to = files.to("merged.mcap");
    match merge(&[files.path.clone(), files.path.clone()], &to, &mut |_, _| {}) {
        Ok((messages, bytes)) => files.check(&to, messages, bytes),
        Err(error) => refused(&files, &error),
    }
}

fn described(path: &Path) {
    match info(path) {
        Ok(told) => {
            let counted = told.channels.iter().fold(0_u64, |sum, channel| sum.saturating_add(channel.messages));
            assert!(counted <= told.messages, "{told:?}");
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}

fn read(path: &Path) {
    let Ok(mut reader) = Reader::open(path) else { return };
    while let Ok(Some((channel, message))) = reader.next() {
        assert!(message.data.len() <= rohrpost_recording::format::RECORD_BYTES_MAX);
        let _ = channel.ty.as_ref().map(|ty| rohrpost_modules::schema::decode(ty, message.data));
    }
    if let Ok(true) = reader.seek(LATER_NS) {
        assert!(reader.next().is_ok_and(|found| found.is_some_and(|(_, message)| message.arrival_ns >= LATER_NS)));
    }
}

fn refused(files: &Files, error: &dyn std::fmt::Display) {
    assert!(!error.to_string().is_empty());
    files.check_nothing_left();
}
