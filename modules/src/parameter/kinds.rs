//! The types that a parameter can have.

use rohrpost_schema::{Data, Field, Members, Type, Value};
use std::cmp::Ordering;

/// The types, for messages.
pub(super) const ALL: &str = "bool, an integer of at most 64 bits, f32, f64, text, or a choice of words";

/// Whether a parameter can have this type: the types of [`ParameterType`], as a description tells them.
pub(super) fn is_of_parameters(ty: &Type) -> bool {
    match ty {
        Type::Bool | Type::F32 | Type::F64 | Type::Text => true,
        Type::I8 | Type::I16 | Type::I32 | Type::I64 | Type::U8 | Type::U16 | Type::U32 | Type::U64 => true,
        Type::Enum { variants, .. } => variants.iter().all(|variant| variant.members == Members::None),
        _ => false,
    }
}

/// Whether a value lies in the field's range; a number that is not finite lies in none.
pub(super) fn is_within(value: &Value, field: &Field) -> bool {
    if let Value::F(number) = value
        && !number.is_finite()
    {
        return false;
    }
    let (lower, upper) = field.bounds();
    let is_least = |least: &Value| matches!(compare(value, least), Some(Ordering::Equal | Ordering::Greater));
    let is_most = |most: &Value| matches!(compare(value, most), Some(Ordering::Equal | Ordering::Less));
    lower.as_ref().is_none_or(is_least) && upper.as_ref().is_none_or(is_most)
}

fn compare(value: &Value, bound: &Value) -> Option<Ordering> {
    match (value, bound) {
        (Value::I(value), Value::I(bound)) => Some(value.cmp(bound)),
        (Value::U(value), Value::U(bound)) => Some(value.cmp(bound)),
        (Value::F(value), Value::F(bound)) => value.partial_cmp(bound),
        _ => None,
    }
}

/// A type that a parameter can have: `bool`, integers of at most 64 bits, `f32`, `f64`, `String`, and enums with
/// [`crate::choice`].
#[diagnostic::on_unimplemented(
    message = "a parameter cannot be of type `{Self}`",
    note = "use bool, an integer of at most 64 bits, f32, f64, String, or an enum with #[rohrpost::choice]"
)]
pub trait ParameterType: Data {
    /// The value as it is stored, if it lies between the bounds; none otherwise, and for numbers that are not finite.
    fn within(self, least: Option<&Self>, most: Option<&Self>) -> Option<Self>;
}

fn between<T: PartialOrd>(value: &T, least: Option<&T>, most: Option<&T>) -> bool {
    least.is_none_or(|least| value >= least) && most.is_none_or(|most| value <= most)
}

macro_rules! whole_numbers {
    ($($number:ident)*) => {$(
        impl ParameterType for $number {
            fn within(self, least: Option<&Self>, most: Option<&Self>) -> Option<Self> {
                between(&self, least, most).then_some(self)
            }
        }
    )*};
}
whole_numbers! { u8 u16 u32 u64 i8 i16 i32 i64 }

macro_rules! numbers_with_fraction {
    ($($number:ident)*) => {$(
        impl ParameterType for $number {
            fn within(self, least: Option<&Self>, most: Option<&Self>) -> Option<Self> {
                // Adding zero makes negative zero a plain one: a division by it should not find out.
                (self.is_finite() && between(&self, least, most)).then_some(self + 0.0)
            }
        }
    )*};
}
numbers_with_fraction! { f32 f64 }

macro_rules! without_range {
    ($($ty:ident)*) => {$(
        impl ParameterType for $ty {
            fn within(self, _: Option<&Self>, _: Option<&Self>) -> Option<Self> {
                Some(self)
            }
        }
    )*};
}
without_range! { bool String }
