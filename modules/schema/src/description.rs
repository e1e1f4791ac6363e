//! What a module tells of itself: its functions and data, by which tools print, call and record it.

use crate::bytes::{Reader, SchemaError, Writer, hash};
use crate::{Field, Type};
use serde::Serialize;

/// What an interface offers. A module answers `describe` with it.
///
/// ```
/// use rohrpost_schema::{DataItem, DataKind, Description, Field, Type};
///
/// let field = Field::new("heading", Type::F64).said("From east.", "rad");
/// let heading = DataItem { number: 1, kind: DataKind::Data, field };
/// let compass = Description {
///     name: "Compass".into(),
///     class: "compass".into(),
///     text: "Tells where north is.".into(),
///     functions: Vec::new(),
///     data: vec![heading],
/// };
/// assert_eq!(Description::from_bytes(&compass.to_bytes()).unwrap(), compass);
/// assert_eq!(compass.data_item("heading").unwrap().number, 1);
/// assert!(compass.function("calibrate").is_none() && compass.streams().next().is_none());
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Description {
    /// Name of the trait.
    pub name: String,
    /// Class of modules that offer it.
    pub class: String,
    /// What it is for.
    pub text: String,
    /// Its functions, by number.
    pub functions: Vec<Function>,
    /// Its data and streams, by number.
    pub data: Vec<DataItem>,
}

/// A function that can be called.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Function {
    /// Command number.
    pub number: u16,
    /// Its name.
    pub name: String,
    /// What it does.
    pub text: String,
    /// Whether running it twice does no harm.
    pub idempotent: bool,
    /// Its arguments, in order.
    pub arguments: Vec<Field>,
    /// What it returns.
    pub result: Type,
}

/// Data that can be asked for or subscribed to.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct DataItem {
    /// Data number.
    pub number: u16,
    /// Whether its values are also kept as a stream.
    pub kind: DataKind,
    /// Its name, what it is, and its type.
    #[serde(flatten)]
    pub field: Field,
}

/// How a module keeps data for others. Both kinds can be asked for and subscribed to.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum DataKind {
    /// The newest value, in the module.
    Data,
    /// Many values with their times, in a ring of shared memory that other modules of the node read.
    Stream,
}

impl Description {
    /// As it is sent and stored: the version of the table, then all of it.
    pub fn to_bytes(&self) -> Vec<u8> {
        self.written(false)
    }

    /// Reads what [`Description::to_bytes`] wrote.
    ///
    /// # Errors
    /// What is wrong with the bytes.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, SchemaError> {
        Reader::whole(bytes, |reader| {
            Ok(Self {
                name: reader.text()?,
                class: reader.text()?,
                text: reader.text()?,
                functions: reader.list(Function::read)?,
                data: reader.list(DataItem::read)?,
            })
        })
    }

    /// Tells interfaces apart: callers and servers must have the same. Numbers, types, units, what is a
    /// stream, and names of functions and arguments count (to swap two numbers is a mistake that types do not show);
    /// texts and ranges do not. A mistake goes unseen once in four billion; malice is not what it is for.
    ///
    /// ```
    /// use rohrpost_schema::{DataItem, DataKind, Description, Field, Type};
    ///
    /// let heading = |unit: &str| Field::new("heading", Type::F64).said("", unit);
    /// let compass = |text: &str, unit: &str| Description {
    ///     name: "Compass".into(),
    ///     class: "compass".into(),
    ///     text: text.into(),
    ///     functions: Vec::new(),
    ///     data: vec![DataItem { number: 1, kind: DataKind::Data, field: heading(unit) }],
    /// };
    /// assert_eq!(compass("", "rad").hash(), compass("Tells where north is.", "rad").hash());
    /// assert_ne!(compass("", "rad").hash(), compass("", "deg").hash());
    /// ```
    pub fn hash(&self) -> u32 {
        hash(&self.written(true))
    }

    fn written(&self, bare: bool) -> Vec<u8> {
        Writer::whole(bare, |writer| {
            let head = writer.name(&self.name).name(&self.class).text(&self.text);
            head.list(&self.functions, Function::written).list(&self.data, DataItem::written)
        })
    }

    /// Memory that it needs with all that is in it, bytes. Room that vectors have besides is not in it.
    pub fn memory_bytes(&self) -> usize {
        let functions = self.functions.iter().map(|function| {
            let arguments = function.arguments.iter().map(Field::memory_bytes).sum::<usize>();
            size_of::<Function>()
                + function.name.len()
                + function.text.len()
                + arguments
                + function.result.memory_bytes()
        });
        let data = self.data.iter().map(|item| size_of::<DataItem>() + item.field.memory_bytes());
        let texts = self.name.len() + self.class.len() + self.text.len();
        size_of::<Self>() + texts + functions.sum::<usize>() + data.sum::<usize>()
    }

    /// A function by its name.
    pub fn function(&self, name: &str) -> Option<&Function> {
        self.functions.iter().find(|function| function.name == name)
    }

    /// Data or a stream by its name.
    pub fn data_item(&self, name: &str) -> Option<&DataItem> {
        self.data.iter().find(|item| item.field.name == name)
    }

    /// Its streams, by number.
    pub fn streams(&self) -> impl Iterator<Item = &DataItem> {
        self.data.iter().filter(|item| item.kind == DataKind::Stream)
    }
}

impl DataItem {
    fn written<'w>(writer: &'w mut Writer, item: &Self) -> &'w mut Writer {
        writer.number(item.number.into()).byte(item.kind as u8).field(&item.field)
    }

    fn read(reader: &mut Reader<'_>) -> Result<Self, SchemaError> {
        let number = reader.number(16)? as u16;
        let kind = match reader.byte()? {
            0 => DataKind::Data,
            1 => DataKind::Stream,
            other => return Err(SchemaError::Byte("kind of data", other)),
        };
        Ok(Self { number, kind, field: reader.field()? })
    }
}

impl Function {
    fn written<'w>(writer: &'w mut Writer, function: &Self) -> &'w mut Writer {
        let head = writer.number(function.number.into()).name(&function.name).text(&function.text);
        head.byte(u8::from(function.idempotent)).list(&function.arguments, Writer::field).ty(&function.result)
    }

    fn read(reader: &mut Reader<'_>) -> Result<Self, SchemaError> {
        Ok(Self {
            number: reader.number(16)? as u16,
            name: reader.text()?,
            text: reader.text()?,
            idempotent: reader.flag()?,
            arguments: reader.list(Reader::field)?,
            result: reader.ty()?,
        })
    }
}
