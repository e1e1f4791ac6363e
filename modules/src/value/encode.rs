//! From values to bytes.

use super::{
    DEPTH_MAX, Value, WalkError, WalkProblem,
    argument::parse_word,
    meta,
    scalar::{Integer, float, shortened},
    types::{expectation, find_variant, is_byte, is_nullable, is_word, unwrapped},
};
use postcard_schema::schema::owned::{
    OwnedDataModelType as Ty, OwnedDataModelVariant as VariantTy, OwnedNamedType, OwnedNamedValue, OwnedNamedVariant,
};

/// The bytes that a value of the described type has, the inverse of [`decode`](super::decode).
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
/// use rohrpost_modules::{types::Twist, value::{Data, Value, encode}};
/// let value: Value = serde_json::from_str(r#"{"turn_rate_rad_s": "inf", "speed_m_s": 2}"#)?;
/// let twist: Twist = postcard::from_bytes(&encode(&Twist::schema(), &value)?)?;
/// assert_eq!(twist, Twist { speed_m_s: 2.0, turn_rate_rad_s: f64::INFINITY });
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// A value that does not fit the type, with the path to it and what was expected.
pub fn encode(ty: &OwnedNamedType, value: &Value) -> Result<Vec<u8>, WalkError> {
    let mut encoder = Encoder { bytes: Vec::new(), depth: 0 };
    encoder.value(ty, value)?;
    Ok(encoder.bytes)
}

struct Encoder {
    bytes: Vec<u8>,
    depth: usize,
}

impl Encoder {
    fn value(&mut self, ty: &OwnedNamedType, value: &Value) -> Result<(), WalkError> {
        if self.depth >= DEPTH_MAX {
            return Err(WalkProblem::TooDeep.into());
        }
        self.depth += 1;
        self.unbounded(unwrapped(ty), value)?;
        self.depth -= 1;
        Ok(())
    }

    fn unbounded(&mut self, ty: &OwnedNamedType, value: &Value) -> Result<(), WalkError> {
        if let Some(integer) = Integer::of(&ty.ty) {
            self.integer(integer, &integer.number(value)?);
            return Ok(());
        }
        match (&ty.ty, value) {
            (Ty::Bool, Value::Bool(flag)) => self.bytes.push(u8::from(*flag)),
            (Ty::F32, _) => self.bytes.extend((float("f32", value)? as f32).to_le_bytes()),
            (Ty::F64, _) => self.bytes.extend(float("f64", value)?.to_le_bytes()),
            (Ty::Char | Ty::String, Value::Char(char)) => self.counted(char.encode_utf8(&mut [0; 4]).as_bytes()),
            (Ty::Char, Value::Text(text)) if text.chars().count() == 1 => self.counted(text.as_bytes()),
            (Ty::String, Value::Text(text)) => self.counted(text.as_bytes()),
            (Ty::ByteArray, Value::Bytes(bytes)) => self.counted(bytes),
            (Ty::ByteArray, Value::List(numbers)) => self.list_of_bytes(numbers)?,
            (Ty::Seq(element), Value::Bytes(bytes)) if is_byte(element) => self.counted(bytes),
            (Ty::Unit | Ty::UnitStruct, Value::Null) => {}
            (Ty::Option(_), Value::Null) => self.bytes.push(0),
            (Ty::Option(inner), _) => {
                let some = if is_nullable(inner) { marked_some(ty, value)? } else { value };
                self.bytes.push(1);
                self.value(inner, some)?;
            }
            (Ty::Seq(element), Value::List(values)) => {
                self.varint(values.len() as u128);
                self.list(values.iter().map(|value| (element.as_ref(), value)))?;
            }
            (Ty::Tuple(types) | Ty::TupleStruct(types), Value::List(values)) => self.tuple(types, values)?,
            (Ty::Map { key, val }, Value::Map(entries)) if is_word(key) => self.map(key, val, entries)?,
            (Ty::Map { key, val }, Value::List(pairs)) => self.pairs(ty, key, val, pairs)?,
            (Ty::Struct(fields), Value::Map(entries)) => self.fields(fields, entries)?,
            (Ty::Enum(variants), _) => self.variant(ty, variants, value)?,
            (Ty::Schema, _) => self.value(&meta::DESCRIPTION, value)?,
            _ => return Err(mismatch(ty, value).into()),
        }
        Ok(())
    }

    fn list<'t>(&mut self, elements: impl Iterator<Item = (&'t OwnedNamedType, &'t Value)>) -> Result<(), WalkError> {
        for (index, (ty, value)) in elements.enumerate() {
            self.value(ty, value).map_err(|error| error.within_element(index))?;
        }
        Ok(())
    }

    fn list_of_bytes(&mut self, numbers: &[Value]) -> Result<(), WalkError> {
        let byte = OwnedNamedType { name: String::new(), ty: Ty::U8 };
        self.varint(numbers.len() as u128);
        self.list(numbers.iter().map(|number| (&byte, number)))
    }

    fn tuple(&mut self, types: &[OwnedNamedType], values: &[Value]) -> Result<(), WalkError> {
        if types.len() != values.len() {
            return Err(WalkProblem::WrongLength { expected: types.len(), got: values.len() }.into());
        }
        self.list(types.iter().zip(values))
    }

    fn map(
        &mut self,
        key: &OwnedNamedType,
        val: &OwnedNamedType,
        entries: &[(String, Value)],
    ) -> Result<(), WalkError> {
        self.varint(entries.len() as u128);
        for (name, value) in entries {
            let within = |error: WalkError| error.within(name);
            self.value(key, &parse_word(key, name).map_err(|problem| within(problem.into()))?).map_err(within)?;
            self.value(val, value).map_err(within)?;
        }
        Ok(())
    }

    fn pairs(
        &mut self,
        map: &OwnedNamedType,
        key: &OwnedNamedType,
        val: &OwnedNamedType,
        pairs: &[Value],
    ) -> Result<(), WalkError> {
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

    fn fields(&mut self, fields: &[OwnedNamedValue], entries: &[(String, Value)]) -> Result<(), WalkError> {
        let mut used = 0;
        for (index, field) in fields.iter().enumerate() {
            // Mostly they stand in order; and by their place, fields that share a name are told apart.
            let in_place = entries.get(index).filter(|(name, _)| *name == field.name);
            let entry = in_place.or_else(|| entries.iter().find(|(name, _)| *name == field.name));
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

    fn variant(&mut self, ty: &OwnedNamedType, variants: &[OwnedNamedVariant], value: &Value) -> Result<(), WalkError> {
        let (name, payload) = named(value).ok_or_else(|| mismatch(ty, value))?;
        let (index, variant) = find_variant(variants, name).ok_or_else(|| mismatch(ty, value))?;
        self.varint(index as u128);
        let encoded = match (&variant.ty, payload) {
            (VariantTy::UnitVariant, Value::Null) => Ok(()),
            (VariantTy::NewtypeVariant(inner), _) => self.value(inner, payload),
            (VariantTy::TupleVariant(types), _) if types.len() == 1 => self.value(&types[0], payload),
            (VariantTy::TupleVariant(types), Value::List(values)) => self.tuple(types, values),
            (VariantTy::StructVariant(fields), Value::Map(entries)) => self.fields(fields, entries),
            (VariantTy::StructVariant(fields), Value::Null) => self.fields(fields, &[]),
            _ => return Err(mismatch(ty, value).into()),
        };
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

    fn varint(&mut self, mut number: u128) {
        while number >= 0x80 {
            self.bytes.push(number as u8 | 0x80);
            number >>= 7;
        }
        self.bytes.push(number as u8);
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
fn marked_some<'v>(ty: &OwnedNamedType, value: &'v Value) -> Result<&'v Value, WalkProblem> {
    match named(value) {
        Some(("Some", payload)) => Ok(payload),
        _ => Err(mismatch(ty, value)),
    }
}

/// All fields found their entries, but there are more entries: either unknown ones, or one of them twice.
fn surplus(fields: &[OwnedNamedValue], entries: &[(String, Value)]) -> WalkError {
    let unknown = entries.iter().find(|(name, _)| fields.iter().all(|field| field.name != *name));
    if let Some((name, _)) = unknown {
        let known: Vec<_> = fields.iter().map(|field| field.name.escape_debug().to_string()).collect();
        let known = if known.is_empty() { "none".into() } else { known.join(", ") };
        return WalkError::from(WalkProblem::FieldUnknown { known }).within(name);
    }
    let twice = entries.iter().enumerate().find(|(index, (name, _))| entries[..*index].iter().any(|(n, _)| n == name));
    WalkError::from(WalkProblem::FieldTwice).within(twice.map_or("", |(_, (name, _))| name))
}

fn mismatch(ty: &OwnedNamedType, value: &Value) -> WalkProblem {
    let got = match value {
        Value::Text(text) => shortened(text),
        other => shortened(&other.display(4).to_string()),
    };
    WalkProblem::Expected { expected: expectation(ty), got }
}
