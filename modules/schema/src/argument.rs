//! What a user types for one argument.

use crate::{
    Members, Named, Type, Value, WalkError, WalkProblem,
    scalar::{Integer, parse_float, shortened},
    words::{expectation, find_variant, is_nullable, unwrapped},
};

/// Reads one word of a command line as a value of the described type.
///
/// Numbers may be `12`, `-0.5`, `1e3`, `0x1f`, and with a fraction also `NaN`, `inf`, `-inf`. Text and names of enum
/// variants stand without quotes; case, `-` and `_` in names of variants do not matter. `null` is what an option
/// without value is, even if it is an option of text.
///
/// Structs, lists, maps and variants with a payload are for JSON, see [`is_word`](crate::is_word).
///
/// ```
/// use rohrpost_schema::{Schema, Value, parse_argument};
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
pub fn parse_argument(ty: &Type, text: &str) -> Result<Value, WalkError> {
    match unwrapped(ty) {
        ty if text == "null" && is_nullable(ty) => Ok(Value::Null),
        Type::Option(inner) => {
            let some = parse_argument(inner, text)?;
            Ok(if is_nullable(inner) { Value::Variant("Some".into(), Box::new(some)) } else { some })
        }
        _ => Ok(parse_word(ty, text)?),
    }
}

/// The value of a type that is a word, or one of an enum that carries nothing.
pub(crate) fn parse_word(ty: &Type, text: &str) -> Result<Value, WalkProblem> {
    let ty = unwrapped(ty);
    if let Some(integer) = Integer::of(ty) {
        return integer.parse(text);
    }
    let mut chars = text.chars();
    match (ty, text) {
        (Type::Bool, "true") => Ok(Value::Bool(true)),
        (Type::Bool, "false") => Ok(Value::Bool(false)),
        (Type::F32, _) => Ok(Value::F(parse_float("f32", text)?)),
        (Type::F64, _) => Ok(Value::F(parse_float("f64", text)?)),
        (Type::Text, _) => Ok(Value::Text(text.to_owned())),
        (Type::Char, _) => match (chars.next(), chars.next()) {
            (Some(char), None) => Ok(Value::Char(char)),
            _ => Err(unexpected(expectation(ty), text)),
        },
        (Type::Enum { variants, .. }, _) => parse_variant(ty, variants, text),
        (Type::Bool, _) => Err(unexpected(expectation(ty), text)),
        _ => Err(unexpected(format!("JSON {}", expectation(ty)), text)),
    }
}

fn parse_variant(ty: &Type, variants: &[Named], text: &str) -> Result<Value, WalkProblem> {
    let (_, variant) = find_variant(variants, text).ok_or_else(|| unexpected(expectation(ty), text))?;
    match variant.members {
        Members::None => Ok(Value::unit_variant(&*variant.name)),
        _ => Err(unexpected(format!("JSON {}", expectation(ty)), text)),
    }
}

fn unexpected(expected: String, got: &str) -> WalkProblem {
    WalkProblem::Expected { expected, got: shortened(got) }
}
