//! Saved values of parameters: they override the settings of the same names.

use crate::errors::{Errors, Problem, SettingsError};
use crate::installation::Installation;
use crate::line_ends::LineEnds;
use crate::module::Module;
use crate::reader::{Item, Reader, Section, nearest};
use rohrpost_mailbox::Name;
use serde::de::DeserializeOwned;
use std::borrow::Cow;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml::de::{DeInteger, DeTable, DeValue, ValueDeserializer};

/// A file of saved values, a table for each module: `["pilot.0"]`, and below it `cruise-m-s = 0.4`. The modules check
/// types and ranges.
#[derive(Clone, Debug)]
pub struct Saved {
    /// The file.
    pub path: PathBuf,
    /// Its text; empty, if there is no such file yet.
    text: String,
    /// Modules with values in it, and their keys in the file.
    modules: Vec<(Name, String)>,
}

/// One value of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct SavedValue<T> {
    /// The parameter.
    pub name: String,
    /// Line in the file.
    pub line: usize,
    /// The value.
    pub value: T,
}

impl Saved {
    /// Reads a file for an installation. One that does not exist holds nothing: nothing was saved yet.
    ///
    /// # Errors
    /// All that is wrong with it, by line.
    pub fn load(path: &Path, installation: &Installation) -> Result<Self, Errors> {
        match std::fs::read_to_string(path) {
            Ok(text) => Self::parse(&text, path, installation),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Self::parse("", path, installation),
            Err(error) => {
                let message = format!("saved parameters cannot be read ({error}); make it readable, or remove it");
                Err(Errors::new(path, vec![Problem { line: None, message }]))
            }
        }
    }

    /// Checks the text of a file; `path` is its name in messages.
    ///
    /// # Errors
    /// All that is wrong with it, by line.
    pub fn parse(text: &str, path: &Path, installation: &Installation) -> Result<Self, Errors> {
        let reader = Reader::new(text);
        let (document, syntax) = DeTable::parse_recoverable(text);
        for error in &syntax {
            reader.report_syntax(error);
        }
        let mut modules = Vec::new();
        if syntax.is_empty() {
            let own = installation.modules.iter().map(|module| installation.classes.format(module.name));
            let own: Vec<String> = own.collect();
            for item in Section::new(&reader, "", 1, document.get_ref()).entries() {
                modules.extend(owner(&item, installation, &own).map(|name| (name, item.key.clone())));
            }
        }
        let problems = reader.into_problems();
        if problems.is_empty() {
            Ok(Self { path: path.to_owned(), text: text.to_owned(), modules })
        } else {
            Err(Errors::new(path, problems))
        }
    }

    /// Its text; empty, if there is no such file yet.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Modules with values in it, in the order of their names.
    pub fn modules(&self) -> impl Iterator<Item = Name> {
        self.modules.iter().map(|(name, _)| *name)
    }

    /// Parses the text for the places of its values.
    pub fn document<'s>(&'s self, installation: &'s Installation) -> SavedDocument<'s> {
        let table = DeTable::parse(&self.text).map(Spanned::into_inner).unwrap_or_default();
        SavedDocument { saved: self, installation, table, lines: LineEnds::of(&self.text) }
    }
}

/// A file of saved values with their places. Making it parses the text: several modules share one.
pub struct SavedDocument<'s> {
    saved: &'s Saved,
    installation: &'s Installation,
    table: DeTable<'s>,
    lines: LineEnds,
}

impl<'s> SavedDocument<'s> {
    /// The values of a module, in the order of the file.
    ///
    /// # Errors
    /// A value that the type does not take.
    pub fn values<T: DeserializeOwned>(&self, module: Name) -> Result<Vec<SavedValue<T>>, SettingsError> {
        let Some((_, table)) = self.table(module) else { return Ok(Vec::new()) };
        let mut values = Vec::new();
        for (key, value) in table {
            let (line, place) = (self.lines.line(key.span().start), value.span());
            let read = T::deserialize(ValueDeserializer::from(value.clone()));
            let value = read.map_err(|error| {
                let at = error.span().unwrap_or(place).start;
                self.wrong(module, at, error.message())
            })?;
            values.push((key.span().start, SavedValue { name: key.get_ref().to_string(), line, value }));
        }
        values.sort_by_key(|(at, _)| *at);
        Ok(values.into_iter().map(|(_, value)| value).collect())
    }

    /// The values of a module as the file writes them, in its order.
    pub fn texts(&self, module: Name) -> Vec<SavedValue<&str>> {
        let Some((_, table)) = self.table(module) else { return Vec::new() };
        let entry = |(key, value): (&Spanned<Cow<'_, str>>, &Spanned<DeValue<'_>>)| {
            let (at, text) = (key.span().start, self.saved.text.get(value.span()).unwrap_or_default());
            (at, SavedValue { name: key.get_ref().to_string(), line: self.lines.line(at), value: text })
        };
        let mut texts: Vec<_> = table.iter().map(entry).collect();
        texts.sort_by_key(|(at, _)| *at);
        texts.into_iter().map(|(_, text)| text).collect()
    }

    /// Refuses values for names that are no parameter of the module.
    ///
    /// # Errors
    /// The first of them, with its line.
    pub fn check_names(&self, module: &Module, known: &[&str]) -> Result<(), SettingsError> {
        let Some((_, table)) = self.table(module.name) else { return Ok(()) };
        match table.keys().find(|key| !known.contains(&key.get_ref().as_ref())) {
            None => Ok(()),
            Some(key) => {
                let right = match nearest(key.get_ref(), known.iter().copied()) {
                    Some(name) => format!("did you mean `{name}`?"),
                    None if known.is_empty() => "the module has none; drop this line".into(),
                    None => {
                        format!("there are {}; what is only read at the start belongs to `settings`", known.join(", "))
                    }
                };
                let message = format!("`{}` is no parameter; {right}", key.get_ref());
                Err(self.wrong(module.name, key.span().start, &message))
            }
        }
    }

    /// The settings of a module with its saved values in place of those of the same names, and the places of these.
    pub(crate) fn over<'a>(&self, module: Name, settings: &Spanned<DeValue<'a>>) -> Option<Spanned<DeValue<'a>>>
    where
        's: 'a,
    {
        let (place, saved) = self.table(module)?;
        let mut merged = settings.get_ref().as_table().cloned().unwrap_or_default();
        for (key, value) in saved {
            // Taken out first: the key in a map keeps its own place in the other file.
            merged.remove(key);
            merged.insert(key.clone(), value.clone());
        }
        Some(Spanned::new(place, DeValue::Table(merged)))
    }

    pub(crate) fn wrong(&self, module: Name, at: usize, message: &str) -> SettingsError {
        let line = self.lines.line(at);
        SettingsError {
            path: self.saved.path.clone(),
            line,
            text_line: line,
            module: self.installation.classes.format(module),
            message: message.into(),
        }
    }

    /// The table of a module, and its place.
    fn table(&self, module: Name) -> Option<(Range<usize>, &DeTable<'s>)> {
        let (_, key) = self.saved.modules.iter().find(|(name, _)| *name == module)?;
        let entry = self.table.get(key.as_str())?;
        Some((entry.span(), entry.get_ref().as_table()?))
    }
}

/// Whether a parameter could hold an integer, which the parser has not looked at yet.
fn is_in_range(number: &DeInteger<'_>) -> bool {
    let (digits, radix) = (number.as_str(), number.radix());
    i64::from_str_radix(digits, radix).is_ok() || u64::from_str_radix(digits, radix).is_ok()
}

/// The module of these values, one of `own`; none after an error that was reported.
fn owner(item: &Item<'_>, installation: &Installation, own: &[String]) -> Option<Name> {
    let text = item.key.as_str();
    let name = installation.classes.parse_module(text).ok();
    let module = name.and_then(|name| Some((name, installation.module(name)?)));
    let right = match module {
        Some((name, module)) if module.name == name => None,
        Some((_, module)) => Some(format!(
            "it is an alias; write [\"{}\"], the module's own name",
            installation.classes.format(module.name)
        )),
        None => Some(match nearest(text, own.iter().map(String::as_str)) {
            Some(near) => format!("did you mean [\"{near}\"]?"),
            None => format!("the modules are {}", own.join(", ")),
        }),
    };
    if let Some(right) = right {
        item.report(format!("`{text}` names no module; {right}"));
        return None;
    }
    let values = item.section(&format!("[\"{text}\"]"))?;
    for value in values.entries() {
        if matches!(value.value.get_ref(), DeValue::Array(_) | DeValue::Table(_) | DeValue::Datetime(_)) {
            value.report(format!("`{}`: a parameter is a number, a text, true or false", value.key));
        }
        if matches!(value.value.get_ref(), DeValue::Integer(number) if !is_in_range(number)) {
            value.report(format!("`{}`: an integer has a digit, and is {} to {}", value.key, i64::MIN, u64::MAX));
        }
    }
    name
}
