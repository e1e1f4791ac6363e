//! The tables of an interface, as C writes them: by the macros of the header.

use std::ffi::c_char;

/// Kinds of types; the numbers are those of the wire format.
#[repr(u8)]
#[derive(Clone, Copy)]
pub enum TypeKind {
    /// Nothing.
    Unit = 0,
    /// True or false.
    Bool = 1,
    /// A whole number from 0, of 8 bits.
    U8 = 2,
    /// 16 bits.
    U16 = 3,
    /// 32 bits.
    U32 = 4,
    /// 64 bits.
    U64 = 5,
    /// 128 bits.
    U128 = 6,
    /// A whole number with a sign, of 8 bits.
    I8 = 7,
    /// 16 bits.
    I16 = 8,
    /// 32 bits.
    I32 = 9,
    /// 64 bits.
    I64 = 10,
    /// 128 bits.
    I128 = 11,
    /// A number with a fraction, of 32 bits.
    F32 = 12,
    /// 64 bits.
    F64 = 13,
    /// One character.
    Char = 14,
    /// Text.
    Text = 15,
    /// Bytes.
    Bytes = 16,
    /// A value of `types[0]`, or none.
    Option = 17,
    /// Any number of `types[0]`.
    List = 18,
    /// `count` of `types[0]`.
    Array = 19,
    /// Keys of `types[0]`, and what belongs to each, `types[1]`.
    Map = 20,
    /// `count` values of `types`, one after the other.
    Tuple = 21,
    /// A struct: `named`.
    Struct = 22,
    /// One of `count` `variants`; its name and text are those of `named`.
    Enum = 23,
}

/// What a struct or variant has in it.
#[repr(u8)]
#[derive(Clone, Copy)]
pub enum MembersKind {
    /// Nothing.
    None = 0,
    /// One field without a name.
    One = 1,
    /// Several without names.
    Tuple = 2,
    /// Fields by their names.
    Fields = 3,
}

/// A type: `ROHRPOST_F64` and so on, `ROHRPOST_OPTION`, `ROHRPOST_LIST`, `ROHRPOST_STRUCT` and so on write it.
#[repr(C)]
pub struct TypeTable {
    /// One of `rohrpost_kind`.
    pub kind: u8,
    /// Elements of an array or a tuple, variants of an enum.
    pub count: u32,
    /// Types that it is made of.
    pub types: *const TypeTable,
    /// A struct; of an enum its name and text.
    pub named: *const NamedTable,
    /// Of an enum.
    pub variants: *const NamedTable,
}

/// A type in its place: `ROHRPOST_FIELD` writes it.
#[repr(C)]
pub struct FieldTable {
    /// Its name; null or empty where it has none.
    pub name: *const c_char,
    /// Its type.
    pub ty: TypeTable,
    /// Unit of its value; null: none.
    pub unit: *const c_char,
    /// What it is for; null: not said.
    pub text: *const c_char,
    /// Least value, as a user would type it; null: not bounded.
    pub least: *const c_char,
    /// Greatest value, likewise.
    pub most: *const c_char,
}

/// A struct or a variant: `ROHRPOST_NAMED` writes it.
#[repr(C)]
pub struct NamedTable {
    /// A name that others may rely on; it counts in the hash.
    pub name: *const c_char,
    /// What it is; null: not said.
    pub text: *const c_char,
    /// One of `rohrpost_members`.
    pub members: u8,
    /// What is in it.
    pub fields: *const FieldTable,
    /// How many.
    pub field_count: usize,
}

/// A function that others call.
#[repr(C)]
pub struct FunctionTable {
    /// Its number, 16 to 16383.
    pub number: u16,
    /// Its name.
    pub name: *const c_char,
    /// What it does; null: not said.
    pub text: *const c_char,
    /// Whether running it twice does no harm.
    pub idempotent: bool,
    /// Its arguments, in order.
    pub arguments: *const FieldTable,
    /// How many.
    pub argument_count: usize,
    /// What it returns.
    pub result: TypeTable,
}

/// Data or a stream that others read.
#[repr(C)]
pub struct DataTable {
    /// Its number, 1 to 16384.
    pub number: u16,
    /// Whether its values are kept as a stream.
    pub is_stream: bool,
    /// Its name, type, unit and text.
    pub field: FieldTable,
}

/// What a module offers: `ROHRPOST_INTERFACE` writes it.
#[repr(C)]
pub struct InterfaceTable {
    /// Its name.
    pub name: *const c_char,
    /// Class of the modules that offer it.
    pub class_name: *const c_char,
    /// What it is for; null: not said.
    pub text: *const c_char,
    /// Its functions, by number.
    pub functions: *const FunctionTable,
    /// How many.
    pub function_count: usize,
    /// Its data and streams, by number.
    pub data: *const DataTable,
    /// How many.
    pub data_count: usize,
    /// The description's bytes, in place of all above; null: the tables above.
    pub described: *const u8,
    /// How many.
    pub described_len: usize,
}

/// A setting that may change while the module runs: `ROHRPOST_PARAMETER` writes it.
#[repr(C)]
pub struct ParameterTable {
    /// Its name as the configuration has it, type, unit, text and range.
    pub field: FieldTable,
    /// The value that it has if the configuration says none, as a user would type it.
    pub value: *const c_char,
}
