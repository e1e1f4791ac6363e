//! Types as bytes, by the table in `docs/src/wire.md`.
//!
//! What reads believes nothing: depth, number of types and all lengths are bounded before anything is made of them.

use crate::{DEPTH_MAX, Field, Members, Named, Type};
use std::hash::Hasher;

/// Version of the table. What is stored or sent begins with it.
pub const VERSION: u8 = 2;

/// Types and fields in one description, so that a megabyte of bytes does not become a hundred.
pub const TYPES_MAX: usize = 16_384;

/// Why bytes are no description.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SchemaError {
    /// Another version of the table.
    #[error("descriptions of version {0}, this program knows {VERSION}; use programs of the same version of Rohrpost")]
    Version(u8),
    /// They end in the middle.
    #[error("the description ends too early")]
    Short,
    /// They go on behind the end.
    #[error("{0} bytes behind the end of the description")]
    Long(usize),
    /// A byte that this version does not have: what it should be, and the byte.
    #[error("the byte {1} is no {0}")]
    Byte(&'static str, u8),
    /// A number that is too large.
    #[error("a number that does not fit {0} bits")]
    Number(u32),
    /// Bytes that are no text.
    #[error("text that is not UTF-8")]
    Text,
    /// Types inside of each other.
    #[error("types nested more than {DEPTH_MAX} deep")]
    Deep,
    /// Too many types.
    #[error("more than {TYPES_MAX} types")]
    Many,
}

/// The lower half of SipHash-1-3 with key 0.
pub fn hash(bytes: &[u8]) -> u32 {
    let mut hasher = siphasher::sip::SipHasher13::new();
    hasher.write(bytes);
    hasher.finish() as u32
}

impl Type {
    /// As it is stored: the version of the table, then the type.
    pub fn to_bytes(&self) -> Vec<u8> {
        Writer::whole(false, |writer| writer.ty(self))
    }

    /// Reads what [`Type::to_bytes`] wrote.
    ///
    /// # Errors
    /// What is wrong with the bytes.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, SchemaError> {
        Reader::whole(bytes, Reader::ty)
    }

    /// The same without what does not count: texts and ranges.
    pub(crate) fn bare_bytes(&self) -> Vec<u8> {
        Writer::whole(true, |writer| writer.ty(self))
    }

    /// Tells types apart. Texts and ranges do not count, names and units do.
    pub fn hash(&self) -> u32 {
        hash(&self.bare_bytes())
    }
}

impl Field {
    /// As it is stored: the version of the table, then the field.
    pub fn to_bytes(&self) -> Vec<u8> {
        Writer::whole(false, |writer| writer.field(self))
    }

    /// Reads what [`Field::to_bytes`] wrote.
    ///
    /// # Errors
    /// What is wrong with the bytes.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, SchemaError> {
        Reader::whole(bytes, Reader::field)
    }
}

/// What a field has besides its name and type.
mod mark {
    pub(super) const TEXT: u8 = 1;
    pub(super) const UNIT: u8 = 2;
    pub(super) const LEAST: u8 = 4;
    pub(super) const MOST: u8 = 8;
}

/// Appends.
pub(crate) struct Writer {
    bytes: Vec<u8>,
    /// Leaves out what does not count in a hash.
    bare: bool,
}

impl Writer {
    /// What `write` writes, behind the version.
    pub(crate) fn whole(bare: bool, write: impl FnOnce(&mut Self) -> &mut Self) -> Vec<u8> {
        let mut writer = Self { bytes: vec![VERSION], bare };
        write(&mut writer);
        writer.bytes
    }

    pub(crate) fn byte(&mut self, byte: u8) -> &mut Self {
        self.bytes.push(byte);
        self
    }

    pub(crate) fn number(&mut self, number: usize) -> &mut Self {
        write_varint(&mut self.bytes, number as u128);
        self
    }

    fn counted(&mut self, bytes: &[u8]) -> &mut Self {
        self.number(bytes.len()).bytes.extend_from_slice(bytes);
        self
    }

    pub(crate) fn name(&mut self, name: &str) -> &mut Self {
        self.counted(name.as_bytes())
    }

    /// What something is for.
    pub(crate) fn text(&mut self, text: &str) -> &mut Self {
        self.name(if self.bare { "" } else { text })
    }

    pub(crate) fn list<T>(
        &mut self,
        members: &[T],
        write: impl for<'w> Fn(&'w mut Self, &T) -> &'w mut Self,
    ) -> &mut Self {
        members.iter().fold(self.number(members.len()), |writer, member| write(writer, member))
    }

    fn named(&mut self, Named { name, text, members }: &Named) -> &mut Self {
        self.name(name).text(text);
        match members {
            Members::None => self.byte(0),
            Members::One(field) => self.byte(1).field(field),
            Members::Tuple(fields) => self.byte(2).list(fields, Self::field),
            Members::Fields(fields) => self.byte(3).list(fields, Self::field),
        }
    }

    pub(crate) fn field(&mut self, Field { name, text, unit, ty, least, most }: &Field) -> &mut Self {
        let parts = [
            (mark::TEXT, Some(text.as_bytes()).filter(|text| !text.is_empty() && !self.bare)),
            (mark::UNIT, Some(unit.as_bytes()).filter(|unit| !unit.is_empty())),
            (mark::LEAST, least.as_deref().filter(|_| !self.bare)),
            (mark::MOST, most.as_deref().filter(|_| !self.bare)),
        ];
        let marks = parts.iter().filter(|(_, part)| part.is_some()).map(|(mark, _)| mark).sum();
        let marked = self.name(name).byte(marks);
        parts.iter().filter_map(|(_, part)| *part).fold(marked, Self::counted).ty(ty)
    }

    pub(crate) fn ty(&mut self, ty: &Type) -> &mut Self {
        match ty {
            Type::Option(some) => self.byte(17).ty(some),
            Type::List(element) => self.byte(18).ty(element),
            Type::Array(length, element) => self.byte(19).number(*length as usize).ty(element),
            Type::Map(key, value) => self.byte(20).ty(key).ty(value),
            Type::Tuple(elements) => self.byte(21).list(elements, Self::ty),
            Type::Struct(named) => self.byte(22).named(named),
            Type::Enum { name, text, variants } => self.byte(23).name(name).text(text).list(variants, Self::named),
            plain => self.byte(PLAIN.iter().position(|other| other == plain).unwrap_or_default() as u8),
        }
    }
}

/// Types that are their tag alone; its place here is its number.
pub(crate) const PLAIN: [Type; 17] = [
    Type::Unit,
    Type::Bool,
    Type::U8,
    Type::U16,
    Type::U32,
    Type::U64,
    Type::U128,
    Type::I8,
    Type::I16,
    Type::I32,
    Type::I64,
    Type::I128,
    Type::F32,
    Type::F64,
    Type::Char,
    Type::Text,
    Type::Bytes,
];

/// Takes off the front.
pub(crate) struct Reader<'a> {
    /// What is not read yet.
    bytes: &'a [u8],
    depth: usize,
    types_left: usize,
}

impl<'a> Reader<'a> {
    /// Reads one thing that takes all of the bytes, behind their version.
    pub(crate) fn whole<T>(
        bytes: &'a [u8],
        read: impl FnOnce(&mut Self) -> Result<T, SchemaError>,
    ) -> Result<T, SchemaError> {
        let mut reader = Self { bytes, depth: 0, types_left: TYPES_MAX };
        match reader.byte()? {
            VERSION => {}
            other => return Err(SchemaError::Version(other)),
        }
        let whole = read(&mut reader)?;
        match reader.bytes.len() {
            0 => Ok(whole),
            left => Err(SchemaError::Long(left)),
        }
    }

    pub(crate) fn byte(&mut self) -> Result<u8, SchemaError> {
        let (byte, rest) = self.bytes.split_first().ok_or(SchemaError::Short)?;
        self.bytes = rest;
        Ok(*byte)
    }

    pub(crate) fn flag(&mut self) -> Result<bool, SchemaError> {
        match self.byte()? {
            0 => Ok(false),
            1 => Ok(true),
            other => Err(SchemaError::Byte("yes or no", other)),
        }
    }

    pub(crate) fn number(&mut self, bits: u32) -> Result<u32, SchemaError> {
        let number = read_varint(bits, || self.byte())?;
        number.map(|number| number as u32).ok_or(SchemaError::Number(bits))
    }

    fn counted(&mut self) -> Result<&'a [u8], SchemaError> {
        let length = self.number(32)? as usize;
        let (taken, rest) = self.bytes.split_at_checked(length).ok_or(SchemaError::Short)?;
        self.bytes = rest;
        Ok(taken)
    }

    pub(crate) fn text(&mut self) -> Result<String, SchemaError> {
        String::from_utf8(self.counted()?.to_vec()).map_err(|_| SchemaError::Text)
    }

    pub(crate) fn list<T>(
        &mut self,
        read: impl Fn(&mut Self) -> Result<T, SchemaError>,
    ) -> Result<Vec<T>, SchemaError> {
        (0..self.number(32)?).map(|_| read(self)).collect()
    }

    fn named(&mut self) -> Result<Named, SchemaError> {
        self.one_more()?;
        let (name, text) = (self.text()?, self.text()?);
        let members = match self.byte()? {
            0 => Members::None,
            1 => Members::One(Box::new(self.field()?)),
            2 => Members::Tuple(self.list(Self::field)?),
            3 => Members::Fields(self.list(Self::field)?),
            other => return Err(SchemaError::Byte("kind of members", other)),
        };
        Ok(Named { name, text, members })
    }

    pub(crate) fn field(&mut self) -> Result<Field, SchemaError> {
        let (name, marks) = (self.text()?, self.byte()?);
        if marks > mark::TEXT + mark::UNIT + mark::LEAST + mark::MOST {
            return Err(SchemaError::Byte("sum of marks", marks));
        }
        let has = |mark| marks & mark != 0;
        let text = if has(mark::TEXT) { self.text()? } else { String::new() };
        let unit = if has(mark::UNIT) { self.text()? } else { String::new() };
        let least = if has(mark::LEAST) { Some(self.counted()?.to_vec()) } else { None };
        let most = if has(mark::MOST) { Some(self.counted()?.to_vec()) } else { None };
        Ok(Field { name, text, unit, ty: self.ty()?, least, most })
    }

    fn one_more(&mut self) -> Result<(), SchemaError> {
        self.types_left = self.types_left.checked_sub(1).ok_or(SchemaError::Many)?;
        Ok(())
    }

    pub(crate) fn ty(&mut self) -> Result<Type, SchemaError> {
        if self.depth >= DEPTH_MAX {
            return Err(SchemaError::Deep);
        }
        self.one_more()?;
        self.depth += 1;
        let tag = self.byte()?;
        let ty = match (PLAIN.get(usize::from(tag)), tag) {
            (Some(plain), _) => plain.clone(),
            (None, 17) => Type::option(self.ty()?),
            (None, 18) => Type::list(self.ty()?),
            (None, 19) => Type::Array(self.number(32)?, Box::new(self.ty()?)),
            (None, 20) => Type::Map(Box::new(self.ty()?), Box::new(self.ty()?)),
            (None, 21) => Type::Tuple(self.list(Self::ty)?),
            (None, 22) => Type::Struct(self.named()?),
            (None, 23) => Type::Enum { name: self.text()?, text: self.text()?, variants: self.list(Self::named)? },
            (None, other) => return Err(SchemaError::Byte("type", other)),
        };
        self.depth -= 1;
        Ok(ty)
    }
}

/// Seven bits a byte, the lowest first; the highest bit of a byte says that another follows.
pub(crate) fn write_varint(bytes: &mut Vec<u8>, mut number: u128) {
    while number >= 0x80 {
        bytes.push(number as u8 | 0x80);
        number >>= 7;
    }
    bytes.push(number as u8);
}

/// None when the number has more bits.
pub(crate) fn read_varint<E>(bits: u32, mut byte: impl FnMut() -> Result<u8, E>) -> Result<Option<u128>, E> {
    let mut number = 0;
    for shift in (0..bits).step_by(7) {
        let byte = byte()?;
        let seven = u128::from(byte & 0x7f);
        if bits - shift < 7 && seven >> (bits - shift) != 0 {
            break;
        }
        number |= seven << shift;
        if byte & 0x80 == 0 {
            return Ok(Some(number));
        }
    }
    Ok(None)
}
