//! Paths of files in a bundle: below its folder on every computer, and one line at a terminal.

use std::fmt;
use std::path::{Component, Path, PathBuf};

/// Bytes of a path.
const PATH_BYTES_MAX: usize = 512;
/// Bytes of one name in it, as file systems have it.
const NAME_BYTES_MAX: usize = 255;
/// Names in a bundle's folder that are not files of it.
const RESERVED: [&str; 2] = ["manifest.toml", "manifest.sig"];

/// Path of a file from the bundle's folder on, such as `config/robot.toml`.
///
/// ```
/// # use rohrpost_bundle::FilePath;
/// assert!(FilePath::parse("config/robot.toml").is_ok());
/// assert!(FilePath::parse("../robot.toml").is_err() && FilePath::parse("/etc/passwd").is_err());
/// ```
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FilePath(String);

/// Why a text is no path of a file in a bundle.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{}` is no path in a bundle: {why}", path.escape_debug())]
pub struct PathError {
    /// The text.
    pub path: String,
    /// What is wrong with it.
    pub why: &'static str,
}

impl FilePath {
    /// Checks a path.
    ///
    /// # Errors
    /// A path that is absolute, leads out of the folder, is not in its shortest form, is longer than 512 bytes, is that
    /// of the manifest or its signature, or has signs other than letters, digits, blanks and ASCII punctuation.
    pub fn parse(text: &str) -> Result<Self, PathError> {
        match mistake(text) {
            None => Ok(Self(text.to_owned())),
            Some(why) => Err(PathError { path: text.chars().take(PATH_BYTES_MAX).collect(), why }),
        }
    }

    /// The text.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// The path below a folder.
    pub fn below(&self, folder: &Path) -> PathBuf {
        folder.join(&self.0)
    }

    /// The folders above it, the nearest first: `a/b` and `a` of `a/b/c`.
    pub(crate) fn folders(&self) -> impl Iterator<Item = &str> {
        self.0.rmatch_indices('/').map(|(at, _)| &self.0[..at])
    }
}

impl fmt::Display for FilePath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

fn mistake(text: &str) -> Option<&'static str> {
    let names = || text.split('/');
    if text.is_empty() {
        Some("it is empty")
    } else if text.len() > PATH_BYTES_MAX {
        Some("it is longer than 512 bytes")
    } else if text.starts_with('/') {
        Some("it is absolute; it must begin in the bundle's folder")
    } else if names().any(|name| name == "..") {
        Some("it leads out of the bundle's folder (`..`)")
    } else if names().any(|name| name.is_empty() || name == ".") {
        Some("it has an empty name or `.` in it; leave that out")
    } else if names().any(|name| name.len() > NAME_BYTES_MAX) {
        Some("a name in it is longer than 255 bytes")
    } else if names().any(|name| name != name.trim()) {
        Some("a name in it begins or ends with a blank")
    } else if !text.chars().all(is_plain) {
        Some("it has signs other than letters, digits, blanks and ASCII punctuation without \" and \\")
    } else if names().next().is_some_and(|name| RESERVED.contains(&name)) {
        Some("the bundle itself has a file of this name")
    } else {
        None
    }
}

/// A path without `.` and `..`, as if none of its folders were a link.
pub fn lexical(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => drop(plain.pop()),
            part => plain.push(part),
        }
    }
    plain
}

/// Absolute spellings of a path: in the first no link is followed, in each further one those of one more name are.
pub(crate) fn spellings(path: &Path) -> impl Iterator<Item = PathBuf> {
    let path = std::path::absolute(path).unwrap_or_default();
    let names = path.components().count();
    (1..=names).filter_map(move |followed| {
        let followed: PathBuf = path.components().take(followed).collect();
        let rest = path.strip_prefix(&followed).ok()?;
        Some(lexical(&followed.canonicalize().ok()?.join(rest)))
    })
}

/// Neither invisible nor of a meaning in TOML's quotes.
pub(crate) fn is_plain(letter: char) -> bool {
    letter.is_alphanumeric() || letter == ' ' || letter.is_ascii_graphic() && !matches!(letter, '"' | '\\')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_stay_below_the_folder() {
        let long = format!("a/{}", "b".repeat(256));
        let deep = "a/".repeat(300) + "b";
        for (text, is_right) in [
            ("robot.toml", true),
            ("bin/pilot", true),
            ("Karten/Büro 2.map", true),
            (".hidden/..x", true),
            ("sub/manifest.toml", true),
            ("", false),
            ("/etc/passwd", false),
            ("..", false),
            ("a/../b", false),
            ("a/..", false),
            ("./a", false),
            ("a//b", false),
            ("a/", false),
            ("a\0b", false),
            ("a\nb", false),
            ("a\u{1b}[31m", false),
            ("a\u{202e}b", false),
            ("a\u{200b}b", false),
            ("a\"b", false),
            ("a\\b", false),
            (" a", false),
            ("a /b", false),
            ("manifest.toml", false),
            ("manifest.sig", false),
            ("manifest.sig/x", false),
            (&long, false),
            (&deep, false),
        ] {
            assert_eq!(FilePath::parse(text).is_ok(), is_right, "{text:?}");
        }
        let path = FilePath::parse("a/b/c").unwrap();
        assert_eq!(path.folders().collect::<Vec<_>>(), ["a/b", "a"]);
    }
}
