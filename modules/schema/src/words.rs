//! Questions about a description: how it reads, and which form its values take.

use crate::{Field, Members, Named, Type, scalar::Integer};

/// What a function returns, as people read it: its value, or its own error; `ok` where there is no value.
///
/// ```
/// use rohrpost_schema::{Schema, describe_result};
/// assert_eq!(describe_result(&<Result<(), u8>>::schema()), "ok, or error u8");
/// assert_eq!(describe_result(&f64::schema()), "f64");
/// ```
pub fn describe_result(ty: &Type) -> String {
    let value = |ty: &Type| if is_empty(ty) { "ok".to_owned() } else { describe_type(ty) };
    match ty {
        Type::Enum { name, variants, .. } if name == "Result" => {
            let inner = variants.iter().map(|variant| match &variant.members {
                Members::One(field) => value(&field.ty),
                _ => "ok".to_owned(),
            });
            inner.collect::<Vec<_>>().join(", or error ")
        }
        _ => value(ty),
    }
}

/// Whether one word names any value of this type: a number, a bool, text, a character, or an enum with variants that
/// carry nothing. Maps with such keys are [`Value::Map`](crate::Value::Map)s.
///
/// A tool reads an argument as JSON if it starts with `{`, `[` or `"` and its type is no word, else by
/// [`parse_argument`](crate::parse_argument).
///
/// ```
/// use rohrpost_schema::{Schema, is_word};
/// assert!(is_word(&u8::schema()) && is_word(&String::schema()));
/// assert!(!is_word(&<(f64, f64)>::schema()) && !is_word(&Option::<u8>::schema()));
/// ```
pub fn is_word(ty: &Type) -> bool {
    match unwrapped(ty) {
        Type::Bool | Type::F32 | Type::F64 | Type::Char | Type::Text => true,
        Type::Enum { variants, .. } => variants.iter().all(|variant| variant.members == Members::None),
        other => Integer::of(other).is_some(),
    }
}

/// The type inside of newtype structs: they add a name, no bytes, and nothing to a value.
pub(crate) fn unwrapped(mut ty: &Type) -> &Type {
    while let Type::Struct(Named { members: Members::One(field), .. }) = ty {
        ty = &field.ty;
    }
    ty
}

/// Whether `Null` is among the values of this type, so that an option of it must mark its `Some`.
pub(crate) fn is_nullable(ty: &Type) -> bool {
    matches!(unwrapped(ty), Type::Unit | Type::Option(_) | Type::Struct(Named { members: Members::None, .. }))
}

/// Whether a list of this type is a string of bytes.
pub(crate) fn is_byte(ty: &Type) -> bool {
    *unwrapped(ty) == Type::U8
}

/// Whether no value of this type takes any byte.
pub(crate) fn is_empty(ty: &Type) -> bool {
    match ty {
        Type::Unit => true,
        Type::Array(length, element) => *length == 0 || is_empty(element),
        Type::Tuple(elements) => elements.iter().all(is_empty),
        Type::Struct(named) => named.members.fields().iter().all(|field| is_empty(&field.ty)),
        _ => false,
    }
}

/// The variant that a user means by `name`, and its number: the exact one, or else the only one that is the same but
/// for case, `-` and `_` (a description says `TurnLeft` where people type `turn-left`).
pub(crate) fn find_variant<'a>(variants: &'a [Named], name: &str) -> Option<(usize, &'a Named)> {
    let plain = |name: &str| name.replace(['-', '_'], "").to_lowercase();
    let exact = variants.iter().enumerate().find(|(_, variant)| variant.name == name);
    exact.or_else(|| {
        let wanted = plain(name);
        let mut alike = variants.iter().enumerate().filter(|(_, variant)| plain(&variant.name) == wanted);
        alike.next().filter(|_| alike.next().is_none())
    })
}

/// What an error says that it expected.
pub(crate) fn expectation(ty: &Type) -> String {
    let ty = unwrapped(ty);
    match ty {
        Type::Bool => "true or false".into(),
        Type::F32 => "a number (f32)".into(),
        Type::F64 => "a number (f64)".into(),
        Type::Char => "one character".into(),
        Type::Text => "text".into(),
        Type::Option(inner) if !is_nullable(inner) => format!("{} or null", expectation(inner)),
        other => Integer::of(other).map_or_else(|| describe_type(ty), Integer::expectation),
    }
}

/// A type as a short text for help: how its values are typed. Deep and wide types end in `…`.
///
/// `f64` · `text` · `[f32]` · `[f64; 3]` · `[u8, text]` · `{x_m: f64, y_m: f64}` · `on|off` · `stop|{go: f64}` ·
/// `f64?` (may be null) · `{<text>: u8}` (a map)
///
/// ```
/// use rohrpost_schema::{Schema, describe_type};
/// assert_eq!(describe_type(&<(u8, Option<[f64; 3]>)>::schema()), "[u8, [f64; 3]?]");
/// ```
pub fn describe_type(ty: &Type) -> String {
    described(ty, 0)
}

/// A name as it may stand among others; somebody else has given it, and it may be empty.
fn shown(name: &str) -> String {
    if name.is_empty() { "\"\"".into() } else { name.escape_debug().to_string() }
}

/// Structs, lists and variants inside each other that are shown, and members of each.
const LEVELS: usize = 4;
const MEMBERS: usize = 12;

fn described(ty: &Type, level: usize) -> String {
    let ty = unwrapped(ty);
    if let Some(integer) = Integer::of(ty) {
        return integer.name.into();
    }
    let inner = |ty: &Type| described(ty, level + 1);
    match ty {
        Type::Bool => "bool".into(),
        Type::F32 => "f32".into(),
        Type::F64 => "f64".into(),
        Type::Char => "char".into(),
        Type::Text => "text".into(),
        Type::Bytes => "[u8]".into(),
        Type::Unit => "null".into(),
        _ if level >= LEVELS => "…".into(),
        Type::Option(some) if is_nullable(some) => format!("{{Some: {}}}?", inner(some)),
        Type::Option(some) => match inner(some) {
            choice if matches!(unwrapped(some), Type::Enum { .. }) => format!("({choice})?"),
            other => format!("{other}?"),
        },
        Type::List(element) => format!("[{}]", inner(element)),
        Type::Array(length, element) => format!("[{}; {length}]", inner(element)),
        Type::Tuple(elements) => described_tuple(&elements.iter().collect::<Vec<_>>(), level),
        Type::Map(key, value) if is_word(key) => format!("{{<{}>: {}}}", inner(key), inner(value)),
        Type::Map(key, value) => format!("[[{}, {}]]", inner(key), inner(value)),
        Type::Struct(named) => described_members(&named.members, level),
        Type::Enum { variants, .. } if variants.is_empty() => "(no value)".into(),
        Type::Enum { variants, .. } => joined(variants, "|", |variant| match variant.members {
            Members::None => shown(&variant.name),
            _ => format!("{{{}: {}}}", shown(&variant.name), described_members(&variant.members, level)),
        }),
        _ => "…".into(),
    }
}

fn described_tuple(elements: &[&Type], level: usize) -> String {
    match elements {
        [first, second, rest @ ..] if first == second && rest.iter().all(|element| element == first) => {
            format!("[{}; {}]", described(first, level + 1), elements.len())
        }
        _ => format!("[{}]", joined(elements, ", ", |element| described(element, level + 1))),
    }
}

fn described_members(members: &Members, level: usize) -> String {
    match members {
        Members::None => "null".into(),
        Members::One(field) => described(&field.ty, level + 1),
        Members::Tuple(fields) => described_tuple(&fields.iter().map(|field| &field.ty).collect::<Vec<_>>(), level),
        Members::Fields(fields) => {
            let field = |field: &Field| format!("{}: {}", shown(&field.name), described(&field.ty, level + 1));
            format!("{{{}}}", joined(fields, ", ", field))
        }
    }
}

/// An argument, data or a field with its type, unit and range.
///
/// ```
/// use rohrpost_schema::{Field, Type, describe_field};
/// let speed = Field::new("speed", Type::F64).said("Forward.", "m/s");
/// assert_eq!(describe_field(&speed), "speed: f64 m/s");
/// let most = postcard::to_stdvec(&1.5).ok();
/// assert_eq!(describe_field(&speed.bounded(None, most)), "speed: f64, at most 1.5 m/s");
/// ```
pub fn describe_field(field: &Field) -> String {
    let mut text = format!("{}: {}", field.name.escape_debug(), describe_type(&field.ty));
    if let Some(range) = field.range() {
        text += &format!(", {}", range.escape_debug());
    }
    if !field.unit.is_empty() {
        text += &format!(" {}", field.unit.escape_debug());
    }
    text
}

fn joined<T>(members: &[T], separator: &str, text: impl Fn(&T) -> String) -> String {
    let mut parts: Vec<String> = members.iter().take(MEMBERS).map(text).collect();
    if members.len() > MEMBERS {
        parts.push("…".into());
    }
    parts.join(separator)
}
