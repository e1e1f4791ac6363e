//! The manifest: which files a bundle has, for which installation, in which version.

use crate::digest::Sha256;
use crate::path::{FilePath, PathError, is_plain};
use rohrpost_config::{duration_text, parse_duration};
use serde::Deserialize;
use std::collections::BTreeSet;
use std::time::Duration;

/// Version of the manifest's form.
const FORMAT: u32 = 1;
/// Bytes of a manifest.
pub(crate) const MANIFEST_BYTES_MAX: usize = 4 << 20;
/// Files of a bundle.
const FILES_MAX: usize = 20_000;
/// Bytes of a bundle's files together.
const SIZE_MAX: u64 = 1 << 40;
/// Longest trial.
pub const TRIAL_MAX: Duration = Duration::from_secs(24 * 3600);
/// First line of a manifest.
const PREAMBLE: &str = "# A bundle of Rohrpost: all files that nodes run. `rohrpost bundle show` checks them.\n";

/// One file of a bundle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileEntry {
    /// Path in the bundle.
    pub path: FilePath,
    /// Length, bytes.
    pub size: u64,
    /// Digest of its content.
    pub sha256: Sha256,
    /// Whether it is a program.
    pub executable: bool,
}

/// Content of a manifest. It exists only if everything in it is right.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Manifest {
    installation: String,
    version: u64,
    trial: Duration,
    configuration: FilePath,
    files: Vec<FileEntry>,
}

/// Why bytes are no manifest.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ManifestError {
    /// Too many bytes.
    #[error("it has more than {MANIFEST_BYTES_MAX} bytes")]
    TooLong,
    /// No TOML of this form.
    #[error("line {line}: {why}")]
    Syntax {
        /// Counted from 1.
        line: usize,
        /// What the parser says.
        why: String,
    },
    /// Another form.
    #[error("its format is {0}, and this rohrpost reads format {FORMAT}; use a newer rohrpost")]
    Format(u32),
    /// A right manifest in another spelling.
    #[error("line {0} is not written as `rohrpost bundle make` writes it; make the bundle anew")]
    NotCanonical(usize),
    /// A path.
    #[error(transparent)]
    Path(#[from] PathError),
    /// A value.
    #[error("{0}")]
    Value(String),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawManifest {
    format: u32,
    installation: String,
    version: u64,
    trial: String,
    configuration: String,
    #[serde(rename = "file")]
    files: Vec<RawFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFile {
    path: String,
    size: u64,
    sha256: String,
    #[serde(default)]
    executable: bool,
}

impl Manifest {
    /// Puts a manifest together. Files may come in any order.
    ///
    /// # Errors
    /// A name or number out of its range, a path twice, a path that is both file and folder, a configuration that is no
    /// file of the bundle.
    pub fn new(
        installation: &str,
        version: u64,
        trial: Duration,
        configuration: FilePath,
        mut files: Vec<FileEntry>,
    ) -> Result<Self, ManifestError> {
        files.sort_by(|a, b| a.path.cmp(&b.path));
        let manifest = Self { installation: installation.to_owned(), version, trial, configuration, files };
        manifest.mistake().map_or(Ok(manifest), |why| Err(ManifestError::Value(why)))
    }

    /// Reads a manifest.
    ///
    /// # Errors
    /// Everything but what [`text`](Self::text) writes.
    pub fn parse(bytes: &[u8]) -> Result<Self, ManifestError> {
        if bytes.len() > MANIFEST_BYTES_MAX {
            return Err(ManifestError::TooLong);
        }
        let text = std::str::from_utf8(bytes).map_err(|error| ManifestError::Syntax {
            line: line_at(bytes, error.valid_up_to()),
            why: "it is no text in UTF-8".into(),
        })?;
        let raw: RawManifest = toml::from_str(text).map_err(|error| ManifestError::Syntax {
            line: line_at(bytes, error.span().map_or(0, |span| span.start)),
            // Keys of a stranger may be in it.
            why: error.message().replace(char::is_control, " "),
        })?;
        if raw.format != FORMAT {
            return Err(ManifestError::Format(raw.format));
        }
        let trial = parse_duration(&raw.trial).map_err(|error| ManifestError::Value(format!("trial: {error}")))?;
        let files = raw.files.into_iter().map(RawFile::read).collect::<Result<_, _>>()?;
        let configuration = FilePath::parse(&raw.configuration)?;
        let manifest = Self::new(&raw.installation, raw.version, trial, configuration, files)?;
        let written = manifest.text();
        let differs = |(a, b): (&u8, &u8)| a != b;
        match bytes.iter().zip(written.as_bytes()).position(differs) {
            None if bytes.len() == written.len() => Ok(manifest),
            at => Err(ManifestError::NotCanonical(line_at(bytes, at.unwrap_or(bytes.len().min(written.len()))))),
        }
    }

    /// The canonical text.
    pub fn text(&self) -> String {
        let Self { installation, version, configuration, .. } = self;
        let trial = duration_text(self.trial);
        let mut text = format!(
            "{PREAMBLE}format = {FORMAT}\ninstallation = \"{installation}\"\nversion = {version}\ntrial = \
             \"{trial}\"\nconfiguration = \"{configuration}\"\n"
        );
        for FileEntry { path, size, sha256, executable } in &self.files {
            text += &format!("\n[[file]]\npath = \"{path}\"\nsize = {size}\nsha256 = \"{sha256}\"\n");
            text += if *executable { "executable = true\n" } else { "" };
        }
        text
    }

    /// Name of the installation.
    pub fn installation(&self) -> &str {
        &self.installation
    }

    /// Version: a later bundle has a higher one.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// How long all modules must stay up, until a node keeps the bundle.
    pub fn trial(&self) -> Duration {
        self.trial
    }

    /// The file that launch is given.
    pub fn configuration(&self) -> &FilePath {
        &self.configuration
    }

    /// All files, in the order of their paths.
    pub fn files(&self) -> &[FileEntry] {
        &self.files
    }

    /// Bytes of all files.
    pub fn size(&self) -> u64 {
        self.files.iter().map(|file| file.size).sum()
    }

    fn mistake(&self) -> Option<String> {
        let name = &self.installation;
        if name.is_empty() || name.len() > 100 || !name.chars().all(is_plain) || name.contains('/') {
            return Some("installation: no name of an installation, such as \"robot\"".into());
        }
        if !(1..=i64::MAX as u64).contains(&self.version) {
            return Some(format!("version: {} is not in 1 to {}", self.version, i64::MAX));
        }
        if self.trial.is_zero() || self.trial > TRIAL_MAX {
            return Some(format!("trial: longer than 0 s and at most {} is right", duration_text(TRIAL_MAX)));
        }
        if self.files.len() > FILES_MAX {
            return Some(format!("{} files; a bundle has at most {FILES_MAX}", self.files.len()));
        }
        let total = self.files.iter().try_fold(0_u64, |sum, file| sum.checked_add(file.size));
        if total.is_none_or(|total| total > SIZE_MAX) {
            return Some(format!("its files have more than {SIZE_MAX} bytes together"));
        }
        if let Some(two) = self.files.windows(2).find(|two| two[0].path == two[1].path) {
            return Some(format!("`{}` is there twice", two[0].path));
        }
        let paths: BTreeSet<&str> = self.files.iter().map(|file| file.path.as_str()).collect();
        let folders = self.files.iter().flat_map(|file| file.path.folders());
        if let Some(both) = folders.into_iter().find(|folder| paths.contains(folder)) {
            return Some(format!("`{both}` is a file and a folder of others"));
        }
        let is_missing = !paths.contains(self.configuration.as_str());
        is_missing.then(|| format!("configuration: `{}` is no file of the bundle", self.configuration))
    }
}

impl RawFile {
    fn read(self) -> Result<FileEntry, ManifestError> {
        let path = FilePath::parse(&self.path)?;
        let sha256 = Sha256::parse(&self.sha256)
            .ok_or_else(|| ManifestError::Value(format!("sha256 of `{path}`: 64 digits of 0-9 and a-f are right")))?;
        Ok(FileEntry { path, size: self.size, sha256, executable: self.executable })
    }
}

/// Line of a byte, counted from 1.
fn line_at(bytes: &[u8], at: usize) -> usize {
    let text = bytes.get(..at).unwrap_or(bytes);
    let lines = bytes.iter().filter(|byte| **byte == b'\n').count() + usize::from(bytes.last() != Some(&b'\n'));
    (1 + text.iter().filter(|byte| **byte == b'\n').count()).min(lines.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(path: &str) -> FileEntry {
        let path = FilePath::parse(path).unwrap();
        FileEntry { path, size: 5, sha256: Sha256::of(b"hello"), executable: false }
    }

    fn manifest(paths: &[&str]) -> Result<Manifest, ManifestError> {
        let configuration = FilePath::parse("robot.toml").unwrap();
        let files = paths.iter().map(|path| file(path)).collect();
        Manifest::new("test", 7, Duration::from_secs(30), configuration, files)
    }

    #[test]
    fn what_is_written_is_all_that_is_read() {
        let mut files = vec![file("robot.toml"), file("bin/pilot"), file("Büro.map")];
        files[1].executable = true;
        let configuration = FilePath::parse("robot.toml").unwrap();
        let manifest = Manifest::new("test", 7, Duration::from_millis(1500), configuration, files).unwrap();
        let text = manifest.text();
        assert_eq!(Manifest::parse(text.as_bytes()).as_ref(), Ok(&manifest));
        let digest = Sha256::of(b"hello").to_string();
        for (from, to, why) in [
            ("version = 7", "version = 07", "line 4: "),
            ("version = 7", "version = 0x7", "line 4 is not written as"),
            ("version = 7", "version = 0", "version: 0 is not in 1"),
            ("version = 7", "version = -7", "line 4: "),
            ("version = 7", "version = 99999999999999999999", "line 4: "),
            ("version = 7", "version = 7\nversion = 8", "line 5: duplicate key"),
            ("format = 1", "format = 2", "its format is 2"),
            ("format = 1\n", "", "missing field `format`"),
            ("1500 ms", "1.5 s", "line 5 is not written as"),
            ("1500 ms", "0 s", "trial: longer than 0 s"),
            ("1500 ms", "25 h", "at most 24 h"),
            ("\"test\"", "\"te/st\"", "installation: no name"),
            ("\"test\"", "'test'", "line 3 is not written as"),
            ("\n[[file]]", "\n\n[[file]]", "line 8 is not written as"),
            ("path = \"bin/pilot\"", "path = \"../pilot\"", "`../pilot` is no path in a bundle: it leads out"),
            ("path = \"bin/pilot\"", "path = \"/bin/pilot\"", "it is absolute"),
            ("path = \"bin/pilot\"", "path = \"robot.toml\"", "`robot.toml` is there twice"),
            ("path = \"bin/pilot\"", "path = \"robot.toml/x\"", "`robot.toml` is a file and a folder"),
            ("path = \"bin/pilot\"", "path = \"zzz\"", "is not written as"),
            ("path = \"robot.toml\"", "path = \"robot\"", "configuration: `robot.toml` is no file"),
            ("size = 5", "size = 1099511627777", "more than 1099511627776 bytes"),
            ("size = 5", "size = 9223372036854775807", "more than 1099511627776 bytes"),
            ("executable = true", "executable = false", "is not written as"),
            ("executable = true", "owner = \"root\"", "unknown field `owner`"),
            (&digest, "00", "64 digits"),
            (&digest, &digest.to_uppercase(), "64 digits"),
        ] {
            assert!(text.contains(from), "{from}");
            let said = Manifest::parse(text.replacen(from, to, 1).as_bytes()).unwrap_err().to_string();
            assert!(said.contains(why), "{from} -> {to}: {said}");
        }
        for cut in 0..text.len() {
            assert!(Manifest::parse(&text.as_bytes()[..cut]).is_err(), "{cut} bytes");
        }
        for more in ["\n", "#", " "] {
            assert!(Manifest::parse((text.clone() + more).as_bytes()).is_err());
        }
        assert_eq!(Manifest::parse(&vec![b'#'; MANIFEST_BYTES_MAX + 1]), Err(ManifestError::TooLong));
        assert!(Manifest::parse(b"a = \"\xff\"").unwrap_err().to_string().contains("line 1: it is no text in UTF-8"));
    }

    #[test]
    fn a_flipped_bit_is_another_manifest_or_none() {
        let manifest = manifest(&["robot.toml", "a"]).unwrap();
        let text = manifest.text().into_bytes();
        for (at, bit) in (0..text.len()).flat_map(|at| (0..8).map(move |bit| (at, bit))) {
            let mut flipped = text.clone();
            flipped[at] ^= 1 << bit;
            assert_ne!(Manifest::parse(&flipped).as_ref(), Ok(&manifest), "byte {at}, bit {bit}");
        }
    }

    #[test]
    fn there_are_not_too_many_files() {
        let names: Vec<String> = (0..FILES_MAX).map(|number| format!("f{number}")).collect();
        let mut names: Vec<&str> = names.iter().map(String::as_str).collect();
        names[0] = "robot.toml";
        let largest = manifest(&names).unwrap();
        assert!(largest.text().len() < MANIFEST_BYTES_MAX && largest.size() == 5 * FILES_MAX as u64);
        names.push("one-more");
        assert!(manifest(&names).unwrap_err().to_string().contains("at most 20000"));
    }
}
