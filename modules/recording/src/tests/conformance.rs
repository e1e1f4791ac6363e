//! The conformance files of the format's makers, where they lie: each is read, and nothing of it is lost in what is
//! made of it.

use super::features::made_of;
use super::support::memory_folder;
use crate::reader::Reader;
use crate::{Info, info};
use std::path::Path;
use std::process::Command;

/// Beside the project.
const ARCHIVE: &str = "../../../shared/data/mcap-conformance.tgz";
const FILES: usize = 416;

/// Messages, attachments, and metadata of others.
fn counts(told: &Info) -> (u64, usize, usize) {
    let theirs = told.others.iter().filter(|(name, _)| name == "myMetadata").count();
    (told.messages, told.attachments.len(), theirs)
}

#[test]
fn conformance_files_of_the_format_are_read_and_kept() {
    let archive = Path::new(env!("CARGO_MANIFEST_DIR")).join(ARCHIVE);
    if !archive.exists() {
        return rohrpost_test_report::skipped("conformance files of MCAP, which do not lie beside the project");
    }
    let folder = memory_folder();
    let told = Command::new("tar").arg("xzf").arg(&archive).arg("-C").arg(folder.path()).status().unwrap();
    assert!(told.success());
    let mut files = 0;
    for entry in std::fs::read_dir(folder.path().join("conf")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        let wanted = match name.split('-').next().unwrap() {
            "NoData" => (0, 0, 0),
            "OneMessage" | "OneSchemalessMessage" => (1, 0, 0),
            "TenMessages" => (10, 0, 0),
            "OneAttachment" => (0, 1, 0),
            "OneMetadata" => (0, 0, 1),
            other => panic!("{other}"),
        };
        let told = info(&path).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!((counts(&told), told.is_closed, told.damage_count), (wanted, true, 0), "{name}");
        let mut reader = Reader::to_play(&path).unwrap();
        let mut played = 0;
        while reader.next().unwrap_or_else(|error| panic!("{name}: {error}")).is_some() {
            played += 1;
        }
        assert!(played == wanted.0 && reader.is_closed(), "{name}: {played}");
        let to = memory_folder();
        for (made, times) in made_of(&path, to.path(), &name).into_iter().zip([1, 2, 1]) {
            let told = info(&made).unwrap_or_else(|error| panic!("{name}, {}: {error}", made.display()));
            let wanted = (wanted.0 * times as u64, wanted.1 * times, wanted.2 * times);
            assert_eq!((counts(&told), told.is_closed, told.profile.as_str()), (wanted, true, ""), "{name}");
        }
        files += 1;
    }
    assert_eq!(files, FILES);
}
