//! From values to bytes.

use crate::{
    DEPTH_MAX, Field, Label, Members, Named, Type, Value, WalkError, WalkProblem,
    argument::parse_word,
    bytes::write_varint,
    scalar::{Integer, float, shortened},
    words::{expectation, find_variant, is_byte, is_nullable, is_word, unwrapped},
};

/// The bytes that a value of the described type has, the inverse of [`decode`](crate::decode).
///
/// Takes each value in the form that `decode` gives, and where only one thing can be meant also as JSON or a person
/// has it:
///
/// - numbers: `U`, `I` and `F` for each other if none loses its value in a whole number; as text (`"NaN"`, `"0x1f"`);
/// - text of one character for a character and back; a list of numbers for bytes;
/// - enums: `Text(name)`, or a `Map` of one entry with the payload; case, `-` and `_` in names of variants do not
///   matter as long as they name one;
/// - structs: fields in any order, optional ones left out;
/// - maps: a `List` of pairs.
///
/// ```
/// use rohrpost_schema::{Schema, Value, encode};
/// #[derive(Debug, PartialEq, serde::Deserialize, Schema)]
/// struct Twist { speed_m_s: f64, turn_rate_rad_s: f64 }
/// let value: Value = serde_json::from_str(r#"{"turn_rate_rad_s": "inf", "speed_m_s": 2}"#)?;
/// let twist: Twist = postcard::from_bytes(&encode(&Twist::schema(), &value)?)?;
/// assert_eq!(twist, Twist { speed_m_s: 2.0, turn_rate_rad_s: f64::INFINITY });
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// A value that does not fit the type, with the path to it and what was expected.
pub fn encode(ty: &Type, value: &Value) -> Result<Vec<u8>, WalkError> {
    let mut encoder = Encoder { bytes: Vec::new(), depth: 0 };
    encoder.value(ty, value)?;
    Ok(encoder.bytes)
}

struct Encoder {
    bytes: Vec<u8>,
    depth: usize,
}

impl Encoder {
    fn value(&mut self, ty: &Type, value: &Value) -> Result<(), WalkError> {
        if self.depth >= DEPTH_MAX {
            return Err(WalkProblem::TooDeep.into());
        }
        self.depth += 1;
        self.unbounded(unwrapped(ty), value)?;
        self.depth -= 1;
        Ok(())
    }

    fn unbounded(&mut self, ty: &Type, value: &Value) -> Result<(), WalkError> {
        if let Some(integer) = Integer::of(ty) {
            self.integer(integer, &integer.number(value)?);
            return Ok(());
        }
        match (ty, value) {
            (Type::Bool, Value::Bool(flag)) => self.bytes.push(u8::from(*flag)),
            (Type::F32, _) => self.bytes.extend((float("f32", value)? as f32).to_le_bytes()),
            (Type::F64, _) => self.bytes.extend(float("f64", value)?.to_le_bytes()),
            (Type::Char | Type::Text, Value::Char(char)) => self.counted(char.encode_utf8(&mut [0; 4]).as_bytes()),
            (Type::Char, Value::Text(text)) if text.chars().count() == 1 => self.counted(text.as_bytes()),
            (Type::Text, Value::Text(text)) => self.counted(text.as_bytes()),
            (Type::Bytes, Value::Bytes(bytes)) => self.counted(bytes),
            (Type::Bytes, Value::List(numbers)) => self.list_of_bytes(numbers)?,
            (Type::List(element), Value::Bytes(bytes)) if is_byte(element) => self.counted(bytes),
            (Type::Unit, Value::Null) => {}
            (Type::Option(_), Value::Null) => self.bytes.push(0),
            (Type::Option(inner), _) => {
                let some = if is_nullable(inner) { marked_some(ty, value)? } else { value };
                self.bytes.push(1);
                self.value(inner, some)?;
            }
            (Type::List(element), Value::List(values)) => {
                self.varint(values.len() as u128);
                self.list(values.iter().map(|value| (element.as_ref(), value)))?;
            }
            (Type::Array(length, element), Value::List(values)) => {
                self.tuple(*length as usize, values.iter().map(|_| element.as_ref()), values)?;
            }
            (Type::Tuple(types), Value::List(values)) => self.tuple(types.len(), types.iter(), values)?,
            (Type::Map(key, val), Value::Map(entries)) if is_word(key) => self.map(key, val, entries)?,
            (Type::Map(key, val), Value::List(pairs)) => self.pairs(ty, key, val, pairs)?,
            (Type::Struct(named), _) => self.members(&named.members, value).ok_or_else(|| mismatch(ty, value))??,
            (Type::Enum { variants, .. }, _) => self.variant(ty, variants, value)?,
            _ => return Err(mismatch(ty, value).into()),
        }
        Ok(())
    }

    fn list<'t>(&mut self, elements: impl Iterator<Item = (&'t Type, &'t Value)>) -> Result<(), WalkError> {
        for (index, (ty, value)) in elements.enumerate() {
            self.value(ty, value).map_err(|error| error.within_element(index))?;
        }
        Ok(())
    }

    fn list_of_bytes(&mut self, numbers: &[Value]) -> Result<(), WalkError> {
        self.varint(numbers.len() as u128);
        self.list(numbers.iter().map(|number| (&Type::U8, number)))
    }

    fn tuple<'t>(
        &mut self,
        expected: usize,
        types: impl Iterator<Item = &'t Type>,
        values: &'t [Value],
    ) -> Result<(), WalkError> {
        if expected != values.len() {
            return Err(WalkProblem::WrongLength { expected, got: values.len() }.into());
        }
        self.list(types.zip(values))
    }

    /// What a struct or variant has in it; none when the value is of another form.
    fn members(&mut self, members: &Members, value: &Value) -> Option<Result<(), WalkError>> {
        match (members, value) {
            (Members::None, Value::Null) => Some(Ok(())),
            (Members::One(field), _) => Some(self.value(&field.ty, value)),
            (Members::Tuple(fields), Value::List(values)) => {
                Some(self.tuple(fields.len(), fields.iter().map(|field| &field.ty), values))
            }
            (Members::Fields(fields), Value::Map(entries)) => Some(self.fields(fields, entries)),
            _ => None,
        }
    }

    fn map(&mut self, key: &Type, val: &Type, entries: &[(Label, Value)]) -> Result<(), WalkError> {
        self.varint(entries.len() as u128);
        for (name, value) in entries {
            let within = |error: WalkError| error.within(name);
            self.value(key, &parse_word(key, name).map_err(|problem| within(problem.into()))?).map_err(within)?;
            self.value(val, value).map_err(within)?;
        }
        Ok(())
    }

    fn pairs(&mut self, map: &Type, key: &Type, val: &Type, pairs: &[Value]) -> Result<(), WalkError> {
        self.varint(pairs.len() as u128);
        for (index, pair) in pairs.iter().enumerate() {
            let encoded = match pair {
                Value::List(parts) if parts.len() == 2 => self.list([key, val].into_iter().zip(parts)),
                other => Err(mismatch(map, other).into()),
            };
            encoded.map_err(|error| error.within_element(index))?;
        }
        Ok(())
    }

    fn fields(&mut self, fields: &[Field], entries: &[(Label, Value)]) -> Result<(), WalkError> {
        let mut used = 0;
        for (index, field) in fields.iter().enumerate() {
            // Mostly they stand in order; and by their place, fields that share a name are told apart.
            let in_place = entries.get(index).filter(|(name, _)| *name == *field.name);
            let entry = in_place.or_else(|| entries.iter().find(|(name, _)| *name == *field.name));
            used += usize::from(entry.is_some());
            let encoded = match entry {
                Some((_, value)) => self.value(&field.ty, value),
                None if is_nullable(&field.ty) => self.value(&field.ty, &Value::Null),
                None => Err(WalkProblem::FieldMissing { expected: expectation(&field.ty) }.into()),
            };
            encoded.map_err(|error| error.within(&field.name))?;
        }
        if used < entries.len() {
            return Err(surplus(fields, entries));
        }
        Ok(())
    }

    fn variant(&mut self, ty: &Type, variants: &[Named], value: &Value) -> Result<(), WalkError> {
        let (name, payload) = named(value).ok_or_else(|| mismatch(ty, value))?;
        let (index, variant) = find_variant(variants, name).ok_or_else(|| mismatch(ty, value))?;
        self.varint(index as u128);
        let payload = match (&variant.members, payload) {
            // All of them are optional, or it is a mistake that says which is not given.
            (Members::Fields(_), Value::Null) => &Value::Map(Vec::new()),
            _ => payload,
        };
        let encoded = self.members(&variant.members, payload).ok_or_else(|| mismatch(ty, value))?;
        encoded.map_err(|error| error.within(&variant.name))
    }

    fn integer(&mut self, integer: Integer, number: &Value) {
        match (number, integer.bits) {
            (Value::U(n), 8) => self.bytes.push(*n as u8),
            (Value::I(n), 8) => self.bytes.push(*n as u8),
            (Value::U(n), _) => self.varint(*n),
            (Value::I(n), _) => self.varint((n << 1 ^ n >> 127) as u128),
            _ => unreachable!("Integer::number gives integers"),
        }
    }

    fn varint(&mut self, number: u128) {
        write_varint(&mut self.bytes, number);
    }

    fn counted(&mut self, bytes: &[u8]) {
        self.varint(bytes.len() as u128);
        self.bytes.extend_from_slice(bytes);
    }
}

/// The name and the payload of a choice, in each form that an enum may be given in.
fn named(value: &Value) -> Option<(&str, &Value)> {
    match value {
        Value::Variant(name, payload) => Some((name, payload)),
        Value::Text(name) => Some((name, &Value::Null)),
        Value::Map(entries) => match entries.as_slice() {
            [(name, payload)] => Some((name, payload)),
            _ => None,
        },
        _ => None,
    }
}

/// What is inside of a `Some` of which the value itself may be `Null`.
fn marked_some<'v>(ty: &Type, value: &'v Value) -> Result<&'v Value, WalkProblem> {
    match named(value) {
        Some(("Some", payload)) => Ok(payload),
        _ => Err(mismatch(ty, value)),
    }
}

/// All fields found their entries, but there are more entries: either unknown ones, or one of them twice.
fn surplus(fields: &[Field], entries: &[(Label, Value)]) -> WalkError {
    let unknown = entries.iter().find(|(name, _)| fields.iter().all(|field| *name != *field.name));
    if let Some((name, _)) = unknown {
        let known: Vec<_> = fields.iter().map(|field| field.name.escape_debug().to_string()).collect();
        let known = if known.is_empty() { "none".into() } else { known.join(", ") };
        return WalkError::from(WalkProblem::FieldUnknown { known }).within(name);
    }
    let twice = entries.iter().enumerate().find(|(index, (name, _))| entries[..*index].iter().any(|(n, _)| n == name));
    WalkError::from(WalkProblem::FieldTwice).within(twice.map_or("", |(_, (name, _))| name))
}

fn mismatch(ty: &Type, value: &Value) -> WalkProblem {
    let got = match value {
        Value::Text(text) => shortened(text),
        other => shortened(&other.display(4).to_string()),
    };
    WalkProblem::Expected { expected: expectation(ty), got }
}
