//! Copies of sources, changed.

use crate::Edit;
use std::fs;
use std::path::Path;

/// Copies the files of a folder and of those in it, changed, in place of what was copied there before; returns their
/// paths within it, in order.
///
/// # Errors
/// What cannot be read, written or changed.
pub fn copied(
    folder: &Path,
    to: &Path,
    change: impl Fn(&str, String) -> Result<String, String>,
) -> Result<Vec<String>, String> {
    let failed = |error: std::io::Error| format!("{}: {error}", folder.display());
    // A file that has moved is not left where it was.
    let _ = fs::remove_dir_all(to);
    let (mut files, mut folders) = (Vec::new(), vec![String::new()]);
    while let Some(inner) = folders.pop() {
        fs::create_dir_all(to.join(&inner)).map_err(failed)?;
        for entry in fs::read_dir(folder.join(&inner)).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            let name = format!("{inner}{}", entry.file_name().to_string_lossy());
            if entry.path().is_dir() {
                folders.push(name + "/");
                continue;
            }
            let text = change(&name, fs::read_to_string(entry.path()).map_err(failed)?)?;
            fs::write(to.join(&name), text).map_err(failed)?;
            files.push(name);
        }
    }
    files.sort();
    Ok(files)
}

/// Copies `sources` with all mistakes planted in it, each a name and its edits; then `finish` changes each file.
///
/// # Errors
/// As [`copied`]. An edit that does not ask whether its mistake is made, which would change the healthy copy as well.
/// One of a file that is gone.
pub fn planted(
    sources: &Path,
    to: &Path,
    mistakes: &[(&str, &[Edit])],
    finish: impl Fn(&str, String) -> String,
) -> Result<(), String> {
    for (mistake, edits) in mistakes {
        let asks = format!("broken!({mistake})");
        if edits.is_empty() || edits.iter().any(|edit| !edit.to(mistake).contains(&asks)) {
            return Err(format!("each edit of {mistake} must ask `{asks}`"));
        }
        if let Some(edit) = edits.iter().find(|edit| !sources.join(edit.file).is_file()) {
            return Err(format!("{} is gone; {mistake} is planted there", edit.file));
        }
    }
    let all = || mistakes.iter().flat_map(|(mistake, edits)| edits.iter().map(move |edit| (mistake, edit)));
    let edited = |file: &str, text: String| {
        let mut edits = all().filter(|(_, edit)| edit.file == file);
        edits.try_fold(text, |text, (mistake, edit)| edit.apply(mistake, &text)).map(|text| finish(file, text))
    };
    copied(sources, to, edited).map(drop)
}

/// The text of a `lib.rs` to be included, which has no comment and no attribute of its own.
pub fn without_inner_lines(text: &str) -> String {
    let is_inner = |line: &&str| line.starts_with("//!") || line.starts_with("#![");
    text.lines().filter(|line| !is_inner(line)).map(|line| format!("{line}\n")).collect()
}
