//! Fields of a value, by their names.

use rohrpost_schema::{Label, Value};

/// Fields of a struct. What is not there, or is something else, is none.
pub(crate) struct ValueFields(Vec<(Label, Value)>);

impl ValueFields {
    pub(crate) fn of(value: Value) -> Option<Self> {
        match value {
            Value::Map(fields) => Some(Self(fields)),
            _ => None,
        }
    }

    fn get(&self, name: &str) -> Option<&Value> {
        self.0.iter().find(|(its, _)| its == name).map(|(_, value)| value)
    }

    /// A field of its own; it is taken out.
    pub(crate) fn take(&mut self, name: &str) -> Option<Value> {
        let at = self.0.iter().position(|(its, _)| its == name)?;
        Some(self.0.swap_remove(at).1)
    }

    pub(crate) fn bytes(&mut self, name: &str) -> Option<Vec<u8>> {
        match self.take(name)? {
            Value::Bytes(bytes) => Some(bytes),
            _ => None,
        }
    }

    pub(crate) fn text(&mut self, name: &str) -> Option<String> {
        match self.take(name)? {
            Value::Text(text) => Some(text),
            _ => None,
        }
    }

    /// Also if it is not finite.
    pub(crate) fn number(&self, name: &str) -> Option<f64> {
        match self.get(name)? {
            Value::F(number) => Some(*number),
            _ => None,
        }
    }

    pub(crate) fn finite(&self, name: &str) -> Option<f64> {
        self.number(name).filter(|number| number.is_finite())
    }

    pub(crate) fn count(&self, name: &str) -> Option<u32> {
        match self.get(name)? {
            Value::U(count) => u32::try_from(*count).ok(),
            _ => None,
        }
    }

    /// Which variant it is.
    pub(crate) fn word(&self, name: &str) -> Option<&str> {
        match self.get(name)? {
            Value::Variant(word, _) => Some(word),
            _ => None,
        }
    }
}
