//! Settings that may change while a module runs: declared once, in its settings struct, by [`crate::parameters`].
//!
//! ```text
//! struct Settings ──#[parameters]──▶ ParameterSet ◀── Declared: name, text, unit, range
//!                                        │
//! configuration ──Declared::read─────────┤ the same check, and the same words, for all that come
//! `param set`   ──runtime::parameters────┘
//! ```
//!
//! A value travels as postcard of its type, and a program without that type reads it by the description that comes with
//! it: [`Parameter`].
//!
//! ```
//! #[rohrpost_modules::parameters(crate = rohrpost_modules::macro_support)]
//! struct Settings {
//!     /// Speed when nothing is in the way.
//!     #[parameter(unit = "m/s", min = 0.0, max = 1.5, default = 0.5)]
//!     cruise_m_s: f64,
//! }
//! let settings: Settings = toml::from_str("cruise-m-s = 1.2").unwrap();
//! assert_eq!(settings.cruise_m_s, 1.2);
//! assert!(toml::from_str::<Settings>("cruise-m-s = 7.0").is_err());
//! ```
//!
//! A range or a default that cannot be does not compile:
//!
//! ```compile_fail
//! #[rohrpost_modules::parameters(crate = rohrpost_modules::macro_support)]
//! struct Settings {
//!     /// Beams to leave out.
//!     #[parameter(min = 5, max = 3)]
//!     skip: u8,
//! }
//! ```
//!
//! ```compile_fail
//! #[rohrpost_modules::parameters(crate = rohrpost_modules::macro_support)]
//! struct Settings {
//!     /// Speed when nothing is in the way.
//!     #[parameter(max = 1.5, default = 2.0)]
//!     cruise_m_s: f64,
//! }
//! ```

mod declared;
mod kinds;
mod words;

pub use declared::{Declared, put_parameter};
pub use kinds::ParameterType;
pub use words::{from_file, from_word, toml_key, toml_text, value_text};

use crate::output::plain::line;
use rohrpost_schema::{Field, Schema, Value, WalkError, decode};
use serde::{Deserialize, Serialize};

/// The parameters of a module and their present values. Written by [`crate::parameters`] for the settings struct.
pub trait ParameterSet {
    /// Their names, as the configuration has them.
    fn names(&self) -> Vec<&str>;

    /// One of them with its present value; none past the last.
    fn get(&self, index: usize) -> Option<Parameter>;

    /// Whether this value (postcard) would do; returned as it would be stored.
    ///
    /// # Errors
    /// [`Refusal::Type`] or [`Refusal::Range`].
    fn accept(&self, index: usize, value: &[u8]) -> Result<Vec<u8>, Refusal>;

    /// Stores a value that [`ParameterSet::accept`] or [`ParameterSet::get`] returned.
    fn put(&mut self, index: usize, value: &[u8]);
}

/// A parameter as its module describes it, with its present value.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Parameter {
    /// Its name, as the configuration has it, what it is for, unit, type and range.
    pub field: Field,
    /// Present value, postcard.
    pub value: Vec<u8>,
}

impl Parameter {
    /// The present value.
    ///
    /// # Errors
    /// When it is not of the type: then its module is not to be believed.
    pub fn value(&self) -> Result<Value, WalkError> {
        decode(&self.field.ty, &self.value)
    }

    /// The present value, if its module takes it: of a type that a parameter can have, in its range, and a number that
    /// is finite. Negative zero becomes zero.
    ///
    /// # Errors
    /// [`Refusal::Type`] or [`Refusal::Range`].
    pub fn checked(&self) -> Result<Value, Refusal> {
        let Field { name, ty, .. } = &self.field;
        let refused = |text: String| Refusal::Type { name: name.clone(), text };
        if !kinds::is_of_parameters(ty) {
            return Err(refused(format!("a parameter is {}, not {}", kinds::ALL, words::type_text(ty))));
        }
        let value = match self.value().map_err(|error| refused(error.to_string()))? {
            Value::F(number) => Value::F(number + 0.0),
            other => other,
        };
        if kinds::is_within(&value, &self.field) {
            return Ok(value);
        }
        Err(Refusal::Range {
            name: name.clone(),
            value: self.field.with_unit(&value_text(&value)),
            range: self.field.with_unit(&self.range()),
        })
    }

    /// What values it takes, in words, without the unit: `0..=1.5`, `at least 1`, `left|right`, `f64`.
    pub fn range(&self) -> String {
        self.field.range().unwrap_or_else(|| words::type_text(&self.field.ty))
    }
}

/// Why parameters keep their values.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize, Schema, thiserror::Error)]
pub enum Refusal {
    /// The module has none.
    #[error("the module has no parameters")]
    NoParameters,
    /// It has others.
    #[error("there is no parameter `{}`; there are {}", line(.name), line(.known))]
    Unknown {
        /// As it was asked for.
        name: String,
        /// Those that there are.
        known: String,
    },
    /// Which value is meant?
    #[error("`{}` is given twice", line(.0))]
    Twice(String),
    /// A value of another type.
    #[error("`{}`: {}", line(.name), line(.text))]
    Type {
        /// The parameter.
        name: String,
        /// What it is and what it should be.
        text: String,
    },
    /// A value too small or too large.
    #[error("`{}` is {}, out of range: {}", line(.name), line(.value), line(.range))]
    Range {
        /// The parameter.
        name: String,
        /// The value, with its unit.
        value: String,
        /// What it may be, with its unit.
        range: String,
    },
    /// The module itself does not want it.
    #[error("the module refuses: {}", line(.0))]
    Module(String),
}

#[cfg(test)]
mod tests;
