//! An interface as Python: a class of `rohrpost.Module` with its functions, to be given bodies in a class below it, and
//! classes for its types. The module compares its hash with the file's when it is imported.

use super::blueprint::{Blueprint, Body, Inside, Layout, NamedType, Operation, Published, TypedField, Variant};
use super::names::{Scope, camel, is_plain, last, snake, standard_name};
use super::refusal::{Refusal, cannot};
use super::texts::{in_docstring, literal, one_line, python_literal, wrapped};
use rohrpost::schema::{DataKind, Field, Type};
use std::cell::RefCell;
use std::collections::BTreeSet;

/// What no name can be.
const KEYWORDS: &str = " False None True and as assert async await break class continue def del elif else except \
    finally for from global if import in is lambda nonlocal not or pass raise return try while with yield _ __ self \
    match case type ";
/// Names that the code uses.
const USED: &str = "Annotated Enum HASH annotations bool bytes dict enum float int list rp str tuple";
/// Built in names that annotations use; of a field they would be hidden behind it.
const BUILT_IN: &str = " Annotated bool bytes dict enum float int list rp str tuple ";
/// Standard types that the package has.
const STANDARD: [&str; 6] = ["Image", "ImageFormat", "LaserScan", "Odometry", "Pose", "Twist"];
/// What each module and each member of an enum has already.
pub(super) const OF_MODULES: &str = " begin interface_ now_ns parameters_set proxy publish settings stream \
    switched_off switched_on unwatch watch write ";
const OF_ENUMS: &str = " mro name value ";

/// The whole file.
pub(super) fn write(blueprint: &Blueprint<'_>) -> Result<String, Refusal> {
    let python = PythonCode::of(blueprint);
    let mut classes = String::new();
    for place in &python.defined {
        classes += "\n\n";
        classes += &python.definition(&blueprint.types[*place], *place)?;
    }
    classes += "\n\n";
    classes += &python.interface();
    let imports = [("(enum.Enum)", "import enum\n"), ("Annotated[", "from typing import Annotated\n")];
    let imports: String =
        imports.iter().filter(|(word, _)| classes.contains(word)).map(|(_, import)| *import).collect();
    let mut code = format!(
        r#""""Interface ``{}`` of class ``{}``.

Made by ``rohrpost interface generate --lang python``: do not change it here, but where it was written, and make this
anew.
"""

from __future__ import annotations

{imports}import rohrpost as rp

HASH = {:#010x}
"""Of the interface: that of the file of which this was made."""
"#,
        in_docstring(blueprint.name),
        in_docstring(blueprint.class),
        blueprint.hash,
        imports = if imports.is_empty() { imports } else { imports + "\n" },
    );
    code += &classes;
    code += &format!(
        "\n\nif {name}.interface_.description.hash != HASH:\n    raise rp.Misuse({told})\n",
        name = python.name,
        told = python_literal(&format!(
            "{}: this package makes another interface of this module than the file had; make it anew",
            blueprint.name
        )),
    );
    Ok(code)
}

struct PythonCode<'a> {
    blueprint: &'a Blueprint<'a>,
    /// Of the class.
    name: String,
    defined: BTreeSet<usize>,
    /// Of each type, as it is written where it is used.
    names: Vec<String>,
    /// Names of classes that are taken.
    classes: RefCell<Scope>,
}

/// A name that Python can have, near to this one; names that begin with two `_` mean something else inside of a class.
fn near(name: &str, more: &str, other: &str) -> String {
    let plain = is_plain(name) && !name.starts_with('_');
    let near = if plain { name.to_owned() } else { snake(name, other) };
    let word = format!(" {near} ");
    if [KEYWORDS, BUILT_IN, more].iter().any(|words| words.contains(&word)) { format!("{near}_") } else { near }
}

impl<'a> PythonCode<'a> {
    fn of(blueprint: &'a Blueprint<'a>) -> Self {
        let mut scope = Scope::with(USED.split_whitespace().chain(KEYWORDS.split_whitespace()));
        let name = scope.give(&camel(blueprint.name, "Interface"), "");
        let (mut names, mut there) = (Vec::new(), Vec::new());
        for named in &blueprint.types {
            let standard = standard_name(named.ty, named.name).filter(|name| STANDARD.contains(name));
            there.push(standard.is_some());
            let own = || scope.give(&camel(last(named.name), "Type"), "");
            names.push(standard.map_or_else(own, |name| format!("rp.{name}")));
        }
        let defined = blueprint.defined(|place| there[place]);
        Self { name, defined, blueprint, names, classes: RefCell::new(scope) }
    }

    fn ty(&self, layout: &Layout) -> String {
        let inner = |layout: &Layout| self.ty(layout);
        match layout {
            Layout::Plain(plain) => plain.python.into(),
            Layout::Option(some) if self.is_nullable(some) => format!("Annotated[{}, rp.maybe]", inner(some)),
            Layout::Option(some) => format!("{} | None", inner(some)),
            Layout::List(element) => format!("list[{}]", inner(element)),
            Layout::Array(length, element) => format!("Annotated[list[{}], rp.Length({length})]", inner(element)),
            Layout::Map(key, value) => format!("dict[{}, {}]", inner(key), inner(value)),
            Layout::Tuple(all) if all.is_empty() => "tuple[()]".into(),
            Layout::Tuple(all) => {
                format!("tuple[{}]", all.iter().map(inner).collect::<Vec<_>>().join(", "))
            }
            // Only a function returns it; its error stands at its decorator.
            Layout::Result(value, _) => inner(value),
            Layout::Named(place) => self.names[*place].clone(),
        }
    }

    /// Whether `None` is among its values.
    fn is_nullable(&self, layout: &Layout) -> bool {
        match layout {
            Layout::Plain(plain) => plain.ty == Type::Unit,
            Layout::Option(_) => true,
            Layout::Named(place) => match &self.blueprint.types[*place].body {
                Body::Struct(Inside::Nothing) => true,
                Body::Struct(Inside::One(part)) => self.is_nullable(&part.layout),
                _ => false,
            },
            _ => false,
        }
    }

    /// A type with what is said of it.
    fn annotation(&self, part: &TypedField<'_>, name: &str) -> String {
        let (ty, said) = (self.ty(&part.layout), said(part.field, name));
        if said.is_empty() { ty } else { format!("Annotated[{ty}, rp.said({said})]") }
    }

    fn definition(&self, named: &NamedType<'_>, place: usize) -> Result<String, Refusal> {
        let own = &self.names[place];
        let known = if own == named.name { String::new() } else { format!("name={}", python_literal(named.name)) };
        match &named.body {
            Body::Struct(inside) => self.structure(named, inside, own, &known),
            Body::Enum(variants) if variants.is_empty() => {
                Ok(format!("class {own}(rp.Choice{}, variants={{}}):\n{}", behind(&known), body("    ", named.text)))
            }
            Body::Enum(variants) if variants.iter().all(|it| matches!(it.inside, Inside::Nothing)) => {
                Ok(Self::words(named, variants, own, &known))
            }
            Body::Enum(variants) => self.choice(named, variants, own, &known),
        }
    }

    fn structure(&self, named: &NamedType<'_>, inside: &Inside<'_>, own: &str, known: &str) -> Result<String, Refusal> {
        let text = Some(one_line(named.text)).filter(|text| !text.is_empty());
        let wraps = || {
            let text = text.as_ref().map_or(String::new(), |text| format!(", {}", python_literal(text)));
            format!("rp.wrapped({}{text})", python_literal(named.name))
        };
        Ok(match inside {
            Inside::Nothing => format!("{}\nclass {own}:\n{}", decorated(known), body("    ", named.text)),
            Inside::One(part) => {
                format!("{own} = Annotated[{}, {}]\n", self.annotation(part, ""), wraps())
            }
            Inside::Tuple(parts) => {
                format!("{own} = Annotated[{}, {}, rp.inline]\n", self.elements(parts), wraps())
            }
            Inside::Fields(parts) => self.class(named.name, text.as_deref().unwrap_or_default(), parts, own, known)?,
        })
    }

    fn elements(&self, parts: &[TypedField<'_>]) -> String {
        let all: Vec<String> = parts.iter().map(|part| self.annotation(part, "")).collect();
        format!("tuple[{}]", if all.is_empty() { "()".into() } else { all.join(", ") })
    }

    fn class(
        &self,
        name: &str,
        text: &str,
        parts: &[TypedField<'_>],
        own: &str,
        known: &str,
    ) -> Result<String, Refusal> {
        if parts.is_empty() {
            return Err(cannot(
                "Python",
                name,
                "named fields of which there are none",
                "give it a field, or none without names",
            ));
        }
        let mut code = format!("{}\nclass {own}:\n", decorated(known));
        code += &docstring("    ", text).map_or(String::new(), |text| text + "\n");
        let mut scope = Scope::default();
        for part in parts {
            let wire = part.field.name.as_str();
            let field = scope.give(&near(wire, "", "field"), "_");
            let renamed = if field == wire { "" } else { wire };
            code += &format!("    {field}: {}\n", self.annotation(part, renamed));
        }
        Ok(code)
    }

    /// An enum with variants that carry nothing.
    fn words(named: &NamedType<'_>, variants: &[Variant<'_>], own: &str, known: &str) -> String {
        let names: Vec<&str> = variants.iter().map(|variant| variant.name).collect();
        if names.iter().any(|name| near(name, OF_ENUMS, "") != *name) {
            let variants: Vec<String> = names.iter().map(|name| format!("{}: None", python_literal(name))).collect();
            let base = format!("rp.Choice{}, variants={{{}}}", behind(known), variants.join(", "));
            return format!("class {own}({base}):\n{}", body("    ", named.text));
        }
        let mut code = format!("{}\nclass {own}(enum.Enum):\n", decorated(known));
        code += &docstring("    ", named.text).map_or(String::new(), |text| text + "\n");
        for (number, variant) in variants.iter().enumerate() {
            code += &format!("    {} = {number}\n", variant.name);
            code += &docstring("    ", variant.text).unwrap_or_default();
        }
        code
    }

    /// An enum of which variants carry something.
    fn choice(
        &self,
        named: &NamedType<'_>,
        variants: &[Variant<'_>],
        own: &str,
        known: &str,
    ) -> Result<String, Refusal> {
        let (mut before, mut entries, mut texts) = (String::new(), String::new(), String::new());
        for variant in variants {
            let place = format!("{}.{}", named.name, variant.name);
            let carried = match &variant.inside {
                Inside::Nothing => "None".into(),
                // `None` alone would be a variant that carries nothing.
                Inside::One(part) if part.layout.is(&Type::Unit) && said(part.field, "").is_empty() => {
                    "Annotated[None, rp.said()]".into()
                }
                Inside::One(part) => self.annotation(part, ""),
                Inside::Tuple(parts) => format!("Annotated[{}, rp.inline]", self.elements(parts)),
                Inside::Fields(parts) => {
                    let class = format!("{own}{}", camel(variant.name, "Variant"));
                    let class = self.classes.borrow_mut().give(&class, "_");
                    before += &self.class(&place, &one_line(variant.text), parts, &class, "")?;
                    before += "\n\n";
                    format!("Annotated[{class}, rp.inline]")
                }
            };
            entries += &format!("        {}: {carried},\n", python_literal(variant.name));
            let text = one_line(variant.text);
            if !text.is_empty() {
                texts += &wrapped("    ", &format!("{}: {}", in_docstring(variant.name), in_docstring(&text)));
            }
        }
        let known = if known.is_empty() { String::new() } else { format!("    {known},\n") };
        let base = format!("\n    rp.Choice,\n{known}    variants={{\n{entries}    }},\n");
        let text = docstring("    ", named.text).unwrap_or_default();
        let body = match (text.is_empty(), texts.is_empty()) {
            (true, true) => "    ...\n".to_owned(),
            (_, true) => text,
            (true, false) => format!("    \"\"\"\n{texts}    \"\"\"\n"),
            (false, false) => {
                let open = text.strip_suffix("\"\"\"\n").unwrap_or(&text);
                format!("{open}\n\n{texts}    \"\"\"\n")
            }
        };
        Ok(format!("{before}class {own}({base}):\n{body}"))
    }

    fn interface(&self) -> String {
        let Blueprint { name, class, text, operations, published, .. } = self.blueprint;
        let known = if self.name == *name { String::new() } else { format!(", interface={}", python_literal(name)) };
        let mut code = format!("class {}(rp.Module, klass={}{known}):\n", self.name, python_literal(class));
        code += &docstring("    ", text).unwrap_or_default();
        if operations.is_empty() && published.is_empty() && one_line(text).is_empty() {
            code += "    ...\n";
        }
        let mut scope = Scope::default();
        for operation in operations {
            code.push('\n');
            code += &self.operation(operation, &mut scope);
        }
        for published in published {
            code.push('\n');
            code += &self.published(published, &mut scope);
        }
        code
    }

    fn operation(&self, operation: &Operation<'_>, scope: &mut Scope) -> String {
        let (function, name) = (operation.function, operation.function.name.as_str());
        let own = scope.give(&near(name, OF_MODULES, "function"), "_");
        let mut words = vec![function.number.to_string()];
        words.extend(function.idempotent.then(|| "idempotent=True".into()));
        if let Layout::Result(_, error) = &operation.result {
            words.push(format!("error={}", self.ty(error)));
        }
        words.extend((own != name).then(|| format!("name={}", python_literal(name))));
        let mut arguments = Scope::with(["self"]);
        let mut code = format!("    @rp.command({})\n    def {own}(\n        self,\n", words.join(", "));
        for part in &operation.arguments {
            let wire = part.field.name.as_str();
            let argument = arguments.give(&near(wire, "", "argument"), "_");
            let renamed = if argument == wire { "" } else { wire };
            code += &format!("        {argument}: {},\n", self.annotation(part, renamed));
        }
        if operation.arguments.is_empty() {
            code = code.replace("(\n        self,\n", "(self");
        } else {
            code += "    ";
        }
        code += &format!(") -> {}:\n", self.ty(&operation.result));
        code += &docstring("        ", &function.text).unwrap_or_default();
        code + "        raise NotImplementedError\n"
    }

    fn published(&self, published: &Published<'_>, scope: &mut Scope) -> String {
        let (field, name) = (published.part.field, published.part.field.name.as_str());
        let own = scope.give(&near(name, OF_MODULES, "data"), "_");
        let mut words = vec![published.number.to_string()];
        words.extend((own != name).then(|| format!("name={}", python_literal(name))));
        let silent = Field { text: String::new(), ..field.clone() };
        let part = TypedField { field: &silent, layout: published.part.layout.clone() };
        let ty = self.annotation(&part, "");
        let kind = match published.kind {
            DataKind::Data => "data_out",
            DataKind::Stream => "stream",
        };
        let mut code = format!("    @rp.{kind}({})\n    def {own}(self) -> {ty}:\n", words.join(", "));
        code += &docstring("        ", &field.text).unwrap_or_default();
        code + "        raise NotImplementedError\n"
    }
}

fn decorated(known: &str) -> String {
    if known.is_empty() { "@rp.data".into() } else { format!("@rp.data({known})") }
}

fn behind(known: &str) -> String {
    if known.is_empty() { String::new() } else { format!(", {known}") }
}

fn docstring(indent: &str, text: &str) -> Option<String> {
    let text = one_line(text);
    if text.is_empty() {
        return None;
    }
    let mut lines = wrapped(indent, &in_docstring(&text));
    lines.insert_str(indent.len(), "\"\"\"");
    Some(lines.trim_end().to_owned() + "\"\"\"\n")
}

/// Of a class that has nothing but a text.
fn body(indent: &str, text: &str) -> String {
    docstring(indent, text).unwrap_or_else(|| format!("{indent}...\n"))
}

/// Arguments of `rp.said`.
fn said(field: &Field, name: &str) -> String {
    let mut words = Vec::new();
    let mut add = |key: &str, text: &str| {
        if !text.is_empty() {
            words.push(format!("{key}={}", python_literal(text)));
        }
    };
    add("name", name);
    add("unit", &field.unit);
    let (least, most) = field.bounds();
    let bounds = [("min", least.as_ref().and_then(literal)), ("max", most.as_ref().and_then(literal))];
    add("text", &one_line(&field.text));
    let bounds = bounds.into_iter().filter_map(|(key, bound)| Some(format!("{key}={}", bound?)));
    words.extend(bounds);
    words.join(", ")
}
