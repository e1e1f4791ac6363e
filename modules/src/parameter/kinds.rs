//! The types that a parameter can have.

use rohrpost_schema::Data;

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
