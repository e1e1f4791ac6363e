//! Journals of modules: pieces in a recording, and runs that are to be repeated. What is read of them is text by text
//! the same as what was written, or an error in words.

use rohrpost_modules::journal::{ExactRun, Piece};

pub(crate) fn run(data: &[u8]) {
    let Some((which, body)) = data.split_first() else { return };
    match which % 3 {
        0 => piece(body),
        1 => begin(&exact(body)),
        _ => drop(postcard::from_bytes::<ExactRun>(body).map(|run| begin(&run))),
    }
}

fn piece(body: &[u8]) {
    let Some(piece) = Piece::read(body) else { return };
    let mut record = vec![0; body.len() + 16];
    let len = piece.write(&mut record);
    assert_eq!(Piece::read(&record[..len]), Some(piece));
}

fn exact(journal: &[u8]) -> ExactRun {
    ExactRun { folder: None, report: String::new(), ends: None, journal: journal.to_vec().into() }
}

fn begin(run: &ExactRun) {
    match run.installation() {
        Ok((installation, name)) => assert!(name.is_mailbox() && !installation.modules.is_empty()),
        Err(why) => assert!(!why.to_string().is_empty()),
    }
    for entry in run.entries() {
        assert!(!entry.is_empty() && entry.len() < 4096 + 64 * run.journal.len(), "{}", entry.len());
    }
}
