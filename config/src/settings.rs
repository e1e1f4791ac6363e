//! The free settings of a module, given a type; and the lines of what a module is given.

use crate::errors::SettingsError;
use crate::installation::Installation;
use crate::line_ends::LineEnds;
use crate::module::Module;
use crate::saved::SavedDocument;
use serde::de::DeserializeOwned;
use toml::Spanned;
use toml::de::{DeTable, DeValue, ValueDeserializer};

/// An installation's file and its saved parameters with the places of their values. Making it parses both texts:
/// several modules share one.
pub struct Document<'i> {
    installation: &'i Installation,
    table: DeTable<'i>,
    lines: LineEnds,
    saved: Option<SavedDocument<'i>>,
}

impl Installation {
    /// Parses the text for the places of its values.
    pub fn document(&self) -> Document<'_> {
        Document {
            installation: self,
            table: DeTable::parse(&self.text).map(Spanned::into_inner).unwrap_or_default(),
            lines: LineEnds::of(&self.text),
            saved: self.saved.as_ref().map(|saved| saved.document(self)),
        }
    }
}

impl<'i> Document<'i> {
    /// The installation that it is of.
    pub fn installation(&self) -> &'i Installation {
        self.installation
    }

    /// The saved parameters, if the installation has them.
    pub fn saved(&self) -> Option<&SavedDocument<'i>> {
        self.saved.as_ref()
    }

    /// Turns a module's settings into a type, preferably one with `#[serde(deny_unknown_fields)]`. An error names the
    /// line of the setting. Saved values of parameters override the settings, which must be complete without them.
    ///
    /// Paths in settings start from the file's folder: see [`resolve`](Installation::resolve).
    pub fn settings_as<T: DeserializeOwned>(&self, module: &Module) -> Result<T, SettingsError> {
        let configured = self.settings_without_saved(module)?;
        let saved = self.saved.as_ref();
        let merged = saved.and_then(|saved| Some((saved, saved.over(module.name, &self.settings(module))?)));
        let Some((saved, merged)) = merged else { return Ok(configured) };
        let place = merged.span();
        // A new error comes from the saved values, and so do the places.
        T::deserialize(ValueDeserializer::from(merged)).map_err(|error| {
            let at = error.span().unwrap_or(place).start;
            saved.wrong(module.name, at, error.message())
        })
    }

    /// The same, without saved values.
    pub fn settings_without_saved<T: DeserializeOwned>(&self, module: &Module) -> Result<T, SettingsError> {
        let settings = self.settings(module);
        let place = settings.span();
        T::deserialize(ValueDeserializer::from(settings)).map_err(|error| {
            let text_line = self.lines.line(error.span().unwrap_or(place).start);
            let (path, line) = self.installation.place(text_line);
            let module = self.installation.classes.format(module.name);
            SettingsError { path, line, text_line, module, message: error.message().into() }
        })
    }

    /// Line of one of a module's settings; of the module, if the setting is not there.
    pub fn settings_line(&self, module: &Module, key: &str) -> usize {
        self.line_below(module, "settings", key)
    }

    /// Line of the section of one of a module's streams; of the module, if the stream has none.
    pub fn stream_line(&self, module: &Module, stream: &str) -> usize {
        self.line_below(module, "stream", stream)
    }

    /// Line of a key in a table of a module; of the module, if it is not there.
    fn line_below(&self, module: &Module, table: &str, key: &str) -> usize {
        let table = self.entry(module).and_then(|entry| entry.get_ref().get(table));
        let table = table.and_then(|table| table.get_ref().as_table());
        let place = table.and_then(|table| Some(table.get_key_value(key)?.0.span()));
        place.map_or(module.line, |place| self.lines.line(place.start))
    }

    fn entry(&self, module: &Module) -> Option<&Spanned<DeValue<'i>>> {
        self.table.get("module").and_then(|modules| modules.get_ref().get(module.index?))
    }

    /// The table of a module's settings; an empty one in the place of the module, if it has none.
    fn settings(&self, module: &Module) -> Spanned<DeValue<'i>> {
        let entry = self.entry(module);
        let nothing = || Spanned::new(entry.map_or(0..0, Spanned::span), DeValue::Table(DeTable::new()));
        entry.and_then(|entry| entry.get_ref().get("settings")).cloned().unwrap_or_else(nothing)
    }
}
