//! From bytes to values.

use crate::{
    DEPTH_MAX, EMPTY_MAX, Field, Members, Named, Type, Value, WalkError, WalkProblem,
    bytes::read_varint,
    scalar::{Integer, shortest},
    show::word,
    words::{is_byte, is_empty, is_nullable, is_word, unwrapped},
};

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
/// Bytes that are cut, that go on, or that another type wrote, with the path to the place where it showed.
pub fn decode(ty: &Type, bytes: &[u8]) -> Result<Value, WalkError> {
    let mut decoder = Decoder { bytes, depth: 0, empty_left: EMPTY_MAX };
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
    /// How many more values may take no bytes.
    empty_left: usize,
}

impl<'a> Decoder<'a> {
    fn value(&mut self, ty: &Type) -> Result<Value, WalkError> {
        if self.depth >= DEPTH_MAX {
            return Err(WalkProblem::TooDeep.into());
        }
        let before = self.bytes.len();
        self.depth += 1;
        let value = self.unbounded(unwrapped(ty))?;
        self.depth -= 1;
        if self.bytes.len() == before {
            self.empty_left = self.empty_left.checked_sub(1).ok_or(WalkProblem::TooManyEmpty)?;
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
                true if is_nullable(inner) => Ok(Value::Variant("Some".into(), Box::new(self.value(inner)?))),
                true => self.value(inner),
            },
            Type::List(element) => {
                let length = self.length(is_empty(element))?;
                self.list((0..length).map(|_| element.as_ref()))
            }
            Type::Array(length, element) => self.list((0..*length).map(|_| element.as_ref())),
            Type::Tuple(elements) => self.list(elements.iter()),
            Type::Map(key, value) => self.map(key, value),
            Type::Struct(named) => self.members(&named.members),
            Type::Enum { variants, .. } => self.variant(variants),
            _ => unreachable!("integers are read above"),
        }
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
        let entry = |field: &Field| match self.value(&field.ty) {
            Ok(value) => Ok((field.name.clone(), value)),
            Err(error) => Err(error.within(&field.name)),
        };
        Ok(Value::Map(fields.iter().map(entry).collect::<Result<_, WalkError>>()?))
    }

    fn map(&mut self, key: &Type, val: &Type) -> Result<Value, WalkError> {
        let length = self.length(is_empty(key) && is_empty(val))?;
        if !is_word(key) {
            let mut pairs = Vec::new();
            for index in 0..length {
                let pair = self.list([key, val].into_iter()).map_err(|error| error.within_element(index))?;
                pairs.push(pair);
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

    fn variant(&mut self, variants: &[Named]) -> Result<Value, WalkError> {
        let index = self.varint(32)? as u64;
        let known = usize::try_from(index).ok().and_then(|index| variants.get(index));
        let variant = known.ok_or(WalkProblem::NoSuchVariant { index, known: variants.len() })?;
        let payload = self.members(&variant.members).map_err(|error| error.within(&variant.name))?;
        Ok(Value::Variant(variant.name.clone(), Box::new(payload)))
    }

    /// The length of a list, refused if each element takes a byte and there are fewer bytes.
    fn length(&mut self, elements_empty: bool) -> Result<usize, WalkProblem> {
        let claimed = self.varint(64)? as u64;
        let left = self.bytes.len();
        match usize::try_from(claimed) {
            Ok(length) if elements_empty && length <= self.empty_left => Ok(length),
            _ if elements_empty => Err(WalkProblem::TooManyEmpty),
            Ok(length) if length <= left => Ok(length),
            _ => Err(WalkProblem::LengthClaimed { claimed, left }),
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
