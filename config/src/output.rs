//! What the output service keeps, and from which level on.

use crate::directory::Directory;
use crate::reader::Section;
use rohrpost_mailbox::Name;
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

/// The section `[output]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Output {
    /// Lines less important than this are not sent.
    pub level: Level,
    /// Modules with a level of their own.
    pub levels: Vec<(Name, Level)>,
    /// Lines that the output module keeps in memory.
    pub ring: u32,
    /// File that lines are written to as well, from the configuration file's folder.
    pub file: Option<PathBuf>,
}

impl Default for Output {
    fn default() -> Self {
        Self { level: Level::Info, levels: Vec::new(), ring: 1000, file: None }
    }
}

impl Level {
    /// The word that the file uses.
    pub fn as_str(self) -> &'static str {
        LEVELS[self as usize].0
    }
}

impl Output {
    /// The level of a module: its own, or the common one.
    pub fn level_of(&self, module: Name) -> Level {
        self.levels.iter().find(|(name, _)| *name == module.module()).map_or(self.level, |(_, level)| *level)
    }

    pub(crate) fn read(section: Option<Section<'_>>, directory: &Directory<'_>, folder: &Path) -> Self {
        let mut output = Self::default();
        let Some(section) = section else { return output };
        let level = section.get("level").and_then(|item| item.choice(&LEVELS));
        output.level = level.unwrap_or(output.level);
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
        let ring = section.get("ring").and_then(|item| item.whole(1..=1_000_000, 1000));
        output.ring = ring.map_or(output.ring, |ring| ring as u32);
        output.file = section.get("file").and_then(|item| item.text("robot.log")).map(|file| folder.join(file));
        section.finish();
        output
    }
}
