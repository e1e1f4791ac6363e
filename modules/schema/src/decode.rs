//! From bytes to values.

use crate::{
    DEPTH_MAX, Field, Label, Members, Named, Type, Value, WalkError, WalkProblem,
    budget::Budget,
    bytes::read_varint,
    scalar::{Integer, shortest},
    show::word,
    words::{is_byte, is_empty, is_nullable, is_word, unwrapped},
};
use std::collections::HashMap;

/// The value that `bytes`, all of them, hold according to their description.
///
/// Accepts what postcard accepts for the described type, save characters with further text behind them. What a type
/// checks by itself (`NonZeroU8`, its own `Deserialize`) is not in the description and not checked.
///
/// ```
/// use rohrpost_schema::{Schema, Value, decode};
/// let bytes = postcard::to_stdvec(&(7u8, vec!['a'], Some(f32::INFINITY)))?;
/// let value = decode(&<(u8, Vec<char>, Option<f32>)>::schema(), &bytes)?;
/// assert_eq!(value, Value::List(vec![Value::U(7), Value::List(vec![Value::Char('a')]), Value::F(f64::INFINITY)]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// Bytes that are cut, that go on, that another type wrote, or that would become more values than a message of their
/// length may have ([`VALUES_MAX`](crate::VALUES_MAX)), with the path to the place where it showed.
pub fn decode(ty: &Type, bytes: &[u8]) -> Result<Value, WalkError> {
    let mut decoder = Decoder { bytes, depth: 0, budget: Budget::of_message(bytes.len()), asked: Asked::default() };
    let value = decoder.value(ty)?;
    match decoder.bytes.len() {
        0 => Ok(value),
        bytes => Err(WalkProblem::BytesLeft { bytes }.into()),
    }
}

struct Decoder<'a> {
    /// What is not read yet.
    bytes: &'a [u8],
    depth: usize,
    budget: Budget,
    asked: Asked,
}

/// What was asked of the description, by where that is: once a message, not once a value. The description does not
/// move as long as it is borrowed.
#[derive(Default)]
struct Asked {
    labels: HashMap<*const u8, Label>,
    empty: HashMap<*const Type, bool>,
    words: HashMap<*const Type, bool>,
}

impl Asked {
    fn label(&mut self, name: &str) -> Label {
        self.labels.entry(name.as_ptr()).or_insert_with(|| name.into()).clone()
    }

    fn is_empty(&mut self, ty: &Type) -> bool {
        match ty {
            Type::Array(..) | Type::Tuple(_) | Type::Struct(_) => *self.empty.entry(ty).or_insert_with(|| is_empty(ty)),
            ty => is_empty(ty),
        }
    }

    fn is_word(&mut self, ty: &Type) -> bool {
        match unwrapped(ty) {
            choice @ Type::Enum { .. } => *self.words.entry(choice).or_insert_with(|| is_word(choice)),
            ty => is_word(ty),
        }
    }
}

impl<'a> Decoder<'a> {
    fn value(&mut self, ty: &Type) -> Result<Value, WalkError> {
        if self.depth >= DEPTH_MAX {
            return Err(WalkProblem::TooDeep.into());
        }
        self.budget.value()?;
        let before = self.bytes.len();
        self.depth += 1;
        let value = self.unbounded(unwrapped(ty))?;
        self.depth -= 1;
        if self.bytes.len() == before {
            self.budget.empty()?;
        }
        Ok(value)
    }

    fn unbounded(&mut self, ty: &Type) -> Result<Value, WalkError> {
        if let Some(integer) = Integer::of(ty) {
            return Ok(self.integer(integer)?);
        }
        match ty {
            Type::Bool => Ok(Value::Bool(self.flag()?)),
            Type::F32 => Ok(Value::F(shortest(f32::from_le_bytes(self.array()?)))),
            Type::F64 => Ok(Value::F(f64::from_le_bytes(self.array()?))),
            Type::Char => Ok(Value::Char(self.char()?)),
            Type::Text => Ok(Value::Text(self.text()?.to_owned())),
            Type::Bytes => Ok(Value::Bytes(self.counted()?.to_vec())),
            Type::List(element) if is_byte(element) => Ok(Value::Bytes(self.counted()?.to_vec())),
            Type::Unit => Ok(Value::Null),
            Type::Option(inner) => match self.flag()? {
                false => Ok(Value::Null),
                true if is_nullable(inner) => {
                    Ok(Value::Variant(self.asked.label("Some"), Box::new(self.value(inner)?)))
                }
                true => self.value(inner),
            },
            Type::List(element) => {
                let is_empty = self.asked.is_empty(element);
                let length = self.length(is_empty)?;
                self.many(length, element, is_empty)
            }
            Type::Array(length, element) => {
                let is_empty = self.asked.is_empty(element);
                let length = self.fixed_length(*length, is_empty)?;
                self.many(length, element, is_empty)
            }
            Type::Tuple(elements) => self.list(elements.iter()),
            Type::Map(key, value) => self.map(key, value),
            Type::Struct(named) => self.members(&named.members),
            Type::Enum { variants, .. } => self.variant(variants),
            _ => unreachable!("integers are read above"),
        }
    }

    /// So many elements. What is too much is refused before it is made.
    fn many(&mut self, length: usize, element: &Type, is_empty: bool) -> Result<Value, WalkError> {
        if matches!(unwrapped(element), Type::F32 | Type::F64) {
            self.budget.credit(length);
        }
        if !is_empty {
            self.budget.has_room(length)?;
        }
        self.list((0..length).map(|_| element))
    }

    fn list<'t>(&mut self, types: impl Iterator<Item = &'t Type>) -> Result<Value, WalkError> {
        let elements = types.enumerate().map(|(index, ty)| self.value(ty).map_err(|error| error.within_element(index)));
        Ok(Value::List(elements.collect::<Result<_, _>>()?))
    }

    fn members(&mut self, members: &Members) -> Result<Value, WalkError> {
        match members {
            Members::None => Ok(Value::Null),
            Members::One(field) => self.value(&field.ty),
            Members::Tuple(fields) => self.list(fields.iter().map(|field| &field.ty)),
            Members::Fields(fields) => self.fields(fields),
        }
    }

    fn fields(&mut self, fields: &[Field]) -> Result<Value, WalkError> {
        let entry = |field: &Field| -> Result<_, WalkError> {
            let value = self.field(field).map_err(|error| error.within(&field.name))?;
            Ok((self.asked.label(&field.name), value))
        };
        Ok(Value::Map(fields.iter().map(entry).collect::<Result<_, _>>()?))
    }

    fn field(&mut self, field: &Field) -> Result<Value, WalkError> {
        self.budget.name(&field.name)?;
        self.value(&field.ty)
    }

    fn map(&mut self, key: &Type, val: &Type) -> Result<Value, WalkError> {
        let is_empty = self.asked.is_empty(key) && self.asked.is_empty(val);
        let length = self.length(is_empty)?;
        if !self.asked.is_word(key) {
            let mut pairs = Vec::new();
            for index in 0..length {
                pairs.push(self.pair(key, val).map_err(|error| error.within_element(index))?);
            }
            return Ok(Value::List(pairs));
        }
        let mut entries = Vec::new();
        for index in 0..length {
            let name = word(&self.value(key).map_err(|error| error.within_element(index))?);
            let value = self.value(val).map_err(|error| error.within(&name))?;
            entries.push((name, value));
        }
        Ok(Value::Map(entries))
    }

    fn pair(&mut self, key: &Type, val: &Type) -> Result<Value, WalkError> {
        self.budget.value()?;
        self.list([key, val].into_iter())
    }

    fn variant(&mut self, variants: &[Named]) -> Result<Value, WalkError> {
        let index = self.varint(32)? as u64;
        let known = usize::try_from(index).ok().and_then(|index| variants.get(index));
        let variant = known.ok_or(WalkProblem::NoSuchVariant { index, known: variants.len() })?;
        let payload = self.payload(variant).map_err(|error| error.within(&variant.name))?;
        Ok(Value::Variant(self.asked.label(&variant.name), Box::new(payload)))
    }

    fn payload(&mut self, variant: &Named) -> Result<Value, WalkError> {
        self.budget.name(&variant.name)?;
        self.members(&variant.members)
    }

    /// The length of a list, refused if each element takes a byte and there are fewer bytes.
    fn length(&mut self, elements_empty: bool) -> Result<usize, WalkProblem> {
        let claimed = self.varint(64)? as u64;
        let left = self.bytes.len();
        match usize::try_from(claimed) {
            _ if elements_empty => self.budget.room_for_empty(claimed),
            Ok(length) if length <= left => Ok(length),
            _ => Err(WalkProblem::LengthClaimed { claimed, left }),
        }
    }

    /// The length of an array, refused likewise: its type may say any.
    fn fixed_length(&self, length: u32, elements_empty: bool) -> Result<usize, WalkProblem> {
        match (length as usize).checked_sub(self.bytes.len()) {
            _ if elements_empty => self.budget.room_for_empty(length.into()),
            None | Some(0) => Ok(length as usize),
            Some(bytes) => Err(WalkProblem::BytesMissing { bytes }),
        }
    }

    fn integer(&mut self, integer: Integer) -> Result<Value, WalkProblem> {
        match (integer.signed, integer.bits) {
            (false, 8) => Ok(Value::U(u128::from(self.byte()?))),
            (true, 8) => Ok(Value::I(i128::from(self.byte()? as i8))),
            (false, bits) => Ok(Value::U(self.varint(bits)?)),
            (true, bits) => {
                let zigzag = self.varint(bits)?;
                Ok(Value::I((zigzag >> 1) as i128 ^ -((zigzag & 1) as i128)))
            }
        }
    }

    fn varint(&mut self, bits: u32) -> Result<u128, WalkProblem> {
        read_varint(bits, || self.byte())?.ok_or(WalkProblem::BadNumber { bits })
    }

    fn char(&mut self) -> Result<char, WalkProblem> {
        let mut chars = self.text()?.chars();
        match (chars.next(), chars.next()) {
            (Some(char), None) => Ok(char),
            _ => Err(WalkProblem::BadChar),
        }
    }

    fn text(&mut self) -> Result<&'a str, WalkProblem> {
        std::str::from_utf8(self.counted()?).map_err(|_| WalkProblem::BadText)
    }

    fn flag(&mut self) -> Result<bool, WalkProblem> {
        match self.byte()? {
            0 => Ok(false),
            1 => Ok(true),
            got => Err(WalkProblem::BadFlag { got }),
        }
    }

    /// A length and so many bytes.
    fn counted(&mut self) -> Result<&'a [u8], WalkProblem> {
        let length = self.varint(64)?;
        self.take(usize::try_from(length).unwrap_or(usize::MAX))
    }

    fn byte(&mut self) -> Result<u8, WalkProblem> {
        Ok(self.take(1)?[0])
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], WalkProblem> {
        let missing = WalkProblem::BytesMissing { bytes: N.saturating_sub(self.bytes.len()) };
        let (array, rest) = self.bytes.split_first_chunk().ok_or(missing)?;
        self.bytes = rest;
        Ok(*array)
    }

    fn take(&mut self, length: usize) -> Result<&'a [u8], WalkProblem> {
        let missing = WalkProblem::BytesMissing { bytes: length.saturating_sub(self.bytes.len()) };
        let (taken, rest) = self.bytes.split_at_checked(length).ok_or(missing)?;
        self.bytes = rest;
        Ok(taken)
    }
}
