//! The files of a configuration: read, each once, and joined.

use super::merge::{FileText, Rule, Table, Value, Written};
use super::origins;
use crate::errors::{Errors, Problem};
use crate::line_ends::LineEnds;
use crate::reader::{Reader, Section};
use std::path::{Path, PathBuf};
use toml::de::DeTable;

/// Files of one configuration.
const FILES_MAX: usize = 64;

/// The key that names the files to be included.
pub(super) const INCLUDE: &str = "include";

/// A configuration's file and all that it includes.
pub(super) struct Sources {
    /// The first is the configuration.
    files: Vec<SourceFile>,
}

struct SourceFile {
    path: PathBuf,
    /// As messages name it.
    shown: PathBuf,
    text: String,
    table: Table,
    /// Which files it includes.
    includes: Vec<usize>,
}

impl Sources {
    pub(super) fn read(path: &Path) -> Result<Self, Errors> {
        let mut sources = Self { files: Vec::new() };
        let text = std::fs::read_to_string(path).map_err(|error| {
            let message = format!("cannot be read ({error}); name an installation's file, such as config/demo.toml");
            Errors::new(path, vec![Problem { line: None, message }])
        })?;
        sources.add(path.to_owned(), text, &mut Vec::new())?;
        Ok(sources)
    }

    /// Adds a file and those that it includes; `way`: the files that led to it.
    fn add(&mut self, shown: PathBuf, text: String, way: &mut Vec<PathBuf>) -> Result<usize, Errors> {
        let (index, path) = (self.files.len(), real(&shown));
        let lines = LineEnds::of(&text);
        let parsed = DeTable::parse(&text);
        // What is no TOML is told later, with the rest of its mistakes, if it is the only file.
        let (table, included) = match &parsed {
            Ok(document) => {
                let line = |at| lines.line(at);
                let table = FileText { text: &text, file: index, line: &line }.table(0, document.get_ref());
                (table, included(&text, document.get_ref(), &shown)?)
            }
            Err(_) if index == 0 => (Table::empty(), Vec::new()),
            Err(_) => return Err(syntax(&text, &shown)),
        };
        drop(parsed);
        way.push(path.clone());
        self.files.push(SourceFile { path, shown: shown.clone(), text, table, includes: Vec::new() });
        for (name, line) in included {
            let told = |message| Errors::new(&shown, vec![Problem { line: Some(line), message }]);
            let file = shown.parent().unwrap_or(Path::new("")).join(&name);
            let real = real(&file);
            if let Some(at) = way.iter().position(|before| *before == real) {
                let circle: Vec<String> =
                    way[at..].iter().chain([&real]).map(|path| file_name(path).to_owned()).collect();
                return Err(told(format!("`{name}` leads back to itself ({}); drop one", circle.join(" → "))));
            }
            let known = self.files.iter().position(|known| known.path == real);
            let found = match known {
                Some(known) => known,
                None if self.files.len() == FILES_MAX => {
                    return Err(told(format!("a configuration has at most {FILES_MAX} files; join some")));
                }
                None => {
                    let text = std::fs::read_to_string(&file).map_err(|error| {
                        told(format!("`{name}` cannot be read ({error}); write a path from this file's folder on"))
                    })?;
                    self.add(file, text, way)?
                }
            };
            self.files[index].includes.push(found);
        }
        way.pop();
        Ok(index)
    }

    pub(super) fn is_alone(&self) -> bool {
        self.files.len() == 1
    }

    /// What each file says itself.
    pub(super) fn tables(&self) -> impl Iterator<Item = &Table> {
        self.files.iter().map(|file| &file.table)
    }

    pub(super) fn into_text(self) -> String {
        self.files.into_iter().next().map(|file| file.text).unwrap_or_default()
    }

    /// All files as one table.
    pub(super) fn merged(&self) -> Result<Table, Errors> {
        let mut merged = self.merged_of(0);
        merged.entries.retain(|(key, _)| key != INCLUDE);
        let mut problems = Vec::new();
        self.conflicts(&merged, "", &mut problems);
        if problems.is_empty() { Ok(merged) } else { Err(Errors::new(&self.files[0].shown, problems)) }
    }

    /// A file with what it includes.
    fn merged_of(&self, index: usize) -> Table {
        let Some(file) = self.files.get(index) else { return Table::empty() };
        let mut merged = Table::empty();
        file.includes.iter().for_each(|included| merged.merge(self.merged_of(*included), Rule::Both));
        merged.merge(file.table.clone(), Rule::Newer);
        merged
    }

    /// Values on which files beside each other do not agree.
    fn conflicts(&self, table: &Table, below: &str, problems: &mut Vec<Problem>) {
        for (key, value) in &table.entries {
            let name = if below.is_empty() { key.clone() } else { format!("{below}.{key}") };
            match value {
                Value::Plain(_) => {}
                Value::Table { table, .. } => self.conflicts(table, &name, problems),
                Value::Tables(tables) => tables.iter().for_each(|table| self.conflicts(table, &name, problems)),
                Value::Conflict(both) => {
                    let told = both.each_ref().map(|written| format!("{} in {}", written.text, self.place(written)));
                    let message =
                        format!("`{name}` is {}; drop one, or say in this file which counts", told.join(", and "));
                    problems.push(Problem { line: Some(1), message });
                }
            }
        }
    }

    /// Where a value stands, as messages say it.
    pub(super) fn place(&self, written: &Written) -> String {
        let shown = self.files.get(written.place.file).map(|file| file.shown.display().to_string());
        format!("{}:{}", shown.unwrap_or_default(), written.place.line)
    }

    /// A mistake at a value.
    pub(super) fn wrong(&self, written: &Written, message: String) -> Errors {
        let shown = self.files.get(written.place.file).map_or(Path::new(""), |file| &file.shown);
        Errors::new(shown, vec![Problem { line: Some(written.place.line), message }])
    }

    /// The resolved text: the names of the files, then each value with its place.
    pub(super) fn text_of(&self, table: &Table) -> String {
        let folder = self.files.first().and_then(|file| file.shown.parent()).unwrap_or(Path::new(""));
        let names = self.files.iter().map(|file| {
            let name = file.shown.strip_prefix(folder).unwrap_or(&file.shown);
            name.display().to_string()
        });
        origins::write(table, &names.collect::<Vec<_>>())
    }
}

impl Table {
    fn empty() -> Self {
        Self { place: super::merge::Place { file: 0, line: 1 }, entries: Vec::new() }
    }
}

/// The files that a file includes, with the lines of their names.
fn included(text: &str, table: &DeTable<'_>, shown: &Path) -> Result<Vec<(String, usize)>, Errors> {
    let reader = Reader::new(text);
    let section = Section::new(&reader, "", 1, table);
    let names = section.get(INCLUDE).map(|item| item.texts("common.toml")).unwrap_or_default();
    let names: Vec<(String, usize)> = names.into_iter().map(|(name, line)| (name.to_owned(), line)).collect();
    for (name, line) in names.iter().filter(|(name, _)| name.contains(char::is_control)) {
        reader.report(*line, format!("`{name}` is no name of a file"));
    }
    let problems = reader.into_problems();
    if problems.is_empty() { Ok(names) } else { Err(Errors::new(shown, problems)) }
}

/// The mistakes of a file that is no TOML.
fn syntax(text: &str, shown: &Path) -> Errors {
    let reader = Reader::new(text);
    DeTable::parse_recoverable(text).1.iter().for_each(|error| reader.report_syntax(error));
    Errors::new(shown, reader.into_problems())
}

/// A path without links, if it leads to a file.
fn real(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

fn file_name(path: &Path) -> &str {
    path.file_name().and_then(|name| name.to_str()).unwrap_or_default()
}
