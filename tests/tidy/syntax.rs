//! What single items of a source bring, define and lead to.

use std::collections::BTreeSet;

/// A path from the root of its crate.
pub(crate) type Place = Vec<String>;

/// One name that a `use` brings, or all those of a path.
pub(crate) struct Used {
    pub(crate) path: Place,
    pub(crate) name: Option<String>,
}

pub(crate) fn used(tree: &syn::UseTree) -> Vec<Used> {
    let one =
        |name: &syn::Ident, called: &syn::Ident| Used { path: vec![name.to_string()], name: Some(called.to_string()) };
    match tree {
        syn::UseTree::Path(path) => {
            let (first, mut below) = (path.ident.to_string(), used(&path.tree));
            for used in &mut below {
                // `a::{self}` is `a`.
                if used.path == ["self"] {
                    used.path.clear();
                    used.name = used.name.take().map(|name| if name == "self" { first.clone() } else { name });
                }
                used.path.insert(0, first.clone());
            }
            below
        }
        syn::UseTree::Name(name) => vec![one(&name.ident, &name.ident)],
        syn::UseTree::Rename(rename) => vec![one(&rename.ident, &rename.rename)],
        syn::UseTree::Glob(_) => vec![Used { path: Vec::new(), name: None }],
        syn::UseTree::Group(group) => group.items.iter().flat_map(used).collect(),
    }
}

/// A path as seen from a module, from the root of the crate; none if it begins with something that is no module here.
pub(crate) fn absolute(place: &Place, children: &BTreeSet<String>, path: &[String]) -> Option<Place> {
    let (first, mut rest) = path.split_first()?;
    let mut begin = place.clone();
    match first.as_str() {
        "crate" => begin.clear(),
        "self" => {}
        "super" => drop(begin.pop()),
        child if children.contains(child) => begin.push(first.clone()),
        _ => return None,
    }
    while let Some(("super", below)) = rest.split_first().map(|(name, below)| (name.as_str(), below)) {
        begin.pop();
        rest = below;
    }
    Some(begin.into_iter().chain(rest.iter().cloned()).collect())
}

pub(crate) fn is_test(attributes: &[syn::Attribute]) -> bool {
    let word = |attribute: &syn::Attribute| attribute.parse_args::<syn::Ident>().is_ok_and(|word| word == "test");
    attributes.iter().any(|attribute| attribute.path().is_ident("cfg") && word(attribute))
}

pub(crate) fn attributes(item: &syn::Item) -> &[syn::Attribute] {
    match item {
        syn::Item::Const(item) => &item.attrs,
        syn::Item::Enum(item) => &item.attrs,
        syn::Item::Fn(item) => &item.attrs,
        syn::Item::Impl(item) => &item.attrs,
        syn::Item::Macro(item) => &item.attrs,
        syn::Item::Mod(item) => &item.attrs,
        syn::Item::Static(item) => &item.attrs,
        syn::Item::Struct(item) => &item.attrs,
        syn::Item::Trait(item) => &item.attrs,
        syn::Item::Type(item) => &item.attrs,
        syn::Item::Use(item) => &item.attrs,
        _ => &[],
    }
}

pub(crate) fn type_name(item: &syn::Item) -> Option<String> {
    let is_type = matches!(
        item,
        syn::Item::Enum(_) | syn::Item::Struct(_) | syn::Item::Trait(_) | syn::Item::Type(_) | syn::Item::Union(_)
    );
    if is_type { defines(item) } else { None }
}

pub(crate) fn defines(item: &syn::Item) -> Option<String> {
    let ident = match item {
        syn::Item::Const(item) => &item.ident,
        syn::Item::Enum(item) => &item.ident,
        syn::Item::Fn(item) => &item.sig.ident,
        syn::Item::Static(item) => &item.ident,
        syn::Item::Struct(item) => &item.ident,
        syn::Item::Trait(item) => &item.ident,
        syn::Item::Type(item) => &item.ident,
        syn::Item::Union(item) => &item.ident,
        _ => return None,
    };
    Some(ident.to_string())
}
