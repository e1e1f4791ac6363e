//! Settings of the output service: what it keeps, and from which level on.

use crate::directory::Directory;
use crate::reader::{Item, Section};
use rohrpost_mailbox::Name;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

/// Importance of an output line, most important first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Level {
    /// Something failed.
    Error,
    /// Something is wrong, and work goes on.
    Warn,
    /// What a user wants to know.
    Info,
    /// What a developer wants to know.
    Debug,
    /// Everything.
    Trace,
}

const LEVELS: [(&str, Level); 5] = [
    ("error", Level::Error),
    ("warn", Level::Warn),
    ("info", Level::Info),
    ("debug", Level::Debug),
    ("trace", Level::Trace),
];

/// How a line stands in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineFormat {
    /// For people.
    Text,
    /// For programs: a JSON object.
    Json,
}

/// A smaller file would hold only a few lines.
const FILE_SIZE: RangeInclusive<u64> = 4096..=1 << 40;
const FORMATS: [(&str, LineFormat); 2] = [("text", LineFormat::Text), ("json", LineFormat::Json)];

/// The section `[output]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Output {
    /// Lines less important than this are not sent.
    pub level: Level,
    /// Modules with a level of their own.
    pub levels: Vec<(Name, Level)>,
    /// Lines a second that a module may send; those of level error are counted separately.
    pub rate: u32,
    /// Lines that a module which was silent before may send at once.
    pub burst: u32,
    /// Lines that the output module keeps in memory.
    pub ring: u32,
    /// File that lines are written to as well, from the configuration file's folder.
    pub file: Option<PathBuf>,
    /// Size at which the file is rotated.
    pub file_size: u64,
    /// Rotated files that are kept.
    pub files: u32,
    /// How lines stand in the file.
    pub format: LineFormat,
    /// Whether lines go to the system's journal as well.
    pub journal: bool,
}

impl Default for Output {
    fn default() -> Self {
        Self {
            level: Level::Info,
            levels: Vec::new(),
            rate: 100,
            burst: 200,
            ring: 1000,
            file: None,
            file_size: 10 << 20,
            files: 4,
            format: LineFormat::Text,
            journal: false,
        }
    }
}

impl Level {
    /// The word that the file uses.
    pub fn as_str(self) -> &'static str {
        LEVELS[self as usize].0
    }

    /// The level that a word of the file is.
    pub(crate) fn from_word(word: &str) -> Option<Self> {
        LEVELS.iter().find(|(known, _)| *known == word).map(|(_, level)| *level)
    }
}

impl Output {
    pub(crate) fn read(section: Option<Section<'_>>, directory: &Directory<'_>, folder: &Path) -> Self {
        let mut output = Self::default();
        let Some(section) = section else { return output };
        output.level = section.or("level", output.level, |item| item.choice(&LEVELS));
        if let Some(levels) = section.section("levels", "[output] levels") {
            for item in levels.entries() {
                let level = item.choice(&LEVELS);
                match directory.find(&item.key) {
                    Ok(name) => output.levels.extend(level.map(|level| (name, level))),
                    Err(unknown) => {
                        item.report(format!("`{}` names no module; {}", item.key, unknown.or("drop it from `levels`")));
                    }
                }
            }
        }
        output.rate = section.whole_or("rate", 1..=1_000_000, output.rate);
        output.burst = section.whole_or("burst", 1..=100_000, output.burst);
        output.ring = section.whole_or("ring", 1..=1_000_000, output.ring);
        output.file = section.get("file").and_then(|item| item.text("robot.log")).map(|file| folder.join(file));
        output.read_file_keys(&section);
        output.journal = section.or("journal", false, Item::flag);
        section.finish();
        output
    }

    /// Keys of the file have no meaning without one.
    fn read_file_keys(&mut self, section: &Section<'_>) {
        let keys = ["file-size", "files", "format"];
        if self.file.is_none() && section.get("file").is_none() {
            for item in keys.into_iter().filter_map(|key| section.get(key)) {
                item.report(format!("`{}` is about a file, and there is none; add `file = \"robot.log\"`", item.key));
            }
        }
        self.file_size = section.or("file-size", self.file_size, |item| item.size(FILE_SIZE, "10 MiB"));
        self.files = section.whole_or("files", 0..=1000, self.files);
        self.format = section.or("format", self.format, |item| item.choice(&FORMATS));
    }
}
