//! What a user types for one argument.

use super::{
    Value, WalkError, WalkProblem,
    scalar::{Integer, parse_float, shortened},
    types::{expectation, find_variant, is_nullable, unwrapped},
};
use postcard_schema::schema::owned::{
    OwnedDataModelType as Ty, OwnedDataModelVariant as VariantTy, OwnedNamedType, OwnedNamedVariant,
};

/// Reads one word of a command line as a value of the described type.
///
/// Numbers may be `12`, `-0.5`, `1e3`, `0x1f`, and with a fraction also `NaN`, `inf`, `-inf`. Text and names of enum
/// variants stand without quotes; case, `-` and `_` in names of variants do not matter. `null` is what an option
/// without value is, even if it is an option of text.
///
/// Structs, lists, maps and variants with a payload are for JSON, see [`is_word`](super::is_word).
///
/// ```
/// use rohrpost_modules::value::{Data, Value, parse_argument};
/// assert_eq!(parse_argument(&u16::schema(), "1e3")?, Value::U(1000));
/// assert_eq!(parse_argument(&String::schema(), "1e3")?, Value::Text("1e3".into()));
/// assert_eq!(parse_argument(&Option::<bool>::schema(), "null")?, Value::Null);
/// let error = parse_argument(&u8::schema(), "256").unwrap_err().within("percent");
/// assert_eq!(error.to_string(), "percent: 256 is out of range: u8 is 0 to 255");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// What was expected; the path is empty, as the argument's name is the caller's: [`WalkError::within`].
pub fn parse_argument(ty: &OwnedNamedType, text: &str) -> Result<Value, WalkError> {
    match &unwrapped(ty).ty {
        Ty::Option(_) | Ty::Unit | Ty::UnitStruct if text == "null" => Ok(Value::Null),
        Ty::Option(inner) => {
            let some = parse_argument(inner, text)?;
            Ok(if is_nullable(inner) { Value::Variant("Some".into(), Box::new(some)) } else { some })
        }
        _ => Ok(parse_word(ty, text)?),
    }
}

/// The value of a type that is a word, or one of an enum that carries nothing.
pub(super) fn parse_word(ty: &OwnedNamedType, text: &str) -> Result<Value, WalkProblem> {
    let ty = unwrapped(ty);
    if let Some(integer) = Integer::of(&ty.ty) {
        return integer.parse(text);
    }
    let mut chars = text.chars();
    match (&ty.ty, text) {
        (Ty::Bool, "true") => Ok(Value::Bool(true)),
        (Ty::Bool, "false") => Ok(Value::Bool(false)),
        (Ty::F32, _) => Ok(Value::F(parse_float("f32", text)?)),
        (Ty::F64, _) => Ok(Value::F(parse_float("f64", text)?)),
        (Ty::String, _) => Ok(Value::Text(text.to_owned())),
        (Ty::Char, _) => match (chars.next(), chars.next()) {
            (Some(char), None) => Ok(Value::Char(char)),
            _ => Err(unexpected(expectation(ty), text)),
        },
        (Ty::Enum(variants), _) => parse_variant(ty, variants, text),
        (Ty::Bool, _) => Err(unexpected(expectation(ty), text)),
        _ => Err(unexpected(format!("JSON {}", expectation(ty)), text)),
    }
}

fn parse_variant(ty: &OwnedNamedType, variants: &[OwnedNamedVariant], text: &str) -> Result<Value, WalkProblem> {
    let (_, variant) = find_variant(variants, text).ok_or_else(|| unexpected(expectation(ty), text))?;
    match &variant.ty {
        VariantTy::UnitVariant => Ok(Value::unit_variant(&variant.name)),
        _ => Err(unexpected(format!("JSON {}", expectation(ty)), text)),
    }
}

fn unexpected(expected: String, got: &str) -> WalkProblem {
    WalkProblem::Expected { expected, got: shortened(got) }
}
