//! What `#[parameters]` makes of one field.

use super::{Parameter, ParameterType, Refusal, from_file, value_text};
use rohrpost_schema::{Field, Value};
use serde::{Deserialize, Deserializer, de};

/// A parameter as its struct declares it.
#[derive(Clone, Debug)]
pub struct Declared<T> {
    /// Its name, as the configuration has it.
    pub name: &'static str,
    /// What it is for.
    pub text: &'static str,
    /// Unit of its value; empty: none.
    pub unit: &'static str,
    /// Least value.
    pub least: Option<T>,
    /// Greatest value.
    pub most: Option<T>,
}

impl<T: ParameterType> Declared<T> {
    /// For tools, with a value.
    pub fn describe(&self, value: &T) -> Parameter {
        self.described(bytes_of(value))
    }

    fn described(&self, value: Vec<u8>) -> Parameter {
        Parameter {
            field: Field::new(self.name, T::schema())
                .said(self.text, self.unit)
                .bounded(self.least.as_ref().map(bytes_of), self.most.as_ref().map(bytes_of)),
            value,
        }
    }

    /// The value that these bytes are, if the parameter may have it.
    ///
    /// # Errors
    /// [`Refusal::Type`] or [`Refusal::Range`].
    pub fn check(&self, bytes: &[u8]) -> Result<T, Refusal> {
        let value: T = match postcard::take_from_bytes(bytes) {
            Ok((value, [])) => value,
            Ok((_, rest)) => return Err(self.type_refusal(format!("{} bytes too many", rest.len()))),
            Err(error) => return Err(self.type_refusal(error.to_string())),
        };
        // What is refused is consumed; its bytes say what it was.
        value.within(self.least.as_ref(), self.most.as_ref()).ok_or_else(|| self.range_refusal(bytes))
    }

    /// The same, as bytes that can be stored.
    ///
    /// # Errors
    /// As for [`Declared::check`].
    pub fn check_bytes(&self, bytes: &[u8]) -> Result<Vec<u8>, Refusal> {
        self.check(bytes).map(|value| bytes_of(&value))
    }

    /// Reads it from a configuration, with the same check.
    ///
    /// # Errors
    /// What [`Refusal`] says; the deserializer knows the place.
    pub fn read<'de, D: Deserializer<'de>>(&self, deserializer: D) -> Result<T, D::Error> {
        let value = Value::deserialize(deserializer)?;
        let bytes = from_file(&T::schema(), &value).map_err(|text| self.type_refusal(text));
        bytes.and_then(|bytes| self.check(&bytes)).map_err(de::Error::custom)
    }

    fn type_refusal(&self, text: String) -> Refusal {
        Refusal::Type { name: self.name.into(), text }
    }

    fn range_refusal(&self, bytes: &[u8]) -> Refusal {
        let parameter = self.described(bytes.to_vec());
        let value = parameter.value().map_or_else(|error| error.to_string(), |value| value_text(&value));
        Refusal::Range {
            name: self.name.into(),
            value: parameter.field.with_unit(&value),
            range: parameter.field.with_unit(&parameter.range()),
        }
    }
}

fn bytes_of<T: ParameterType>(value: &T) -> Vec<u8> {
    // Writing a number, a text or a choice to a growing vector does not fail.
    postcard::to_stdvec(value).unwrap_or_default()
}

/// Stores a value that was checked before.
pub fn put_parameter<T: ParameterType>(to: &mut T, bytes: &[u8]) {
    if let Ok(value) = postcard::from_bytes(bytes) {
        *to = value;
    }
}
