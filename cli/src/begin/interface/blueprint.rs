//! An interface laid out for code: its types apart, each once, in an order in which each is defined before it is used.
//!
//! What no language could have is refused here: names that are empty or twice, numbers beyond the wire's, deep nests.

use super::refusal::{DEPTH_MAX, NAME_BYTES_MAX, Refusal, RefusedFor};
use rohrpost::schema::{DataKind, Description, Field, Function, Members, Named, Type};
use std::collections::{BTreeSet, HashMap};

/// Numbers of own functions, and of data.
const COMMANDS: std::ops::RangeInclusive<u16> = 16..=16_383;
const DATA_MAX: u16 = 16_384;

/// An interface, with its types apart.
pub(super) struct Blueprint<'a> {
    pub(super) name: &'a str,
    pub(super) class: &'a str,
    pub(super) text: &'a str,
    pub(super) hash: u32,
    /// As it is stored and sent.
    pub(super) bytes: Vec<u8>,
    pub(super) operations: Vec<Operation<'a>>,
    pub(super) published: Vec<Published<'a>>,
    /// Structs and enums; what one has inside stands before it.
    pub(super) types: Vec<NamedType<'a>>,
}

/// A function.
pub(super) struct Operation<'a> {
    pub(super) function: &'a Function,
    pub(super) arguments: Vec<TypedField<'a>>,
    pub(super) result: Layout,
}

/// Data or a stream.
pub(super) struct Published<'a> {
    pub(super) number: u16,
    pub(super) kind: DataKind,
    pub(super) part: TypedField<'a>,
}

/// A field, an argument, or data.
#[derive(Clone)]
pub(super) struct TypedField<'a> {
    pub(super) field: &'a Field,
    pub(super) layout: Layout,
}

/// A type, with structs and enums by their place in [`Blueprint::types`].
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) enum Layout {
    Plain(&'static Plain),
    Option(Box<Layout>),
    List(Box<Layout>),
    Array(u32, Box<Layout>),
    Map(Box<Layout>, Box<Layout>),
    Tuple(Vec<Layout>),
    /// What a function returns that may fail: the value, and the error.
    Result(Box<Layout>, Box<Layout>),
    Named(usize),
}

impl Layout {
    pub(super) fn is(&self, ty: &Type) -> bool {
        matches!(self, Self::Plain(plain) if plain.ty == *ty)
    }
}

/// A type that each language has.
#[derive(Debug, PartialEq, Eq, Hash)]
pub(super) struct Plain {
    pub(super) ty: Type,
    /// In files, and in names of functions of C.
    pub(super) word: &'static str,
    pub(super) rust: &'static str,
    pub(super) python: &'static str,
    pub(super) c: &'static str,
    /// About how many bytes one has in C.
    pub(super) c_bytes: u64,
}

const fn plain(ty: Type, word: &'static str, languages: [&'static str; 3], c_bytes: u64) -> Plain {
    let [rust, python, c] = languages;
    Plain { ty, word, rust, python, c, c_bytes }
}

/// Types without others inside.
pub(super) static PLAIN: [Plain; 17] = [
    plain(Type::Unit, "unit", ["()", "None", "rp_nothing"], 1),
    plain(Type::Bool, "bool", ["bool", "bool", "bool"], 1),
    plain(Type::U8, "u8", ["u8", "rp.U8", "uint8_t"], 1),
    plain(Type::U16, "u16", ["u16", "rp.U16", "uint16_t"], 2),
    plain(Type::U32, "u32", ["u32", "rp.U32", "uint32_t"], 4),
    plain(Type::U64, "u64", ["u64", "rp.U64", "uint64_t"], 8),
    plain(Type::U128, "u128", ["u128", "rp.U128", "rp_u128"], 16),
    plain(Type::I8, "i8", ["i8", "rp.I8", "int8_t"], 1),
    plain(Type::I16, "i16", ["i16", "rp.I16", "int16_t"], 2),
    plain(Type::I32, "i32", ["i32", "rp.I32", "int32_t"], 4),
    plain(Type::I64, "i64", ["i64", "int", "int64_t"], 8),
    plain(Type::I128, "i128", ["i128", "rp.I128", "rp_i128"], 16),
    plain(Type::F32, "f32", ["f32", "rp.F32", "float"], 4),
    plain(Type::F64, "f64", ["f64", "float", "double"], 8),
    plain(Type::Char, "char", ["char", "rp.Char", "uint32_t"], 4),
    plain(Type::Text, "text", ["String", "str", "rp_text"], 16),
    plain(Type::Bytes, "bytes", ["rohrpost::types::Bytes", "bytes", "rp_bytes"], 16),
];

/// A struct or an enum.
pub(super) struct NamedType<'a> {
    pub(super) name: &'a str,
    pub(super) text: &'a str,
    pub(super) body: Body<'a>,
    /// The type itself, to be compared.
    pub(super) ty: &'a Type,
}

pub(super) enum Body<'a> {
    Struct(Inside<'a>),
    Enum(Vec<Variant<'a>>),
}

pub(super) struct Variant<'a> {
    pub(super) name: &'a str,
    pub(super) text: &'a str,
    pub(super) inside: Inside<'a>,
}

/// What a struct or variant has in it.
#[derive(Clone)]
pub(super) enum Inside<'a> {
    Nothing,
    One(Box<TypedField<'a>>),
    Tuple(Vec<TypedField<'a>>),
    Fields(Vec<TypedField<'a>>),
}

impl<'a> Inside<'a> {
    pub(super) fn parts(&self) -> &[TypedField<'a>] {
        match self {
            Self::Nothing => &[],
            Self::One(part) => std::slice::from_ref(part),
            Self::Tuple(parts) | Self::Fields(parts) => parts,
        }
    }
}

impl<'a> Blueprint<'a> {
    pub(super) fn of(description: &'a Description) -> Result<Self, Refusal> {
        named(&description.name, "the interface")?;
        named(&description.class, "the class")?;
        let mut types = Types::default();
        let operations = description.functions.iter().map(|function| types.operation(function));
        let operations = operations.collect::<Result<Vec<_>, _>>()?;
        let published = description.data.iter().map(|item| {
            let name = &item.field.name;
            named(name, "data")?;
            if item.number > DATA_MAX {
                return Err(RefusedFor::Number(item.number, "data", "0 to 16384").at(name));
            }
            Ok(Published { number: item.number, kind: item.kind, part: types.part(&item.field, name, 0)? })
        });
        let published = published.collect::<Result<Vec<_>, _>>()?;
        let functions = description.functions.iter().map(|function| function.name.as_str());
        distinct(functions.chain(description.data.iter().map(|item| item.field.name.as_str())), "")?;
        in_order(description.functions.iter().map(|function| function.number), "functions")?;
        in_order(description.data.iter().map(|item| item.number), "data")?;
        let Description { name, class, text, .. } = description;
        let (hash, bytes) = (description.hash(), description.to_bytes());
        Ok(Self { name, class, text, hash, bytes, operations, published, types: types.all })
    }
}

impl Blueprint<'_> {
    /// Places of the types that code of a language defines: all but those that it has, and what only those use.
    pub(super) fn defined(&self, is_there: impl Fn(usize) -> bool) -> BTreeSet<usize> {
        let mut found = BTreeSet::new();
        let arguments = self.operations.iter().flat_map(|operation| &operation.arguments).map(|part| &part.layout);
        let results = self.operations.iter().map(|operation| &operation.result);
        let data = self.published.iter().map(|published| &published.part.layout);
        let mut open: Vec<&Layout> = arguments.chain(results).chain(data).collect();
        while let Some(layout) = open.pop() {
            match layout {
                Layout::Option(inner) | Layout::List(inner) | Layout::Array(_, inner) => open.push(inner),
                Layout::Map(a, b) | Layout::Result(a, b) => open.extend([&**a, &**b]),
                Layout::Tuple(all) => open.extend(all),
                Layout::Named(place) if !is_there(*place) && found.insert(*place) => {
                    open.extend(self.types[*place].body.parts().map(|part| &part.layout));
                }
                _ => {}
            }
        }
        found
    }
}

impl<'a> Body<'a> {
    /// All parts, of all variants.
    pub(super) fn parts(&self) -> impl Iterator<Item = &TypedField<'a>> {
        let (own, variants) = match self {
            Self::Struct(inside) => (inside.parts(), &[][..]),
            Self::Enum(variants) => (&[][..], &variants[..]),
        };
        own.iter().chain(variants.iter().flat_map(|variant| variant.inside.parts()))
    }
}

/// Collects structs and enums.
#[derive(Default)]
struct Types<'a> {
    all: Vec<NamedType<'a>>,
    /// Place of each, texts included.
    places: HashMap<&'a Type, usize>,
}

impl<'a> Types<'a> {
    fn operation(&mut self, function: &'a Function) -> Result<Operation<'a>, Refusal> {
        let Function { number, name, arguments, result, .. } = function;
        named(name, "a function")?;
        if !COMMANDS.contains(number) {
            return Err(RefusedFor::Number(*number, "functions", "16 to 16383").at(name));
        }
        let arguments = self.fields(arguments, name, 0)?;
        let place = format!("{name}, its result");
        // Only here: inside of other types it is an enum as any other.
        let result = match result_of(result) {
            Some((value, error)) => {
                let mut inner = |ty| self.layout(ty, &place, 1).map(Box::new);
                Layout::Result(inner(value)?, inner(error)?)
            }
            None => self.layout(result, &place, 0)?,
        };
        Ok(Operation { function, arguments, result })
    }

    fn fields(&mut self, fields: &'a [Field], place: &str, depth: usize) -> Result<Vec<TypedField<'a>>, Refusal> {
        distinct(fields.iter().map(|field| field.name.as_str()), place)?;
        let parts = fields.iter().map(|field| {
            named(&field.name, place)?;
            self.part(field, &format!("{place}.{}", field.name), depth)
        });
        parts.collect()
    }

    fn part(&mut self, field: &'a Field, place: &str, depth: usize) -> Result<TypedField<'a>, Refusal> {
        if !field.unit.is_empty() {
            named(&field.unit, &format!("{place}, its unit"))?;
        }
        Ok(TypedField { field, layout: self.layout(&field.ty, place, depth)? })
    }

    fn layout(&mut self, ty: &'a Type, place: &str, depth: usize) -> Result<Layout, Refusal> {
        if depth >= DEPTH_MAX {
            return Err(RefusedFor::Deep.at(place));
        }
        let mut inner = |ty: &'a Type| self.layout(ty, place, depth + 1).map(Box::new);
        Ok(match ty {
            Type::Option(some) => Layout::Option(inner(some)?),
            Type::List(element) => Layout::List(inner(element)?),
            Type::Array(length, element) => Layout::Array(*length, inner(element)?),
            Type::Map(key, value) => Layout::Map(inner(key)?, inner(value)?),
            Type::Tuple(elements) => {
                let all = elements.iter().map(|element| self.layout(element, place, depth + 1));
                Layout::Tuple(all.collect::<Result<_, _>>()?)
            }
            Type::Struct(Named { name, text, members }) => {
                let place = of_type(name, place)?;
                let body = Body::Struct(self.inside(members, &place, depth + 1)?);
                self.keep(NamedType { name, text, body, ty })
            }
            Type::Enum { name, text, variants } => self.enumeration(ty, (name, text), variants, place, depth)?,
            ty => {
                let plain = PLAIN.iter().find(|plain| plain.ty == *ty);
                Layout::Plain(plain.expect("a type without others inside has a row"))
            }
        })
    }

    fn enumeration(
        &mut self,
        ty: &'a Type,
        (name, text): (&'a str, &'a str),
        variants: &'a [Named],
        place: &str,
        depth: usize,
    ) -> Result<Layout, Refusal> {
        let place = of_type(name, place)?;
        distinct(variants.iter().map(|variant| variant.name.as_str()), &place)?;
        let variants = variants.iter().map(|Named { name, text, members }| {
            named(name, &place)?;
            let inside = self.inside(members, &format!("{place}.{name}"), depth + 1)?;
            Ok(Variant { name, text, inside })
        });
        let body = Body::Enum(variants.collect::<Result<_, Refusal>>()?);
        Ok(self.keep(NamedType { name, text, body, ty }))
    }

    fn inside(&mut self, members: &'a Members, place: &str, depth: usize) -> Result<Inside<'a>, Refusal> {
        let mut unnamed = |field: &'a Field| match field.name.as_str() {
            "" => self.part(field, place, depth),
            name => Err(RefusedFor::PartName(name.into()).at(place)),
        };
        Ok(match members {
            Members::None => Inside::Nothing,
            Members::One(field) => Inside::One(Box::new(unnamed(field)?)),
            Members::Tuple(fields) => Inside::Tuple(fields.iter().map(unnamed).collect::<Result<_, _>>()?),
            Members::Fields(fields) => Inside::Fields(self.fields(fields, place, depth)?),
        })
    }

    fn keep(&mut self, made: NamedType<'a>) -> Layout {
        let all = &mut self.all;
        let place = *self.places.entry(made.ty).or_insert_with(|| {
            all.push(made);
            all.len() - 1
        });
        Layout::Named(place)
    }
}

/// The value and the error of what a function returns that may fail.
fn result_of(ty: &Type) -> Option<(&Type, &Type)> {
    let Type::Enum { name, text, variants } = ty else { return None };
    match &variants[..] {
        [
            Named { name: ok, text: no_text, members: Members::One(value) },
            Named { name: err, text: none, members: Members::One(error) },
        ] if name == "Result" && ok == "Ok" && err == "Err" => {
            let is_bare = |field: &Field| *field == Field::new("", field.ty.clone());
            let is_bare = is_bare(value) && is_bare(error) && [text, no_text, none].iter().all(|it| it.is_empty());
            is_bare.then_some((&value.ty, &error.ty))
        }
        _ => None,
    }
}

fn of_type(name: &str, place: &str) -> Result<String, Refusal> {
    named(name, place)?;
    Ok(name.to_owned())
}

fn named(name: &str, place: &str) -> Result<(), Refusal> {
    match name {
        name if name.trim().is_empty() => Err(RefusedFor::NoName.at(place)),
        name if name.len() > NAME_BYTES_MAX => Err(RefusedFor::LongName(name.len()).at(place)),
        name if name.chars().any(rohrpost::output::plain::is_obeyed) => Err(RefusedFor::ControlName.at(place)),
        _ => Ok(()),
    }
}

fn distinct<'a>(names: impl Iterator<Item = &'a str>, place: &str) -> Result<(), Refusal> {
    let mut seen = BTreeSet::new();
    for name in names {
        if !seen.insert(name) {
            return Err(RefusedFor::Twice(name.into()).at(place));
        }
    }
    Ok(())
}

fn in_order(numbers: impl Iterator<Item = u16> + Clone, place: &str) -> Result<(), Refusal> {
    let wrong = numbers.clone().zip(numbers.skip(1)).find(|(before, number)| before >= number);
    wrong.map_or(Ok(()), |(before, number)| Err(RefusedFor::Order(number, before).at(place)))
}
