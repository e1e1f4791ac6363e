//! Data of a type that is known from a description alone.

use crate::Label;

/// Data of an unknown Rust type.
///
/// Each type has one form, the one that [`decode`](crate::decode) gives; [`encode`](crate::encode) takes more, see
/// there.
///
/// | Rust | here | JSON |
/// |---|---|---|
/// | `()`, unit struct, `None` | `Null` | `null` |
/// | `Some(x)` | `x`; where `x` itself can be `Null` (`Option<()>`, `Option<Option<u8>>`): `Variant("Some", x)` | `x`; `"Some"`, `{"Some": x}` |
/// | `u8` … `u128`; `i8` … `i128` | `U`; `I` | number; text if it fits no 64 bits |
/// | `f64`, `f32` | `F`; an `f32` as its shortest decimal: 1.2, not 1.2000000476837158 | number, `"NaN"`, `"inf"`, `"-inf"` |
/// | `Vec<u8>`, byte strings | `Bytes` | list |
/// | other lists, tuples, arrays | `List` | list |
/// | struct; map with keys of one word ([`is_word`](crate::is_word)) | `Map` in the order of the bytes | object |
/// | map with other keys | `List` of `List`s of key and value | list of pairs |
/// | newtype struct | what it wraps | the same |
/// | enum | `Variant`; without payload: `Variant(name, Null)` | `{"name": payload}`; `"name"` |
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// Nothing: a unit, or no value where one is optional.
    Null,
    /// True or false.
    Bool(bool),
    /// A whole number of a signed type.
    I(i128),
    /// A whole number of an unsigned type.
    U(u128),
    /// A number with a fraction.
    F(f64),
    /// One character.
    Char(char),
    /// Text.
    Text(String),
    /// Bytes.
    Bytes(Vec<u8>),
    /// Elements of a list or tuple.
    List(Vec<Value>),
    /// Fields of a struct, or entries of a map.
    Map(Vec<(Label, Value)>),
    /// A choice by name, and what it carries (`Null`: nothing).
    Variant(Label, Box<Value>),
}

impl Value {
    /// The choice `name` without payload.
    ///
    /// ```
    /// use rohrpost_schema::Value;
    ///
    /// assert_eq!(Value::unit_variant("Left"), Value::Variant("Left".into(), Box::new(Value::Null)));
    /// ```
    pub fn unit_variant(name: impl Into<Label>) -> Self {
        Self::Variant(name.into(), Box::new(Self::Null))
    }
}
