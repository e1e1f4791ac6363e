//! What `#[parameters]` makes of one field.

use super::{Parameter, ParameterType, Refusal, value_text};
use crate::value::{Value, encode};
use postcard_schema::schema::owned::OwnedDataModelType as Ty;
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
            name: self.name.into(),
            text: self.text.into(),
            unit: self.unit.into(),
            ty: T::schema(),
            least: self.least.as_ref().map(bytes_of),
            most: self.most.as_ref().map(bytes_of),
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
        self.check_setting(&value).map_err(de::Error::custom)
    }

    fn check_setting(&self, value: &Value) -> Result<T, Refusal> {
        let ty = T::schema();
        // On a command line all is text; in a file a number stands without quotes.
        if let (Value::Text(text), false) = (value, matches!(ty.ty, Ty::String | Ty::Enum(_))) {
            let right = crate::value::describe_type(&ty);
            return Err(self.type_refusal(format!("{text:?} is text; write a value of type {right}, without quotes")));
        }
        let bytes = encode(&ty, value).map_err(|error| self.type_refusal(error.to_string()))?;
        self.check(&bytes)
    }

    fn type_refusal(&self, text: String) -> Refusal {
        Refusal::Type { name: self.name.into(), text }
    }

    fn range_refusal(&self, bytes: &[u8]) -> Refusal {
        let parameter = self.described(bytes.to_vec());
        let value = parameter.value().map_or_else(|error| error.to_string(), |value| value_text(&value));
        Refusal::Range {
            name: self.name.into(),
            value: parameter.with_unit(&value),
            range: parameter.with_unit(&parameter.range()),
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
