//! Tables of several files as one: what includes wins over what is included; files beside each other must agree.

use toml::de::{DeTable, DeValue};

/// Where a value stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    /// Which of the files.
    pub(super) file: usize,
    /// Line of its last character, counted from 1.
    pub(super) line: usize,
}

/// A value as a file writes it, or what became of several.
#[derive(Clone, Debug)]
pub(super) enum Value {
    /// A value that only whole gives way to another.
    Plain(Written),
    /// A table; `written`: in braces, as long as nothing was merged into it.
    Table { table: Table, written: Option<Written> },
    /// `[[key]]`.
    Tables(Vec<Table>),
    /// Files beside each other say different things.
    Conflict([Written; 2]),
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Written {
    pub(super) text: String,
    pub(super) place: Place,
    /// The variable of the environment that it comes from.
    pub(super) variable: Option<String>,
}

/// A table, with its keys in the order of the files.
#[derive(Clone, Debug)]
pub(super) struct Table {
    pub(super) place: Place,
    pub(super) entries: Vec<(String, Value)>,
}

/// Which values count.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Rule {
    /// The newer ones: they are of the file that includes.
    Newer,
    /// Both, so they must be equal: they are of files beside each other.
    Both,
}

/// A text and the number of its file.
pub(super) struct FileText<'t> {
    pub(super) text: &'t str,
    pub(super) file: usize,
    /// Line of a place in the text.
    pub(super) line: &'t dyn Fn(usize) -> usize,
}

impl FileText<'_> {
    /// The parsed table as one that can be merged.
    pub(super) fn table(&self, place: usize, table: &DeTable<'_>) -> Table {
        let mut entries: Vec<_> = table.iter().collect();
        entries.sort_by_key(|(key, _)| key.span().start);
        let entry = |(key, value): (&toml::Spanned<std::borrow::Cow<'_, str>>, &toml::Spanned<DeValue<'_>>)| {
            (key.get_ref().to_string(), self.value(value))
        };
        Table { place: self.place(place), entries: entries.into_iter().map(entry).collect() }
    }

    fn value(&self, value: &toml::Spanned<DeValue<'_>>) -> Value {
        let span = value.span();
        let text = self.text.get(span.clone()).unwrap_or_default();
        let written =
            || Written { text: text.to_owned(), place: self.place(span.end.saturating_sub(1)), variable: None };
        let is_header = |at: usize| !self.text.get(at..).unwrap_or_default().starts_with('{');
        match value.get_ref() {
            DeValue::Table(table) => {
                let written = (!is_header(span.start)).then(written);
                Value::Table { table: self.table(span.start, table), written }
            }
            DeValue::Array(array) if !array.is_empty() => {
                let tables = array.iter().map(|element| {
                    let at = element.span().start;
                    let table = element.get_ref().as_table().filter(|_| is_header(at))?;
                    Some(self.table(at, table))
                });
                tables.collect::<Option<_>>().map_or_else(|| Value::Plain(written()), Value::Tables)
            }
            _ => Value::Plain(written()),
        }
    }

    fn place(&self, at: usize) -> Place {
        Place { file: self.file, line: (self.line)(at) }
    }
}

impl Table {
    /// The value of a key.
    pub(super) fn get(&self, key: &str) -> Option<&Value> {
        self.entries.iter().find(|(known, _)| known == key).map(|(_, value)| value)
    }

    /// Takes another table in.
    pub(super) fn merge(&mut self, newer: Self, rule: Rule) {
        for (key, value) in newer.entries {
            match self.entries.iter_mut().find(|(known, _)| *known == key) {
                Some((_, known)) => known.merge(value, rule),
                None => self.entries.push((key, value)),
            }
        }
    }

    /// The name by which tables of a list are the same.
    fn name(&self) -> Option<&str> {
        match self.get("name") {
            Some(Value::Plain(written)) => Some(&written.text),
            _ => None,
        }
    }
}

impl Value {
    fn merge(&mut self, newer: Self, rule: Rule) {
        match (self, newer) {
            (Self::Table { table, written }, Self::Table { table: newer, written: newer_written }) => {
                if *written != newer_written || written.is_none() {
                    *written = None;
                    table.merge(newer, rule);
                }
            }
            (Self::Tables(tables), Self::Tables(newer)) => newer.into_iter().for_each(|table| add(tables, table, rule)),
            (known, newer) => match (known.written(), newer.written(), rule) {
                (Some(one), Some(other), Rule::Both) if one.text != other.text => {
                    *known = Self::Conflict([one.clone(), other.clone()]);
                }
                (.., Rule::Both) if matches!(known, Self::Conflict(_)) => {}
                _ => *known = newer,
            },
        }
    }

    /// One text that says it.
    fn written(&self) -> Option<&Written> {
        match self {
            Self::Plain(written) => Some(written),
            Self::Table { written, .. } => written.as_ref(),
            Self::Tables(_) | Self::Conflict(_) => None,
        }
    }
}

/// Adds a table of a list, or merges it into the one of its name; one that two files include comes once.
fn add(tables: &mut Vec<Table>, newer: Table, rule: Rule) {
    let is_same =
        |known: &&mut Table| known.place == newer.place || newer.name().is_some_and(|name| known.name() == Some(name));
    match tables.iter_mut().find(is_same) {
        Some(known) => known.merge(newer, rule),
        None => tables.push(newer),
    }
}
