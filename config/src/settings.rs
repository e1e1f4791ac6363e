//! The free settings of a module, given a type.

use crate::installation::Installation;
use crate::module::Module;
use crate::reader::line_of;
use serde::de::DeserializeOwned;
use std::path::PathBuf;
use toml::Spanned;
use toml::de::{DeTable, DeValue, ValueDeserializer};

/// Settings that a module cannot use.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}:{line}: settings of module `{module}`: {message}", path.display())]
pub struct SettingsError {
    /// The configuration file.
    pub path: PathBuf,
    /// Line of the setting in question.
    pub line: usize,
    /// The module.
    pub module: String,
    /// What is wrong, in the words of the type.
    pub message: String,
}

impl Installation {
    /// Turns a module's settings into a type, best one with `#[serde(deny_unknown_fields)]`. An error names the line of the
    /// very setting.
    ///
    /// Paths in settings start from the file's folder: see [`resolve`](Self::resolve).
    pub fn settings_as<T: DeserializeOwned>(&self, module: &Module) -> Result<T, SettingsError> {
        let document = self.document();
        let entry = entry(&document, module);
        let place = entry.map_or(0..0, Spanned::span);
        let nothing = || Spanned::new(place.clone(), DeValue::Table(DeTable::new()));
        let settings = entry.and_then(|entry| entry.get_ref().get("settings")).cloned().unwrap_or_else(nothing);
        T::deserialize(ValueDeserializer::from(settings)).map_err(|error| SettingsError {
            path: self.path.clone(),
            line: line_of(&self.text, error.span().unwrap_or(place).start),
            module: self.classes.format(module.name),
            message: error.message().into(),
        })
    }
    /// Line of one of a module's settings; of the module, if the setting is not there.
    pub fn settings_line(&self, module: &Module, key: &str) -> usize {
        let document = self.document();
        let settings = entry(&document, module).and_then(|entry| entry.get_ref().get("settings"));
        let table = settings.and_then(|settings| settings.get_ref().as_table());
        let place = table.and_then(|table| Some(table.get_key_value(key)?.0.span()));
        place.map_or(module.line, |place| line_of(&self.text, place.start))
    }

    /// The text is read again, since only it knows the places.
    fn document(&self) -> DeTable<'_> {
        DeTable::parse(&self.text).map(Spanned::into_inner).unwrap_or_default()
    }
}

fn entry<'d, 't>(document: &'d DeTable<'t>, module: &Module) -> Option<&'d Spanned<DeValue<'t>>> {
    document.get("module").and_then(|modules| modules.get_ref().get(module.index))
}
