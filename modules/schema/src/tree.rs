//! What types are made of.

use serde::Serialize;

/// What a value is, and how its bytes are to be read.
///
/// ```
/// use rohrpost_schema::{Schema, Type};
/// assert_eq!(<Option<[f32; 3]>>::schema(), Type::option(Type::Array(3, Box::new(Type::F32))));
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Type {
    /// Nothing.
    Unit,
    /// True or false.
    Bool,
    /// A whole number from 0, of 8 bits.
    U8,
    /// 16 bits.
    U16,
    /// 32 bits.
    U32,
    /// 64 bits; also `usize`.
    U64,
    /// 128 bits.
    U128,
    /// A whole number with a sign, of 8 bits.
    I8,
    /// 16 bits.
    I16,
    /// 32 bits.
    I32,
    /// 64 bits; also `isize`.
    I64,
    /// 128 bits.
    I128,
    /// A number with a fraction, of 32 bits.
    F32,
    /// 64 bits.
    F64,
    /// One character.
    Char,
    /// Text.
    Text,
    /// Bytes that are bytes to serde, too.
    Bytes,
    /// A value or none.
    Option(Box<Type>),
    /// Any number of one type.
    List(Box<Type>),
    /// A fixed number of values of one type.
    Array(u32, Box<Type>),
    /// Keys, and what belongs to each.
    Map(Box<Type>, Box<Type>),
    /// One after the other.
    Tuple(Vec<Type>),
    /// A struct.
    Struct(Named),
    /// An enum.
    Enum {
        /// Its name, as in [`Named`].
        name: String,
        /// What it is.
        #[serde(skip_serializing_if = "String::is_empty")]
        text: String,
        /// Its variants, by number.
        variants: Vec<Named>,
    },
}

/// A struct, or a variant of an enum.
///
/// ```
/// use rohrpost_schema::{Field, Members, Named, Type};
///
/// let point = Members::Fields(vec![Field::new("x", Type::F64), Field::new("y", Type::F64)]);
/// let point = Named::new("Point", point).said("A place in the plane.");
/// assert_eq!(point.members.fields().len(), 2);
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Named {
    /// A name that others may rely on: it is of the author's choice, counts in hashes, and stays when code is moved.
    pub name: String,
    /// What it is.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub text: String,
    /// What is in it.
    pub members: Members,
}

/// What a struct or variant has in it.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Members {
    /// Nothing.
    None,
    /// One without a name, which it wraps.
    One(Box<Field>),
    /// Several without names.
    Tuple(Vec<Field>),
    /// Fields by their names.
    Fields(Vec<Field>),
}

/// A type in its place: a field of a struct, an argument of a function, data, a parameter.
///
/// ```
/// use rohrpost_schema::{Field, Type};
///
/// let zero = 0_f64.to_le_bytes().to_vec();
/// let speed = Field::new("speed", Type::F64).said("When nothing is in the way.", "m/s").bounded(Some(zero), None);
/// assert_eq!(speed.range().unwrap(), "at least 0");
/// assert_eq!(speed.with_unit("0.5"), "0.5 m/s");
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Field {
    /// Its name; empty where it has none.
    pub name: String,
    /// What it is for.
    pub text: String,
    /// Unit of its value; empty: none.
    pub unit: String,
    /// Its type.
    pub ty: Type,
    /// Least value, postcard of the type. What a range means is the author's word to people and tools; decoding does
    /// not check it.
    pub least: Option<Vec<u8>>,
    /// Greatest value, likewise.
    pub most: Option<Vec<u8>>,
}

impl Field {
    /// A field of which only this is known.
    pub fn new(name: impl Into<String>, ty: Type) -> Self {
        Self { name: name.into(), text: String::new(), unit: String::new(), ty, least: None, most: None }
    }

    /// The same with a text and a unit; empty: none.
    #[must_use]
    pub fn said(mut self, text: impl Into<String>, unit: impl Into<String>) -> Self {
        (self.text, self.unit) = (text.into(), unit.into());
        self
    }

    /// The same with bounds, each postcard of the type.
    #[must_use]
    pub fn bounded(mut self, least: Option<Vec<u8>>, most: Option<Vec<u8>>) -> Self {
        (self.least, self.most) = (least, most);
        self
    }

    pub(crate) fn memory_bytes(&self) -> usize {
        let bounds = [&self.least, &self.most].into_iter().flatten().map(Vec::len).sum::<usize>();
        size_of::<Self>() + self.name.len() + self.text.len() + self.unit.len() + bounds + self.ty.memory_bytes()
    }

    /// A text with this field's unit behind it.
    pub fn with_unit(&self, text: &str) -> String {
        if self.unit.is_empty() { text.into() } else { format!("{text} {}", self.unit) }
    }
}

impl Named {
    /// Without a text.
    pub fn new(name: impl Into<String>, members: Members) -> Self {
        Self { name: name.into(), text: String::new(), members }
    }

    /// The same with a text.
    #[must_use]
    pub fn said(mut self, text: impl Into<String>) -> Self {
        self.text = text.into();
        self
    }
}

impl Named {
    fn memory_bytes(&self) -> usize {
        let fields = self.members.fields().iter().map(Field::memory_bytes);
        size_of::<Self>() + self.name.len() + self.text.len() + fields.sum::<usize>()
    }
}

impl Members {
    /// Those that there are, in the order of their bytes.
    pub fn fields(&self) -> &[Field] {
        match self {
            Self::None => &[],
            Self::One(field) => std::slice::from_ref(field),
            Self::Tuple(fields) | Self::Fields(fields) => fields,
        }
    }
}

impl Type {
    /// Memory that it needs with all that is in it, bytes: for readers that keep types of others. Room that vectors
    /// have besides is not in it; they grow to less than twice.
    ///
    /// ```
    /// use rohrpost_schema::{Schema, Type};
    ///
    /// assert_eq!(<[u8; 9]>::schema().memory_bytes(), 2 * Type::U8.memory_bytes());
    /// ```
    pub fn memory_bytes(&self) -> usize {
        let inside = match self {
            Self::Option(inner) | Self::List(inner) | Self::Array(_, inner) => inner.memory_bytes(),
            Self::Map(key, value) => key.memory_bytes() + value.memory_bytes(),
            Self::Tuple(elements) => elements.iter().map(Self::memory_bytes).sum(),
            Self::Struct(named) => named.memory_bytes(),
            Self::Enum { name, text, variants } => {
                name.len() + text.len() + variants.iter().map(Named::memory_bytes).sum::<usize>()
            }
            _ => 0,
        };
        size_of::<Self>() + inside
    }

    /// This or nothing.
    ///
    /// ```
    /// use rohrpost_schema::Type;
    ///
    /// assert_eq!(Type::option(Type::F64), Type::Option(Box::new(Type::F64)));
    /// ```
    pub fn option(some: Self) -> Self {
        Self::Option(Box::new(some))
    }

    /// A list of these.
    ///
    /// ```
    /// use rohrpost_schema::Type;
    ///
    /// assert_eq!(Type::list(Type::F64), Type::List(Box::new(Type::F64)));
    /// ```
    pub fn list(element: Self) -> Self {
        Self::List(Box::new(element))
    }
}
