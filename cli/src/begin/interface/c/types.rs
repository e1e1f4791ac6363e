//! Types of C for those of an interface: each once, what one has inside before it.

use super::super::blueprint::{Blueprint, Body, Inside, Layout, TypedField};
use super::super::names::{Scope, is_plain, last, snake};
use super::super::refusal::{Refusal, cannot};
use super::super::texts::{of_field, one_line};
use super::functions::{self, CType, Carried, Member};
use std::collections::HashMap;

/// Bytes that a value may have in C: what somebody puts on a stack.
const SIZE_MAX: u64 = 1 << 20;
/// Longer names of what has none are numbered.
const NAME_MAX: usize = 48;
/// Keywords of C11 and C++17, and macros of usual headers.
const KEYWORDS: &str = " alignas alignof and and_eq asm auto bitand bitor bool break case catch char char16_t \
    char32_t class compl const const_cast constexpr continue decltype default delete do double dynamic_cast else \
    enum errno explicit export extern false float for friend goto i386 if inline int linux long mutable namespace \
    new noexcept not not_eq nullptr operator or or_eq private protected public register reinterpret_cast restrict \
    return short signed sizeof static static_assert static_cast stderr stdin stdout struct switch template this \
    thread_local throw true try typedef typeid typename typeof union unix unsigned using virtual void volatile \
    wchar_t while xor xor_eq ";

/// Types that are written so far.
pub(super) struct CTypes<'a> {
    blueprint: &'a Blueprint<'a>,
    prefix: String,
    scope: Scope,
    known: HashMap<Layout, CType>,
    pub(super) code: String,
}

/// A name of a member, one of its scope.
fn member(name: &str, scope: &mut Scope) -> String {
    let near = if is_plain(name) && !name.starts_with('_') { name.to_owned() } else { snake(name, "member") };
    let is_keyword = KEYWORDS.contains(&format!(" {near} "));
    scope.give(&if is_keyword { format!("{near}_") } else { near }, "_")
}

impl<'a> CTypes<'a> {
    pub(super) fn new(blueprint: &'a Blueprint<'a>, prefix: &str) -> Self {
        let own = format!("{prefix}_description");
        let macros = ["CLASS", "HASH"].map(|word| format!("{}_{word}", prefix.to_uppercase()));
        let standard = "int8_t int16_t int32_t int64_t uint8_t uint16_t uint32_t uint64_t size_t intptr_t uintptr_t";
        let scope = Scope::with(macros.iter().chain([&own]).map(String::as_str).chain(standard.split(' ')));
        Self { blueprint, prefix: prefix.into(), scope, known: HashMap::new(), code: String::new() }
    }

    /// A name for a macro or a constant.
    pub(super) fn constant(&mut self, name: &str) -> String {
        self.scope.give(name, "_")
    }

    /// A type. Names of its functions follow from its own.
    fn made(&mut self, name: &str) -> String {
        self.scope.give_with(name, "_", &["_write", "_read", "_encode", "_decode"])
    }

    pub(super) fn of(&mut self, layout: &Layout, place: &str) -> Result<CType, Refusal> {
        if let Some(known) = self.known.get(layout) {
            return Ok(known.clone());
        }
        let made = self.make(layout, place)?;
        if made.size > SIZE_MAX {
            let what = format!("a value of {} bytes", made.size);
            return Err(cannot("C", place, what, "a list has its elements elsewhere; arrays have them in place"));
        }
        self.known.insert(layout.clone(), made.clone());
        Ok(made)
    }

    fn make(&mut self, layout: &Layout, place: &str) -> Result<CType, Refusal> {
        Ok(match layout {
            Layout::Plain(plain) => CType::plain(plain),
            Layout::Option(some) => {
                let some = self.of(some, place)?;
                let name = self.around("option", &some);
                functions::option(&name, &some, &mut self.code);
                CType::structured(name, some.size.saturating_add(8), true)
            }
            Layout::List(element) => {
                let element = self.of(element, place)?;
                self.list(&element)
            }
            Layout::Map(key, value) => {
                let members = [("key", key), ("value", value)].map(|(name, layout)| {
                    Ok(Member { name: name.into(), ty: self.of(layout, place)?, text: String::new() })
                });
                let members: Vec<Member> = members.into_iter().collect::<Result<_, Refusal>>()?;
                let name = self.made(&format!("{}_entry", self.prefix));
                let entry = self.structure(name, "", &members);
                self.list(&entry)
            }
            Layout::Array(length, element) => {
                let element = self.of(element, place)?;
                let name = self.around(&format!("array{length}"), &element);
                let size = element.size.saturating_mul(u64::from((*length).max(1)));
                if size <= SIZE_MAX {
                    functions::array(&name, *length, &element, &mut self.code);
                }
                CType::structured(name, size, *length > 0 && element.takes_bytes)
            }
            Layout::Tuple(all) => {
                let mut members = Vec::new();
                for (at, layout) in all.iter().enumerate() {
                    let ty = self.of(layout, place)?;
                    members.push(Member { name: format!("v{at}"), ty, text: String::new() });
                }
                let name = self.made(&format!("{}_tuple", self.prefix));
                self.structure(name, "", &members)
            }
            // Only functions return it, and these have a type of their own.
            Layout::Result(value, error) => self.result(&format!("{}_result", self.prefix), value, error, place)?,
            Layout::Named(index) => self.named(*index)?,
        })
    }

    /// A name after what is inside, as far as that can be read.
    fn around(&mut self, word: &str, inner: &CType) -> String {
        let inner = inner.short(&format!("{}_", self.prefix));
        let name = format!("{}_{word}_{inner}", self.prefix);
        let name = if name.len() > NAME_MAX { format!("{}_{word}", self.prefix) } else { name };
        self.made(&name)
    }

    fn list(&mut self, element: &CType) -> CType {
        let name = self.around("list", element);
        functions::list(&name, element, &mut self.code);
        CType::structured(name, 16, true)
    }

    fn structure(&mut self, name: String, text: &str, members: &[Member]) -> CType {
        functions::structure(&name, text, members, &mut self.code);
        let size = members.iter().fold(0_u64, |sum, member| sum.saturating_add(member.ty.size.max(8)));
        CType::structured(name, size, members.iter().any(|member| member.ty.takes_bytes))
    }

    fn members(&mut self, parts: &[TypedField<'_>], place: &str) -> Result<Vec<Member>, Refusal> {
        let mut scope = Scope::default();
        let mut members = Vec::new();
        for (at, part) in parts.iter().enumerate() {
            let name = match part.field.name.as_str() {
                "" => format!("v{at}"),
                name => member(name, &mut scope),
            };
            let is_other = !part.field.name.is_empty() && name != part.field.name;
            let known = if is_other { format!("`{}`. ", part.field.name) } else { String::new() };
            let ty = self.of(&part.layout, &format!("{place}.{}", part.field.name))?;
            members.push(Member { name, ty, text: known + &of_field(part.field) });
        }
        Ok(members)
    }

    /// The arguments of a function, one after the other.
    pub(super) fn arguments(&mut self, name: &str, parts: &[TypedField<'_>], place: &str) -> Result<CType, Refusal> {
        let members = self.members(parts, place)?;
        let name = self.made(name);
        Ok(self.structure(name, "", &members))
    }

    /// What a function returns that may fail.
    pub(super) fn result(&mut self, name: &str, value: &Layout, error: &Layout, place: &str) -> Result<CType, Refusal> {
        let (value, error) = (self.of(value, place)?, self.of(error, place)?);
        let name = self.made(name);
        let arms = [("ok", value), ("error", error)].map(|(member, ty)| Carried {
            constant: self.scope.give(&format!("{}_{}", name.to_uppercase(), member.to_uppercase()), "_"),
            text: String::new(),
            member: Some((member.to_owned(), ty)),
        });
        Ok(self.choice(name, "", &arms))
    }

    fn choice(&mut self, name: String, text: &str, variants: &[Carried]) -> CType {
        functions::choice(&name, text, variants, &mut self.code);
        let sizes = variants.iter().filter_map(|it| it.member.as_ref()).map(|(_, ty)| ty.size);
        CType::structured(name, sizes.max().unwrap_or(0).saturating_add(8), true)
    }

    fn named(&mut self, index: usize) -> Result<CType, Refusal> {
        let named = &self.blueprint.types[index];
        let place = named.name;
        let known = format!("{}_{}", self.prefix, snake(last(named.name), "type"));
        match &named.body {
            Body::Struct(inside) => {
                let members = self.members(inside.parts(), place)?;
                let name = self.made(&known);
                Ok(self.structure(name, named.text, &members))
            }
            Body::Enum(variants) if variants.is_empty() => {
                Err(cannot("C", place, "an enum without variants", "give it one"))
            }
            Body::Enum(variants) => {
                // What variants carry stands before the enum.
                let mut carried = Vec::new();
                for variant in variants {
                    let place = format!("{place}.{}", variant.name);
                    carried.push(match &variant.inside {
                        Inside::Nothing => None,
                        Inside::One(part) => Some(self.of(&part.layout, &place)?),
                        Inside::Tuple(parts) | Inside::Fields(parts) => {
                            let members = self.members(parts, &place)?;
                            let name = self.made(&format!("{known}_{}", snake(variant.name, "variant")));
                            Some(self.structure(name, variant.text, &members))
                        }
                    });
                }
                let name = self.made(&known);
                let mut scope = Scope::default();
                let mut all = Vec::new();
                for (variant, ty) in variants.iter().zip(carried) {
                    let word = snake(variant.name, "variant");
                    let constant = format!("{}_{}", name.to_uppercase(), word.to_uppercase());
                    let member = ty.map(|ty| (member(&word, &mut scope), ty));
                    let text = one_line(variant.text);
                    all.push(Carried { constant: self.scope.give(&constant, "_"), text, member });
                }
                Ok(self.choice(name, named.text, &all))
            }
        }
    }

    /// The type of data or of a result, under a name of its own, with functions for all bytes.
    pub(super) fn alias(&mut self, name: &str, layout: &Layout, place: &str) -> Result<(), Refusal> {
        let ty = self.of(layout, place)?;
        let name = self.made(name);
        self.code += &format!("typedef {} {name};\n\n", ty.name);
        functions::whole_as(&name, &ty, &mut self.code);
        Ok(())
    }
}
