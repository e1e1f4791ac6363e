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
    /// very setting. Saved values of parameters go before the settings, which must be complete without them.
    ///
    /// Paths in settings start from the file's folder: see [`resolve`](Self::resolve).
    pub fn settings_as<T: DeserializeOwned>(&self, module: &Module) -> Result<T, SettingsError> {
        // The text is read again, since only it knows the places.
        let document = DeTable::parse(&self.text).map(Spanned::into_inner).unwrap_or_default();
        let entry = document.get("module").and_then(|modules| modules.get_ref().get(module.index));
        let place = entry.map_or(0..0, Spanned::span);
        let nothing = || Spanned::new(place.clone(), DeValue::Table(DeTable::new()));
        let settings = entry.and_then(|entry| entry.get_ref().get("settings")).cloned().unwrap_or_else(nothing);
        let read = |settings: &Spanned<DeValue<'_>>| T::deserialize(ValueDeserializer::from(settings.clone()));
        let configured = read(&settings).map_err(|error| SettingsError {
            path: self.path.clone(),
            line: line_of(&self.text, error.span().unwrap_or(place).start),
            module: self.classes.format(module.name),
            message: error.message().into(),
        })?;
        let saved = self.saved.as_ref().and_then(|saved| Some((saved, saved.over(module.name, &settings)?)));
        let Some((saved, merged)) = saved else { return Ok(configured) };
        // What is wrong only now is wrong with the saved values, and so are the places.
        let wrong = |error: toml::de::Error| {
            let at = error.span().unwrap_or(merged.span()).start;
            saved.wrong(self, module.name, at, error.message())
        };
        read(&merged).map_err(wrong)
    }
}
