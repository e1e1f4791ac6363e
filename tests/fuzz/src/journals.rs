//! Journals of modules: pieces in a recording, and runs that are to be repeated. What is read of them is text by text
//! the same as what was written, or an error in words.

use rohrpost_modules::journal::{ExactRun, Piece};
use std::io::Write;
use std::path::Path;

pub(crate) fn run(data: &[u8]) {
    let Some((which, body)) = data.split_first() else { return };
    match which % 3 {
        0 => piece(body),
        1 => begin(body),
        _ => drop(postcard::from_bytes::<ExactRun>(body).map(|run| assert!(postcard::to_stdvec(&run).is_ok()))),
    }
}

fn piece(body: &[u8]) {
    let Some(piece) = Piece::read(body) else { return };
    let mut record = vec![0; body.len() + 16];
    let len = piece.write(&mut record);
    assert_eq!(Piece::read(&record[..len]), Some(piece));
}

fn begin(journal: &[u8]) {
    let folder = Path::new("/dev/shm");
    let Ok(mut file) = tempfile::NamedTempFile::new_in(folder) else { return };
    file.write_all(journal).expect("the journal's file takes it");
    let path = file.path().display().to_string();
    let run = ExactRun { folder: None, report: String::new(), ends: None, journal: path, records: None };
    match run.installation() {
        Ok((installation, name)) => assert!(name.is_mailbox() && !installation.modules.is_empty()),
        Err(why) => assert!(!why.to_string().is_empty()),
    }
    let mut told = 0;
    let each = run.each_entry(|entry| {
        assert!(!entry.is_empty() && entry.len() < 4096 + 64 * journal.len(), "{}", entry.len());
        told += 1;
        true
    });
    // The shortest entry has 13 bytes; what is damaged behind the last one is told, too.
    assert!(each.is_ok() && told <= 1 + journal.len() / 13, "{told} entries");
}
