//! Interfaces of modules as tables of C, and what they describe.

mod tables;

pub use tables::{
    DataTable, FieldTable, FunctionTable, InterfaceTable, MembersKind, NamedTable, ParameterTable, TypeKind, TypeTable,
};

use crate::code::Code;
use crate::edge::{edge, given, needed_text, place, say, text};
use rohrpost_mailbox::Type as PackageType;
use rohrpost_native::NativeParameter;
use rohrpost_native::schema::{
    DEPTH_MAX, DataItem, DataKind, Description, Field, Function, Members, Named, TYPES_MAX, Type, VERSION, encode,
    parse_argument,
};
use std::mem::MaybeUninit;

/// Functions below are those that every module has.
const FUNCTION_MIN: u16 = 16;
/// The first tag of a type with others in it.
const FIRST_COMPOUND: u8 = TypeKind::Option as u8;

/// The hash of an interface, by which callers and servers know that they have the same one, in whatever language each
/// is written. Any thread.
///
/// # Safety
/// All tables are as their texts say.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn rohrpost_interface_hash(
    interface: Option<&InterfaceTable>,
    hash: Option<&mut MaybeUninit<u32>>,
) -> Code {
    edge(|| {
        let (interface, out) = (given(interface, "interface")?, place(hash, "hash")?);
        // SAFETY: the caller's promise.
        out.write(unsafe { described(interface) }?.hash());
        Ok(())
    })
}

/// What an interface's tables describe.
///
/// # Safety
/// The tables are as their texts say.
pub(crate) unsafe fn described(table: &InterfaceTable) -> Result<Description, Code> {
    let mut reader = TableReader { depth: 0, types_left: TYPES_MAX };
    // SAFETY: the caller's promise, for all that the tables point to.
    unsafe {
        if !table.described.is_null() {
            let bytes = crate::edge::bytes(table.described.cast(), table.described_len, "described")?;
            let read = Description::from_bytes(bytes);
            return read.map_err(|error| say(Code::Value, format_args!("`described`: {error}")));
        }
        let name = needed_text(table.name, "name of the interface")?.to_owned();
        let functions = list(table.functions, table.function_count, "functions")?;
        let data = list(table.data, table.data_count, "data")?;
        let mut description = Description {
            class: needed_text(table.class_name, "class of the interface")?.to_owned(),
            text: text(table.text, "text of the interface")?.unwrap_or_default().to_owned(),
            functions: functions.iter().map(|function| reader.function(function)).collect::<Result<_, _>>()?,
            data: data.iter().map(|item| reader.item(item)).collect::<Result<_, _>>()?,
            name,
        };
        numbers_differ(&description)?;
        // As in other languages: the order in which an author wrote them does not count.
        description.functions.sort_by_key(|function| function.number);
        description.data.sort_by_key(|item| item.number);
        Ok(description)
    }
}

/// What a module's parameters are, and the values that they have if the configuration says none.
///
/// # Safety
/// The tables are as their texts say.
pub(crate) unsafe fn parameters(tables: &[ParameterTable]) -> Result<Vec<NativeParameter>, Code> {
    let mut reader = TableReader { depth: 0, types_left: TYPES_MAX };
    let read = |table: &ParameterTable| {
        // SAFETY: the caller's promise.
        let (field, value) = unsafe { (reader.field(&table.field)?, needed_text(table.value, "value")?) };
        let default = bound(&field, Some(value))?.unwrap_or_default();
        Ok(NativeParameter { field, default })
    };
    tables.iter().map(read).collect()
}

/// So many entries of a table.
///
/// # Safety
/// `first` is null, or points to `count` entries that stay as they are for `'a`.
pub(crate) unsafe fn list<'a, T>(first: *const T, count: usize, what: &str) -> Result<&'a [T], Code> {
    match (first.is_null(), count) {
        (_, 0) => Ok(&[]),
        (true, _) => Err(say(Code::NullPointer, format_args!("`{what}` is a null pointer, and there are {count}"))),
        (false, count) if count > TYPES_MAX => Err(too_many()),
        // SAFETY: not null, of a possible length, and the caller says that so many are there.
        (false, count) => Ok(unsafe { std::slice::from_raw_parts(first, count) }),
    }
}

fn too_many() -> Code {
    say(Code::TooLarge, format_args!("a description has at most {TYPES_MAX} types and fields"))
}

fn numbers_differ(description: &Description) -> Result<(), Code> {
    let functions = description.functions.iter().map(|function| function.number);
    let bad = functions.clone().find(|number| !(FUNCTION_MIN..=PackageType::COMMAND_MAX).contains(number));
    let data = description.data.iter().map(|item| item.number);
    let bad = bad.or_else(|| data.clone().find(|number| !(1..=PackageType::DATA_MAX).contains(number)));
    if let Some(number) = bad {
        let words = format_args!("{number} is no number of a function (16 to 16383) or of data (1 to 16384)");
        return Err(say(Code::Value, words));
    }
    let twice = |numbers: Vec<u16>| (1..numbers.len()).find(|at| numbers[..*at].contains(&numbers[*at]));
    if twice(functions.collect()).or(twice(data.collect())).is_some() {
        return Err(say(Code::Value, format_args!("two functions, or two data, have one number")));
    }
    Ok(())
}

/// Postcard of a value that is given as text.
fn bound(field: &Field, value: Option<&str>) -> Result<Option<Vec<u8>>, Code> {
    let Some(value) = value else { return Ok(None) };
    let read = parse_argument(&field.ty, value).and_then(|value| encode(&field.ty, &value));
    read.map(Some).map_err(|error| say(Code::Value, format_args!("{}", error.within(&field.name))))
}

/// Reads tables, whatever is in them: a type that contains itself ends at the depth that a description may have.
struct TableReader {
    depth: usize,
    types_left: usize,
}

impl TableReader {
    unsafe fn function(&mut self, table: &FunctionTable) -> Result<Function, Code> {
        // SAFETY: the tables are as their texts say.
        unsafe {
            let arguments = list(table.arguments, table.argument_count, "arguments")?;
            Ok(Function {
                number: table.number,
                name: needed_text(table.name, "name of a function")?.to_owned(),
                text: text(table.text, "text of a function")?.unwrap_or_default().to_owned(),
                idempotent: table.idempotent,
                arguments: arguments.iter().map(|field| self.field(field)).collect::<Result<_, _>>()?,
                result: self.ty(&table.result)?,
            })
        }
    }

    unsafe fn item(&mut self, table: &DataTable) -> Result<DataItem, Code> {
        let kind = if table.is_stream { DataKind::Stream } else { DataKind::Data };
        // SAFETY: the tables are as their texts say.
        Ok(DataItem { number: table.number, kind, field: unsafe { self.field(&table.field) }? })
    }

    unsafe fn field(&mut self, table: &FieldTable) -> Result<Field, Code> {
        self.count()?;
        // SAFETY: the tables are as their texts say.
        unsafe {
            let name = text(table.name, "name of a field")?.unwrap_or_default();
            let (words, unit) = (text(table.text, "text of a field")?, text(table.unit, "unit of a field")?);
            let field = Field::new(name, self.ty(&table.ty)?).said(words.unwrap_or_default(), unit.unwrap_or_default());
            let least = bound(&field, text(table.least, "least value of a field")?)?;
            let most = bound(&field, text(table.most, "greatest value of a field")?)?;
            Ok(field.bounded(least, most))
        }
    }

    unsafe fn ty(&mut self, table: &TypeTable) -> Result<Type, Code> {
        self.count()?;
        if table.kind < FIRST_COMPOUND {
            // The tag alone is such a type.
            return Type::from_bytes(&[VERSION, table.kind])
                .map_err(|error| say(Code::Value, format_args!("a type: {error}")));
        }
        if self.depth == DEPTH_MAX {
            let words = format_args!("types nested more than {DEPTH_MAX} deep: does one contain itself?");
            return Err(say(Code::Value, words));
        }
        self.depth += 1;
        // SAFETY: the tables are as their texts say.
        let ty = unsafe { self.compound(table) }?;
        self.depth -= 1;
        Ok(ty)
    }

    unsafe fn compound(&mut self, table: &TypeTable) -> Result<Type, Code> {
        let is = |kind: TypeKind| table.kind == kind as u8;
        // SAFETY: the tables are as their texts say.
        unsafe {
            let mut inner = |count: usize| -> Result<Vec<Type>, Code> {
                list(table.types, count, "types")?.iter().map(|ty| self.ty(ty)).collect()
            };
            let only = |types: Vec<Type>| types.into_iter().next().map(Box::new).ok_or_else(too_many);
            match () {
                () if is(TypeKind::Option) => Ok(Type::Option(only(inner(1)?)?)),
                () if is(TypeKind::List) => Ok(Type::List(only(inner(1)?)?)),
                () if is(TypeKind::Array) => Ok(Type::Array(table.count, only(inner(1)?)?)),
                () if is(TypeKind::Tuple) => Ok(Type::Tuple(inner(table.count as usize)?)),
                () if is(TypeKind::Map) => {
                    let mut types = inner(2)?;
                    let value = types.pop().map(Box::new).ok_or_else(too_many)?;
                    Ok(Type::Map(only(types)?, value))
                }
                () if is(TypeKind::Struct) => {
                    let named = list(table.named, 1, "struct")?;
                    Ok(Type::Struct(self.named(&named[0])?))
                }
                () if is(TypeKind::Enum) => {
                    let head = &list(table.named, 1, "enum")?[0];
                    let variants = list(table.variants, table.count as usize, "variants")?;
                    Ok(Type::Enum {
                        name: needed_text(head.name, "name of an enum")?.to_owned(),
                        text: text(head.text, "text of an enum")?.unwrap_or_default().to_owned(),
                        variants: variants.iter().map(|variant| self.named(variant)).collect::<Result<_, _>>()?,
                    })
                }
                () => Err(say(Code::Value, format_args!("{} is no kind of a type", table.kind))),
            }
        }
    }

    unsafe fn named(&mut self, table: &NamedTable) -> Result<Named, Code> {
        self.count()?;
        // SAFETY: the tables are as their texts say.
        unsafe {
            let name = needed_text(table.name, "name of a type")?;
            let words = text(table.text, "text of a type")?.unwrap_or_default();
            let fields = list(table.fields, table.field_count, "fields")?;
            let mut fields: Vec<Field> = fields.iter().map(|field| self.field(field)).collect::<Result<_, _>>()?;
            let members = match (table.members, fields.len()) {
                (0, 0) => Members::None,
                (1, 1) => Members::One(Box::new(fields.remove(0))),
                (2, _) => Members::Tuple(fields),
                (3, _) => Members::Fields(fields),
                (members, count) => {
                    let words = format_args!("`{name}` has {count} fields, and its members are of kind {members}");
                    return Err(say(Code::Value, words));
                }
            };
            Ok(Named::new(name, members).said(words))
        }
    }

    fn count(&mut self) -> Result<(), Code> {
        self.types_left = self.types_left.checked_sub(1).ok_or_else(too_many)?;
        Ok(())
    }
}
