//! Questions about a description: how it reads, and which form its values take.

use super::{DEPTH_MAX, scalar::Integer};
use postcard_schema::schema::owned::{
    OwnedDataModelType as Ty, OwnedDataModelVariant as VariantTy, OwnedNamedType, OwnedNamedValue, OwnedNamedVariant,
};

/// What a function returns, as people read it: its value, or its own error; `ok` where there is no value.
///
/// ```
/// use rohrpost_modules::value::{Data, describe_result};
/// assert_eq!(describe_result(&<Result<(), u8>>::schema()), "ok, or error u8");
/// assert_eq!(describe_result(&f64::schema()), "f64");
/// ```
pub fn describe_result(ty: &OwnedNamedType) -> String {
    let value = |ty: &OwnedNamedType| if is_empty(ty, 0) { "ok".to_owned() } else { describe_type(ty) };
    match &ty.ty {
        Ty::Enum(variants) if ty.name.starts_with("Result<") => {
            let inner = variants.iter().map(|variant| match &variant.ty {
                VariantTy::NewtypeVariant(inner) => value(inner),
                // So postcard-schema describes the two variants of a `Result`.
                VariantTy::TupleVariant(inner) if inner.len() == 1 => value(&inner[0]),
                _ => "ok".to_owned(),
            });
            inner.collect::<Vec<_>>().join(", or error ")
        }
        _ => value(ty),
    }
}

/// Whether one word names any value of this type: a number, a bool, text, a character, or an enum whose variants
/// carry nothing. Maps with such keys are [`Value::Map`](super::Value::Map)s.
///
/// A tool reads an argument as JSON if it starts with `{`, `[` or `"` and its type is no word, else by
/// [`parse_argument`](super::parse_argument).
///
/// ```
/// use rohrpost_modules::{types::Pose, value::{Data, is_word}};
/// assert!(is_word(&u8::schema()) && is_word(&String::schema()));
/// assert!(!is_word(&Pose::schema()) && !is_word(&Option::<u8>::schema()));
/// ```
pub fn is_word(ty: &OwnedNamedType) -> bool {
    match &unwrapped(ty).ty {
        Ty::Bool | Ty::F32 | Ty::F64 | Ty::Char | Ty::String => true,
        Ty::Enum(variants) => variants.iter().all(|variant| variant.ty == VariantTy::UnitVariant),
        other => Integer::of(other).is_some(),
    }
}

/// The type inside of newtype structs: they add a name, no bytes, and nothing to a value.
pub(super) fn unwrapped(mut ty: &OwnedNamedType) -> &OwnedNamedType {
    while let Ty::NewtypeStruct(inner) = &ty.ty {
        ty = inner;
    }
    ty
}

/// Whether `Null` is among the values of this type, so that an option of it must mark its `Some`.
pub(super) fn is_nullable(ty: &OwnedNamedType) -> bool {
    matches!(unwrapped(ty).ty, Ty::Unit | Ty::UnitStruct | Ty::Option(_))
}

/// Whether a list of this type is a string of bytes.
pub(super) fn is_byte(ty: &OwnedNamedType) -> bool {
    unwrapped(ty).ty == Ty::U8
}

/// Whether no value of this type takes any byte.
pub(super) fn is_empty(ty: &OwnedNamedType, depth: usize) -> bool {
    let ty = unwrapped(ty);
    match &ty.ty {
        Ty::Unit | Ty::UnitStruct => true,
        // Too deep to be decoded anyway.
        Ty::Tuple(_) | Ty::TupleStruct(_) | Ty::Struct(_) if depth >= DEPTH_MAX => false,
        Ty::Tuple(elements) | Ty::TupleStruct(elements) => elements.iter().all(|element| is_empty(element, depth + 1)),
        Ty::Struct(fields) => fields.iter().all(|field| is_empty(&field.ty, depth + 1)),
        _ => false,
    }
}

/// The variant that a user means by `name`, and its number: the exact one, or else the only one that is the same but
/// for case, `-` and `_` (a description says `TurnLeft` where people type `turn-left`).
pub(super) fn find_variant<'a>(
    variants: &'a [OwnedNamedVariant],
    name: &str,
) -> Option<(usize, &'a OwnedNamedVariant)> {
    let plain = |name: &str| name.replace(['-', '_'], "").to_lowercase();
    let exact = variants.iter().enumerate().find(|(_, variant)| variant.name == name);
    exact.or_else(|| {
        let wanted = plain(name);
        let mut alike = variants.iter().enumerate().filter(|(_, variant)| plain(&variant.name) == wanted);
        alike.next().filter(|_| alike.next().is_none())
    })
}

/// What an error says that it expected.
pub(super) fn expectation(ty: &OwnedNamedType) -> String {
    let ty = unwrapped(ty);
    match &ty.ty {
        Ty::Bool => "true or false".into(),
        Ty::F32 => "a number (f32)".into(),
        Ty::F64 => "a number (f64)".into(),
        Ty::Char => "one character".into(),
        Ty::String => "text".into(),
        Ty::Option(inner) if !is_nullable(inner) => format!("{} or null", expectation(inner)),
        other => Integer::of(other).map_or_else(|| describe_type(ty), Integer::expectation),
    }
}

/// A type as a short text for help: how its values are typed. Deep and wide types end in `…`.
///
/// `f64` · `text` · `[f32]` · `[f64; 3]` · `[u8, text]` · `{x_m: f64, y_m: f64}` · `on|off` · `stop|{go: f64}` ·
/// `f64?` (may be null) · `{<text>: u8}` (a map)
///
/// ```
/// use rohrpost_modules::{types::Twist, value::{Data, describe_type}};
/// assert_eq!(describe_type(&Twist::schema()), "{speed_m_s: f64, turn_rate_rad_s: f64}");
/// ```
pub fn describe_type(ty: &OwnedNamedType) -> String {
    described(ty, 0)
}

/// Structs, lists and variants inside each other that are shown, and members of each.
const LEVELS: usize = 4;
const MEMBERS: usize = 12;

fn described(ty: &OwnedNamedType, level: usize) -> String {
    let ty = unwrapped(ty);
    if let Some(integer) = Integer::of(&ty.ty) {
        return integer.name.into();
    }
    let inner = |ty: &OwnedNamedType| described(ty, level + 1);
    match &ty.ty {
        Ty::Bool => "bool".into(),
        Ty::F32 => "f32".into(),
        Ty::F64 => "f64".into(),
        Ty::Char => "char".into(),
        Ty::String => "text".into(),
        Ty::ByteArray => "[u8]".into(),
        Ty::Unit | Ty::UnitStruct => "null".into(),
        Ty::Schema => "type".into(),
        _ if level >= LEVELS => "…".into(),
        Ty::Option(some) if is_nullable(some) => format!("{{Some: {}}}?", inner(some)),
        Ty::Option(some) => match inner(some) {
            choice if matches!(unwrapped(some).ty, Ty::Enum(_)) => format!("({choice})?"),
            other => format!("{other}?"),
        },
        Ty::Seq(element) => format!("[{}]", inner(element)),
        Ty::Tuple(elements) | Ty::TupleStruct(elements) => described_tuple(elements, level),
        Ty::Map { key, val } if is_word(key) => format!("{{<{}>: {}}}", inner(key), inner(val)),
        Ty::Map { key, val } => format!("[[{}, {}]]", inner(key), inner(val)),
        Ty::Struct(fields) => described_fields(fields, level),
        Ty::Enum(variants) => joined(variants, "|", |variant| described_variant(variant, level)),
        _ => "…".into(),
    }
}

fn described_tuple(elements: &[OwnedNamedType], level: usize) -> String {
    match elements {
        [first, second, rest @ ..] if first == second && rest.iter().all(|element| element == first) => {
            format!("[{}; {}]", described(first, level + 1), elements.len())
        }
        _ => format!("[{}]", joined(elements, ", ", |element| described(element, level + 1))),
    }
}

fn described_fields(fields: &[OwnedNamedValue], level: usize) -> String {
    let field = |field: &OwnedNamedValue| format!("{}: {}", field.name.escape_debug(), described(&field.ty, level + 1));
    format!("{{{}}}", joined(fields, ", ", field))
}

fn described_variant(variant: &OwnedNamedVariant, level: usize) -> String {
    let payload = match &variant.ty {
        VariantTy::UnitVariant => return variant.name.escape_debug().to_string(),
        VariantTy::NewtypeVariant(inner) => described(inner, level + 1),
        VariantTy::TupleVariant(elements) => match elements.as_slice() {
            [only] => described(only, level + 1),
            _ => described_tuple(elements, level),
        },
        VariantTy::StructVariant(fields) => described_fields(fields, level),
    };
    format!("{{{}: {payload}}}", variant.name.escape_debug())
}

fn joined<T>(members: &[T], separator: &str, text: impl Fn(&T) -> String) -> String {
    let mut parts: Vec<String> = members.iter().take(MEMBERS).map(text).collect();
    if members.len() > MEMBERS {
        parts.push("…".into());
    }
    parts.join(separator)
}
