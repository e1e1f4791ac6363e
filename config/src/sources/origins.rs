//! Where the lines of a resolved text come from: written behind them, and read back.
//!
//! ```text
//! #@ robot.toml
//! #@ common.toml
//! installation = "seven" #@ robot.toml:2
//! [[module]] #@ common.toml:30
//! name = "laser.0" #@ common.toml:31
//! [module.settings] #@ common.toml:33
//! port = "/dev/ttyUSB1" #@ robot.toml:9 by $LASER_PORT
//! ```

use super::merge::{Place, Table, Value};
use std::path::{Path, PathBuf};

const MARK: &str = "#@ ";

/// Where the lines of a text come from; nothing of a text that no other files went into.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Origins {
    /// The configuration's own file, then the included ones, from its folder on.
    files: Vec<String>,
    /// Lines of the text that say where they come from, in their order.
    lines: Vec<(usize, Origin)>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct Origin {
    file: String,
    line: usize,
}

impl Origins {
    /// Reads them back.
    pub(crate) fn of(text: &str) -> Self {
        let files: Vec<String> = text.lines().map_while(|line| line.strip_prefix(MARK)).map(Into::into).collect();
        if files.is_empty() {
            return Self::default();
        }
        let origin = |(index, line): (usize, &str)| {
            let (_, said) = line.rsplit_once(MARK)?;
            let said = said.split_once(" by $").map_or(said, |(place, _)| place);
            let (file, line) = said.rsplit_once(':')?;
            Some((index + 1, Origin { file: file.into(), line: line.parse().ok()? }))
        };
        let lines = text.lines().enumerate().skip(files.len()).filter_map(origin).collect();
        Self { files, lines }
    }

    /// Included files, as paths from the configuration's folder on.
    pub(crate) fn included(&self) -> impl Iterator<Item = &Path> {
        self.files.iter().skip(1).map(Path::new)
    }

    /// File and line that a line of the text comes from; `path`: of the text.
    pub(crate) fn place(&self, path: &Path, line: usize) -> (PathBuf, usize) {
        // Values of several lines have their origin behind the last one.
        let found = self.lines.iter().find(|(at, _)| *at >= line).or(self.lines.last());
        let Some((at, origin)) = found else { return (path.to_owned(), line) };
        let file = if self.files.first() == Some(&origin.file) {
            path.to_owned()
        } else {
            path.parent().unwrap_or(Path::new("")).join(&origin.file)
        };
        (file, origin.line.saturating_sub(at.saturating_sub(line)).max(1))
    }

    /// A message with the lines that it names as lines of the files.
    pub(crate) fn told(&self, path: &Path, message: &str) -> String {
        if self.lines.is_empty() {
            return message.into();
        }
        let mut parts = message.split("line ");
        let mut told = parts.next().unwrap_or_default().to_owned();
        for part in parts {
            let digits = part.len() - part.trim_start_matches(|c: char| c.is_ascii_digit()).len();
            let (number, rest) = part.split_at(digits);
            told += "line ";
            told += &match number.parse() {
                Ok(number) => {
                    let (file, line) = self.place(path, number);
                    format!("{line} of {}{rest}", file.display())
                }
                Err(_) => part.to_owned(),
            };
        }
        told
    }
}

/// The text of a table, of which the values come from these files.
pub(super) fn write(table: &Table, files: &[String]) -> String {
    let mut text: String = files.iter().map(|file| format!("{MARK}{file}\n")).collect();
    Writer { files, text: &mut text }.entries(table, &mut Vec::new());
    text
}

struct Writer<'a> {
    files: &'a [String],
    text: &'a mut String,
}

impl Writer<'_> {
    /// Values first: behind a header all keys are of its table.
    fn entries(&mut self, table: &Table, way: &mut Vec<String>) {
        for (key, value) in &table.entries {
            if let Value::Plain(written) | Value::Table { written: Some(written), .. } = value {
                let by = written.variable.as_ref().map_or(String::new(), |name| format!(" by ${name}"));
                self.line(&format!("{} = {}", quoted(key), written.text), written.place, &by);
            }
        }
        for (key, value) in &table.entries {
            way.push(quoted(key));
            let name = way.join(".");
            match value {
                Value::Table { table, written: None } => {
                    self.line(&format!("[{name}]"), table.place, "");
                    self.entries(table, way);
                }
                Value::Tables(tables) => {
                    for table in tables {
                        self.line(&format!("[[{name}]]"), table.place, "");
                        self.entries(table, way);
                    }
                }
                Value::Plain(_) | Value::Table { .. } | Value::Conflict(_) => {}
            }
            way.pop();
        }
    }

    fn line(&mut self, line: &str, place: Place, by: &str) {
        let file = self.files.get(place.file).map(String::as_str).unwrap_or_default();
        *self.text += &format!("{line} {MARK}{file}:{}{by}\n", place.line);
    }
}

/// A key as TOML writes it.
fn quoted(key: &str) -> String {
    let is_bare = !key.is_empty() && key.chars().all(|c| c.is_ascii_alphanumeric() || c == '-' || c == '_');
    if is_bare { key.into() } else { toml::Value::String(key.into()).to_string() }
}
