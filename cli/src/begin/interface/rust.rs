//! An interface as Rust: `#[rohrpost::interface]` on a trait, `#[rohrpost::data]` on its types. Both describe
//! themselves again, and a test in the code compares their hash with the file's.

use super::blueprint::{Blueprint, Body, Inside, Layout, NamedType, Operation, Published, TypedField};
use super::names::{Scope, camel, is_plain, last, snake, standard_name};
use super::refusal::{Refusal, RefusedFor, cannot};
use super::texts::{in_rust_doc, literal, one_line, wrapped};
use rohrpost::schema::{DataKind, Field, Type, Value};
use std::collections::BTreeSet;

/// Words that are names behind `r#` alone; those of `UNRAW` never are.
const KEYWORDS: &str = " abstract as async await become box break const continue do dyn else enum extern false final \
    fn for gen if impl in let loop macro match mod move mut override priv pub ref return static struct trait true try \
    type typeof unsafe unsized use virtual where while yield ";
const UNRAW: &str = " crate self super Self _ ";
/// Names that code means without a path; a type that is called so would take their place.
const PRELUDE: &str = "AsMut AsRef Box Clone Copy Debug Default DoubleEndedIterator Drop Eq Err ExactSizeIterator \
    Extend Fn FnMut FnOnce From FromIterator Future Hash Into IntoFuture IntoIterator Iterator None Ok Option Ord \
    PartialEq PartialOrd Result Send Sized Some String Sync ToOwned ToString TryFrom TryInto Unpin Vec";
const COLUMNS: usize = 110;

/// The whole file.
pub(super) fn write(blueprint: &Blueprint<'_>) -> Result<String, Refusal> {
    let rust = RustCode::of(blueprint)?;
    let mut code = format!(
        "// Interface {:?} of class {:?}.
//
// Made by `rohrpost interface generate --lang rust`: do not change it here, but where it was written, and make this
// anew.

",
        blueprint.name, blueprint.class
    );
    for place in &rust.defined {
        code += &rust.definition(&blueprint.types[*place], *place)?;
        code.push('\n');
    }
    code += &rust.interface()?;
    let name = rust.name;
    code += &format!(
        "
/// Hash of [`{name}`] in the file; `{name}Interface::hash()` is the same.
pub const {upper}_HASH: u32 = {hash:#010x};

#[test]
fn {lower}_is_the_interface_of_the_file() {{
    assert_eq!({name}Interface::hash(), {upper}_HASH);
}}
",
        upper = snake(name, "interface").to_uppercase(),
        lower = snake(name, "interface"),
        hash = blueprint.hash,
    );
    Ok(code)
}

struct RustCode<'a> {
    blueprint: &'a Blueprint<'a>,
    /// The trait.
    name: &'a str,
    defined: BTreeSet<usize>,
    /// Of each type, as it is written where it is used.
    paths: Vec<String>,
    /// Which types have an order, so that they may be keys of a map.
    ordered: Vec<bool>,
}

/// A name that is in the description, and has no other there.
fn exact<'n>(name: &'n str, place: &str) -> Result<std::borrow::Cow<'n, str>, Refusal> {
    let word = format!(" {name} ");
    if !is_plain(name) || UNRAW.contains(&word) {
        let instead = "names of functions and arguments are letters, digits and `_`, and no `self`";
        return Err(cannot("Rust", place, format!("the name `{name}`"), instead));
    }
    Ok(if KEYWORDS.contains(&word) { format!("r#{name}").into() } else { name.into() })
}

/// A name of a field or variant, which may have another in the description.
fn renamed(given: &str, name: &str) -> (String, Option<String>) {
    let word = format!(" {given} ");
    let rename = |ident: String| (ident, Some(format!("#[serde(rename = {name:?})]\n")));
    match given {
        given if UNRAW.contains(&word) => rename(format!("{given}_")),
        given if KEYWORDS.contains(&word) && given == name => (format!("r#{given}"), None),
        given if KEYWORDS.contains(&word) => rename(format!("{given}_")),
        given if given == name => (given.to_owned(), None),
        given => rename(given.to_owned()),
    }
}

impl<'a> RustCode<'a> {
    fn of(blueprint: &'a Blueprint<'a>) -> Result<Self, Refusal> {
        let name = blueprint.name;
        if !is_plain(name) || format!("{KEYWORDS}{UNRAW}").contains(&format!(" {name} ")) {
            return Err(cannot("Rust", "", format!("a trait called `{name}`"), "its name is letters and digits"));
        }
        let own = [name.to_owned(), format!("{name}Interface"), format!("{name}Proxy")];
        let taken = PRELUDE.split_whitespace().chain(["Self"]).chain(own.iter().map(String::as_str));
        let mut scope = Scope::with(taken);
        let (mut paths, mut there) = (Vec::new(), Vec::new());
        for named in &blueprint.types {
            let standard = standard_name(named.ty, named.name);
            there.push(standard.is_some());
            let own = || scope.give(&camel(last(named.name), "Type"), "");
            paths.push(standard.map_or_else(own, |name| format!("rohrpost::types::{name}")));
        }
        let mut rust =
            Self { defined: blueprint.defined(|place| there[place]), blueprint, name, paths, ordered: Vec::new() };
        for (place, named) in blueprint.types.iter().enumerate() {
            let is_ordered = !there[place] && named.body.parts().all(|part| rust.is_ordered(&part.layout));
            rust.ordered.push(is_ordered);
        }
        Ok(rust)
    }

    fn is_ordered(&self, layout: &Layout) -> bool {
        match layout {
            Layout::Plain(plain) => !matches!(plain.ty, Type::F32 | Type::F64),
            Layout::Option(inner) | Layout::List(inner) | Layout::Array(_, inner) => self.is_ordered(inner),
            Layout::Map(a, b) | Layout::Result(a, b) => self.is_ordered(a) && self.is_ordered(b),
            Layout::Tuple(all) => all.iter().all(|one| self.is_ordered(one)),
            Layout::Named(place) => self.ordered[*place],
        }
    }

    fn ty(&self, layout: &Layout, place: &str) -> Result<String, Refusal> {
        let inner = |layout: &Layout| self.ty(layout, place);
        Ok(match layout {
            Layout::Plain(plain) => plain.rust.into(),
            Layout::Option(some) => format!("Option<{}>", inner(some)?),
            Layout::List(element) => format!("Vec<{}>", inner(element)?),
            Layout::Array(length, _) if *length > 32 => {
                let what = format!("an array of {length} in what travels");
                return Err(cannot("Rust", place, what, "serde has those of at most 32; take a list, or several"));
            }
            Layout::Array(length, element) => format!("[{}; {length}]", inner(element)?),
            Layout::Map(key, _) if !self.is_ordered(key) => {
                return Err(cannot("Rust", place, "keys with fractions in a map", "take whole numbers or texts"));
            }
            Layout::Map(key, value) => format!("std::collections::BTreeMap<{}, {}>", inner(key)?, inner(value)?),
            Layout::Tuple(all) if all.is_empty() || all.len() > 8 => {
                let what = format!("a tuple of {} in what travels", all.len());
                return Err(cannot("Rust", place, what, "those of 1 to 8 elements are described; take a struct"));
            }
            Layout::Tuple(all) => {
                let all: Vec<String> = all.iter().map(inner).collect::<Result<_, _>>()?;
                format!("({}{})", all.join(", "), if all.len() == 1 { "," } else { "" })
            }
            Layout::Result(value, error) => format!("Result<{}, {}>", inner(value)?, inner(error)?),
            Layout::Named(place) => self.paths[*place].clone(),
        })
    }

    fn definition(&self, named: &NamedType<'_>, place: usize) -> Result<String, Refusal> {
        let ident = &self.paths[place];
        let mut code = wrapped("/// ", &in_rust_doc(named.text));
        let silent = |parts: &[TypedField<'_>]| parts.iter().any(|part| one_line(&part.field.text).is_empty());
        let is_silent = match &named.body {
            Body::Struct(inside) => code.is_empty() || silent(inside.parts()),
            Body::Enum(variants) => {
                let without = |text: &str| one_line(text).is_empty();
                code.is_empty() || variants.iter().any(|it| without(it.text) || silent(it.inside.parts()))
            }
        };
        if is_silent {
            code += "#[allow(missing_docs, reason = \"the interface says no more\")]\n";
        }
        let order = if self.ordered[place] { ", Eq, PartialOrd, Ord" } else { "" };
        code += &format!("#[rohrpost::data]\n#[derive(Clone, Debug, PartialEq{order})]\n");
        if ident != named.name {
            code += &format!("#[schema(name = {:?})]\n", named.name);
        }
        match &named.body {
            Body::Struct(inside) => {
                let end = if matches!(inside, Inside::Fields(_)) { "" } else { ";" };
                code += &format!("pub struct {ident}{}{end}\n", self.inside(inside, named.name, "pub ", "")?);
            }
            Body::Enum(variants) => {
                code += &format!("pub enum {ident} {{\n");
                let mut scope = Scope::default();
                for variant in variants {
                    let given = scope.give(&camel(variant.name, "Variant"), "");
                    let (ident, rename) = renamed(&given, variant.name);
                    code += &wrapped("    /// ", &in_rust_doc(variant.text));
                    code += &rename.map_or(String::new(), |rename| format!("    {rename}"));
                    let place = format!("{}.{}", named.name, variant.name);
                    code += &format!("    {ident}{},\n", self.inside(&variant.inside, &place, "", "    ")?);
                }
                code += "}\n";
            }
        }
        Ok(code)
    }

    /// What stands behind the name of a struct or variant.
    fn inside(&self, inside: &Inside<'_>, place: &str, vis: &str, indent: &str) -> Result<String, Refusal> {
        let unnamed = |part: &TypedField<'_>| {
            let said = said(part.field).map_or(String::new(), |said| format!("{said} "));
            Ok(format!("{said}{vis}{}", self.ty(&part.layout, place)?))
        };
        Ok(match inside {
            Inside::Nothing => String::new(),
            Inside::One(part) => format!("({})", unnamed(part)?),
            Inside::Tuple(parts) if parts.len() == 1 => {
                return Err(cannot("Rust", place, "several parts that are one", "one part is the thing itself"));
            }
            Inside::Tuple(parts) => {
                format!("({})", parts.iter().map(unnamed).collect::<Result<Vec<_>, Refusal>>()?.join(", "))
            }
            Inside::Fields(parts) => {
                let mut code = String::from(" {\n");
                let mut scope = Scope::default();
                for part in parts {
                    let name = part.field.name.as_str();
                    let (ident, rename) = renamed(&scope.give(&snake(name, "field"), "_"), name);
                    code += &wrapped(&format!("{indent}    /// "), &in_rust_doc(&part.field.text));
                    code += &rename.map_or(String::new(), |rename| format!("{indent}    {rename}"));
                    code += &said(part.field).map_or(String::new(), |said| format!("{indent}    {said}\n"));
                    let place = format!("{place}.{name}");
                    code += &format!("{indent}    {vis}{ident}: {},\n", self.ty(&part.layout, &place)?);
                }
                code + indent + "}"
            }
        })
    }

    fn interface(&self) -> Result<String, Refusal> {
        let Blueprint { name, class, text, operations, published, .. } = self.blueprint;
        let mut code = wrapped("/// ", &in_rust_doc(text));
        let silent =
            operations.iter().map(|it| &it.function.text).chain(published.iter().map(|it| &it.part.field.text));
        if code.is_empty() || silent.clone().any(|text| one_line(text).is_empty()) {
            code += "#[allow(missing_docs, reason = \"the interface says no more\")]\n";
        }
        code += &format!("#[rohrpost::interface(class = {class:?})]\npub trait {name} {{\n");
        for (at, operation) in operations.iter().enumerate() {
            code += if at == 0 { "" } else { "\n" };
            code += &self.operation(operation)?;
        }
        let mut constants = BTreeSet::new();
        for (at, published) in published.iter().enumerate() {
            let name = &published.part.field.name;
            if !constants.insert(name.to_uppercase()) {
                let what = format!("two constants called {}", name.to_uppercase());
                return Err(cannot("Rust", name, what, "give data names that differ in more than capitals"));
            }
            code += if at == 0 && operations.is_empty() { "" } else { "\n" };
            code += &self.published(published)?;
        }
        Ok(code + "}\n")
    }

    fn operation(&self, operation: &Operation<'_>) -> Result<String, Refusal> {
        let (function, name) = (operation.function, operation.function.name.as_str());
        self.free(name)?;
        if operation.arguments.len() > 8 {
            return Err(cannot("Rust", name, "more than eight arguments", "put them into a struct"));
        }
        let mut code = wrapped("    /// ", &in_rust_doc(&function.text));
        let idempotent = if function.idempotent { ", idempotent" } else { "" };
        code += &format!("    #[command({}{idempotent})]\n", function.number);
        let (mut short, mut long) = (String::from("&mut self"), String::from("        &mut self,\n"));
        for part in &operation.arguments {
            let place = format!("{name}.{}", part.field.name);
            let argument = format!("{}: {}", exact(&part.field.name, &place)?, self.ty(&part.layout, &place)?);
            let said = said(part.field);
            short += &format!(", {}{argument}", said.as_ref().map_or(String::new(), |said| format!("{said} ")));
            long += &wrapped("        // ", &one_line(&part.field.text));
            long += &format!("        {}{argument},\n", said.map_or(String::new(), |said| format!("{said} ")));
        }
        let result = match &operation.result {
            layout if layout.is(&Type::Unit) => String::new(),
            result => format!(" -> {}", self.ty(result, name)?),
        };
        let fn_name = exact(name, name)?;
        let line = format!("    fn {fn_name}({short}){result};\n");
        let has_texts = operation.arguments.iter().any(|part| !one_line(&part.field.text).is_empty());
        let fits = line.chars().count() <= COLUMNS && !has_texts;
        Ok(code + &if fits { line } else { format!("    fn {fn_name}(\n{long}    ){result};\n") })
    }

    /// Whether a proxy has no other function of this name.
    fn free(&self, name: &str) -> Result<(), Refusal> {
        let begins = |other: &Operation<'_>| name.strip_prefix("begin_") == Some(&other.function.name);
        if ["new", "with_timeout"].contains(&name) || self.blueprint.operations.iter().any(begins) {
            let what = format!("`{name}`: each proxy has a function of this name");
            return Err(cannot("Rust", name, what, "give it another name where the interface is written"));
        }
        Ok(())
    }

    fn published(&self, published: &Published<'_>) -> Result<String, Refusal> {
        let (field, name) = (published.part.field, published.part.field.name.as_str());
        self.free(name)?;
        if published.number == 0 {
            return Err(RefusedFor::Number(0, "data in Rust", "1 to 16384").at(name));
        }
        let mut code = wrapped("    /// ", &in_rust_doc(&field.text));
        let word = match published.kind {
            DataKind::Data => "data",
            DataKind::Stream => "stream",
        };
        code += &format!("    #[{word}({})]\n", published.number);
        code += &said(field).map_or(String::new(), |said| format!("    {said}\n"));
        code += &format!("    fn {}() -> {};\n", exact(name, name)?, self.ty(&published.part.layout, name)?);
        Ok(code)
    }
}

/// `#[schema(unit = "m/s", min = 0.0, max = 1.5)]`, if anything is said. Bounds that the attribute would refuse stay in
/// the comment alone.
fn said(field: &Field) -> Option<String> {
    let unit = Some(format!("unit = {:?}", field.unit)).filter(|_| !field.unit.is_empty());
    let (min, max) = bounds(field).unwrap_or_default();
    let words: Vec<String> = [unit, min.map(|it| format!("min = {it}")), max.map(|it| format!("max = {it}"))]
        .into_iter()
        .flatten()
        .collect();
    (!words.is_empty()).then(|| format!("#[schema({})]", words.join(", ")))
}

/// Both ends as literals; none where there are no such, or the lower is above the upper.
fn bounds(field: &Field) -> Option<(Option<String>, Option<String>)> {
    use Type::{F32, F64, I8, I16, I32, I64, I128, U8, U16, U32, U64, U128};
    if !matches!(field.ty, U8 | U16 | U32 | U64 | U128 | I8 | I16 | I32 | I64 | I128 | F32 | F64) {
        return None;
    }
    let (least, most) = field.bounds();
    if (least.is_none(), most.is_none()) != (field.least.is_none(), field.most.is_none()) {
        return None;
    }
    let is_above = match (&least, &most) {
        (Some(Value::U(least)), Some(Value::U(most))) => least > most,
        (Some(Value::I(least)), Some(Value::I(most))) => least > most,
        (Some(Value::F(least)), Some(Value::F(most))) => least > most,
        _ => false,
    };
    let ends = (least.as_ref().map(literal), most.as_ref().map(literal));
    match ends {
        (Some(None), _) | (_, Some(None)) => None,
        (least, most) if !is_above => Some((least.flatten(), most.flatten())),
        _ => None,
    }
}
