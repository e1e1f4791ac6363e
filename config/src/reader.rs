//! Walks the parsed TOML with its places in the file, and collects every problem instead of stopping at the first.
//!
//! Keys that a [`Section`] was asked for are known: [`Section::finish`] reports others. Wrong ones read as missing.

use crate::errors::Problem;
use crate::line_ends::LineEnds;
use crate::units::{self, UnitError};
use std::cell::{OnceCell, RefCell};
use std::fmt::Display;
use std::ops::{Range, RangeInclusive};
use std::time::Duration;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Longest duration in a file: a longer one is a mistaken unit.
const DURATION_MAX: Duration = Duration::from_secs(24 * 3600);

/// A whole number of the file.
pub(crate) trait Whole: TryFrom<i64> + PartialOrd + Display + Copy {}

impl<T: TryFrom<i64> + PartialOrd + Display + Copy> Whole for T {}

/// The file, and its mistakes so far.
pub(crate) struct Reader<'d> {
    text: &'d str,
    lines: LineEnds,
    /// The first bracket without a closing one, and its line, once it was looked for.
    open: OnceCell<Option<(usize, char)>>,
    problems: RefCell<Vec<Problem>>,
}

impl<'d> Reader<'d> {
    pub(crate) fn new(text: &'d str) -> Self {
        Self { text, lines: LineEnds::of(text), open: OnceCell::new(), problems: RefCell::default() }
    }

    /// Line of a place in the text, counted from 1.
    pub(crate) fn line(&self, span: Range<usize>) -> usize {
        self.lines.line(span.start)
    }

    pub(crate) fn report(&self, line: usize, message: impl Into<String>) {
        self.problems.borrow_mut().push(Problem { line: Some(line), message: message.into() });
    }

    /// Whether nothing is wrong so far.
    pub(crate) fn is_content(&self) -> bool {
        self.problems.borrow().is_empty()
    }

    /// The parser's error for a text that is no TOML.
    pub(crate) fn report_syntax(&self, error: &toml::de::Error) {
        let span = error.span().unwrap_or(0..0);
        let there = self.text.get(span.clone()).unwrap_or_default();
        let line = self.line(span.clone());
        let open = || bracket_left_open(self.text).map(|(at, bracket)| (self.lines.line(at), bracket));
        // The parser continues, and reports an error inside.
        if let Some((opened, bracket)) =
            self.open.get_or_init(open).filter(|(opened, _)| *opened <= line && error.message() != "duplicate key")
        {
            let end = if bracket == '[' { ']' } else { '}' };
            return self.report(
                opened,
                format!("this is no TOML: this `{bracket}` is never closed; write `{end}` behind its last value"),
            );
        }
        let message = match error.message() {
            "duplicate key" => format!("`{there}` is given twice; drop one of them"),
            message => format!("this is no TOML: {}", message.replace('\n', " ")),
        };
        self.report(line, message);
    }

    pub(crate) fn into_problems(self) -> Vec<Problem> {
        self.problems.into_inner()
    }
}

/// The first bracket without a closing one, and its place; strings and comments are skipped.
fn bracket_left_open(text: &str) -> Option<(usize, char)> {
    let mut open: Vec<(usize, char)> = Vec::new();
    let mut at = 0;
    while let Some(c) = text[at..].chars().next() {
        at += match c {
            '#' => text[at..].find('\n').unwrap_or(text.len() - at),
            '"' | '\'' => string_bytes(&text[at..], c),
            '[' | '{' => {
                open.push((at, c));
                1
            }
            ']' | '}' => {
                open.pop();
                1
            }
            _ => c.len_utf8(),
        };
    }
    open.first().copied()
}

/// Bytes of the string that the text begins with: to its end, or that of its line; of one in three quotes to the end of
/// all.
fn string_bytes(text: &str, quote: char) -> usize {
    let long = [quote; 3].iter().collect::<String>();
    let end = if text.starts_with(&long) { long } else { quote.to_string() };
    let mut rest = text.char_indices().skip(end.len());
    while let Some((at, c)) = rest.next() {
        match c {
            '\\' if quote == '"' => {
                rest.next();
            }
            '\n' if end.len() == 1 => return at,
            _ if text[at..].starts_with(&end) => return at + end.len(),
            _ => {}
        }
    }
    text.len()
}

/// A table of the file.
pub(crate) struct Section<'d> {
    pub(crate) reader: &'d Reader<'d>,
    /// Its name in messages: `[system]`, "module `arm.0`". Empty for the file itself.
    pub(crate) what: String,
    pub(crate) line: usize,
    table: &'d DeTable<'d>,
    asked: RefCell<Vec<&'static str>>,
}

impl<'d> Section<'d> {
    pub(crate) fn new(reader: &'d Reader<'d>, what: &str, line: usize, table: &'d DeTable<'d>) -> Self {
        Self { reader, what: what.into(), line, table, asked: RefCell::default() }
    }

    /// The same section under another name in messages.
    pub(crate) fn called(self, what: &str) -> Self {
        Self { what: what.into(), ..self }
    }

    /// The value of a key. The key counts as known from now on.
    pub(crate) fn get(&self, key: &'static str) -> Option<Item<'d>> {
        if !self.asked.borrow().contains(&key) {
            self.asked.borrow_mut().push(key);
        }
        let (key, value) = self.table.get_key_value(key)?;
        Some(self.item(key.get_ref(), self.reader.line(key.span()), value))
    }

    /// The value of a key that may not be missing; `example` is what to write.
    pub(crate) fn required(&self, key: &'static str, example: &str) -> Option<Item<'d>> {
        let item = self.get(key);
        if item.is_none() {
            self.report(format!("`{key}` is missing; write for example `{example}`"));
        }
        item
    }

    /// All entries of a table with arbitrary keys, in the order of the file.
    pub(crate) fn entries(&self) -> Vec<Item<'d>> {
        let mut entries: Vec<_> = self.table.iter().collect();
        entries.sort_by_key(|(key, _)| key.span().start);
        entries.iter().map(|(key, value)| self.item(key.get_ref(), self.reader.line(key.span()), value)).collect()
    }

    /// What `read` makes of the value of a key; `usual` if there is none, or a wrong one.
    pub(crate) fn or<T>(&self, key: &'static str, usual: T, read: impl FnOnce(&Item<'d>) -> Option<T>) -> T {
        self.get(key).and_then(|item| read(&item)).unwrap_or(usual)
    }

    /// The whole number of a key, within this range; `usual` if there is none, or a wrong one.
    pub(crate) fn whole_or<T: Whole>(&self, key: &'static str, range: RangeInclusive<T>, usual: T) -> T {
        self.or(key, usual, |item| item.whole(range, usual))
    }

    /// A table below this one, if it is there.
    pub(crate) fn section(&self, key: &'static str, what: &str) -> Option<Self> {
        self.get(key)?.section(what)
    }

    /// Reports every key that was not asked for.
    pub(crate) fn finish(self) {
        let asked = self.asked.borrow();
        for item in self.entries() {
            if !asked.iter().any(|key| *key == item.key) {
                item.report(match nearest(&item.key, asked.iter().copied()) {
                    Some(key) => format!("unknown key `{}`; did you mean `{key}`?", item.key),
                    None => format!("unknown key `{}`; the keys are {}", item.key, asked.join(", ")),
                });
            }
        }
    }

    pub(crate) fn report(&self, message: impl AsRef<str>) {
        self.reader.report(self.line, prefixed(&self.what, message.as_ref()));
    }

    fn item(&self, key: &str, line: usize, value: &'d Spanned<DeValue<'d>>) -> Item<'d> {
        Item { reader: self.reader, what: self.what.clone(), key: key.into(), line, value }
    }
}

/// The value of a key, or one element of a list.
#[derive(Clone)]
pub(crate) struct Item<'d> {
    pub(crate) reader: &'d Reader<'d>,
    pub(crate) what: String,
    pub(crate) key: String,
    pub(crate) line: usize,
    pub(crate) value: &'d Spanned<DeValue<'d>>,
}

impl<'d> Item<'d> {
    pub(crate) fn report(&self, message: impl AsRef<str>) {
        self.reader.report(self.line, prefixed(&self.what, message.as_ref()));
    }

    /// Reports a value of the wrong kind or out of its range; returns nothing, for `?` and tails.
    pub(crate) fn wrong<T>(&self, right: &str) -> Option<T> {
        self.report(format!("`{}` is {}; write {right}", self.key, shown(self.value.get_ref())));
        None
    }

    pub(crate) fn text(&self, example: &str) -> Option<&'d str> {
        match self.value.get_ref().as_str() {
            Some("") => self.wrong(&format!("for example `{} = \"{example}\"`", self.key)),
            Some(text) => Some(text),
            None => self.wrong(&format!("text in quotes, such as `{} = \"{example}\"`", self.key)),
        }
    }

    /// Text that becomes part of a path: it must not be one.
    pub(crate) fn word(&self, example: &str) -> Option<&'d str> {
        let text = self.text(example)?;
        if is_word(text) { Some(text) } else { self.wrong("small letters, digits and `-`, a letter first") }
    }

    pub(crate) fn flag(&self) -> Option<bool> {
        self.value.get_ref().as_bool().or_else(|| self.wrong("true or false"))
    }

    pub(crate) fn whole<T: Whole>(&self, range: RangeInclusive<T>, example: T) -> Option<T> {
        let number = self.value.get_ref().as_integer().and_then(|i| i64::from_str_radix(i.as_str(), i.radix()).ok());
        number.and_then(|number| T::try_from(number).ok()).filter(|number| range.contains(number)).or_else(|| {
            let (first, last) = (range.start(), range.end());
            self.wrong(&format!("a whole number from {first} to {last}, such as `{} = {example}`", self.key))
        })
    }

    pub(crate) fn number(&self, range: RangeInclusive<f64>, example: &str) -> Option<f64> {
        let number: Option<f64> = match self.value.get_ref() {
            DeValue::Integer(i) => i64::from_str_radix(i.as_str(), i.radix()).ok().map(|i| i as f64),
            DeValue::Float(f) => f.as_str().parse().ok(),
            _ => None,
        };
        number.filter(|number| range.contains(number)).or_else(|| {
            let (first, last) = (range.start(), range.end());
            self.wrong(&format!("a number from {first} to {last}, such as `{} = {example}`", self.key))
        })
    }

    /// Whether it is this word.
    pub(crate) fn is(&self, word: &str) -> bool {
        self.value.get_ref().as_str() == Some(word)
    }

    /// One of a few words.
    pub(crate) fn choice<T: Clone>(&self, words: &[(&str, T)]) -> Option<T> {
        let text = self.value.get_ref().as_str();
        let found = words.iter().find(|(word, _)| Some(*word) == text).map(|(_, meaning)| meaning.clone());
        found.or_else(|| {
            let words: Vec<String> = words.iter().map(|(word, _)| format!("\"{word}\"")).collect();
            self.wrong(&match &words[..] {
                [all_but_last @ .., last] if !all_but_last.is_empty() => {
                    format!("{} or {last}", all_but_last.join(", "))
                }
                _ => words.concat(),
            })
        })
    }

    /// What a text with a unit says.
    fn measure<T>(&self, what: &str, example: &str, parse: fn(&str) -> Result<T, UnitError>) -> Option<T> {
        let Some(text) = self.value.get_ref().as_str() else {
            return self.wrong(&format!("a {what} with its unit, such as `{} = \"{example}\"`", self.key));
        };
        parse(text).inspect_err(|error| self.report(format!("`{}`: {error}", self.key))).ok()
    }

    pub(crate) fn duration(&self, example: &str) -> Option<Duration> {
        let duration = self.measure("duration", example, units::parse_duration)?;
        if duration <= DURATION_MAX { Some(duration) } else { self.wrong("at most a day, \"24 h\"") }
    }

    /// A duration of at least a microsecond.
    pub(crate) fn duration_above_zero(&self, example: &str) -> Option<Duration> {
        self.duration_of_at_least(Duration::from_micros(1), example)
    }

    pub(crate) fn duration_of_at_least(&self, least: Duration, example: &str) -> Option<Duration> {
        let duration = self.duration(example)?;
        if duration < least {
            let least = units::duration_text(least);
            return self.wrong(&format!("at least \"{least}\", for example `{} = \"{example}\"`", self.key));
        }
        Some(duration)
    }

    pub(crate) fn size(&self, range: RangeInclusive<u64>, example: &str) -> Option<u64> {
        let size = self.measure("size", example, units::parse_size)?;
        let right = || format!("{} to {} B, such as \"{example}\"", range.start(), range.end());
        if range.contains(&size) { Some(size) } else { self.wrong(&right()) }
    }

    /// The rate of a link, in bits a second.
    pub(crate) fn rate(&self, range: RangeInclusive<u64>, example: &str) -> Option<u64> {
        let rate = self.measure("rate", example, units::parse_rate)?;
        let [least, most] = [range.start(), range.end()].map(|rate| units::rate_text(*rate));
        if range.contains(&rate) {
            Some(rate)
        } else {
            self.wrong(&format!("{least} to {most}, such as \"{example}\""))
        }
    }

    /// The elements of a list.
    pub(crate) fn list(&self, example: &str) -> Option<Vec<Self>> {
        let Some(array) = self.value.get_ref().as_array() else {
            return self.wrong(&format!("a list, such as `{} = {example}`", self.key));
        };
        let line = |value: &Spanned<DeValue<'d>>| self.reader.line(value.span());
        Some(array.iter().map(|value| Self { line: line(value), value, ..self.clone() }).collect())
    }

    /// The texts of a list, with the lines they stand in.
    pub(crate) fn texts(&self, example: &str) -> Vec<(&'d str, usize)> {
        let list = self.list(&format!("[\"{example}\"]")).unwrap_or_default();
        list.iter().filter_map(|item| Some((item.text_of_list(example)?, item.line))).collect()
    }

    /// The text that an element of a list is.
    pub(crate) fn text_of_list(&self, example: &str) -> Option<&'d str> {
        let text = self.value.get_ref().as_str().filter(|text| !text.is_empty());
        text.or_else(|| self.wrong(&format!("a list of texts, such as `{} = [\"{example}\"]`", self.key)))
    }

    /// Whether it is a table in which a key is this word. The key does not count as known by this.
    pub(crate) fn has(&self, key: &str, word: &str) -> bool {
        let table = self.value.get_ref().as_table();
        table.and_then(|table| table.get(key)).is_some_and(|value| value.get_ref().as_str() == Some(word))
    }

    pub(crate) fn is_table(&self) -> bool {
        self.value.get_ref().is_table()
    }

    /// The table that the value is.
    pub(crate) fn section(&self, what: &str) -> Option<Section<'d>> {
        match self.value.get_ref().as_table() {
            Some(table) => Some(Section::new(self.reader, what, self.line, table)),
            None => self.wrong(&format!("a table: `{} = {{ ... }}` or `[{}]`", self.key, self.key)),
        }
    }
}

fn prefixed(what: &str, message: &str) -> String {
    if what.is_empty() { message.into() } else { format!("{what}: {message}") }
}

/// A value as a message shows it.
fn shown(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(text) if text.is_empty() => "empty".into(),
        DeValue::String(text) => format!("\"{text}\""),
        DeValue::Integer(number) => number.to_string(),
        DeValue::Float(number) => number.to_string(),
        DeValue::Boolean(flag) => flag.to_string(),
        DeValue::Datetime(_) => "a date".into(),
        DeValue::Array(_) => "a list".into(),
        DeValue::Table(_) => "a table".into(),
    }
}

/// The candidate most like `word`, if one is like it at all: messages suggest it.
pub fn nearest<'c>(word: &str, candidates: impl IntoIterator<Item = &'c str>) -> Option<&'c str> {
    // Both measures: edit distance for typing errors, Jaro-Winkler for words with a right beginning (`max` for
    // `max-age`).
    let likeness = |candidate: &str| {
        let edits = strsim::normalized_damerau_levenshtein(word, candidate);
        edits.max(strsim::jaro_winkler(word, candidate) - 0.2)
    };
    let best = candidates.into_iter().map(|candidate| (likeness(candidate), candidate));
    best.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(likeness, _)| *likeness >= 0.6).map(|(_, candidate)| candidate)
}

/// Whether a text can name a class or a node. A letter comes first, so that a number is never a name.
pub fn is_word(text: &str) -> bool {
    text.starts_with(|c: char| c.is_ascii_lowercase())
        && text.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-')
}
