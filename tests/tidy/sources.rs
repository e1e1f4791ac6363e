//! The files of a crate, and which names which.
//!
//! A file *names* another when a path in it leads to something defined there: `use crate::a::B`, `super::B`, `a::B`
//! with `a` imported or declared here, also in attributes. Re-exports are looked through. A parent that declares
//! `mod a;` and re-exports from below does not name what it re-exports. Tests are left out.

use crate::syntax::{Place, Used, absolute, attributes, defines, is_test, type_name, used};
use proc_macro2::{TokenStream, TokenTree};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use syn::visit::{self, Visit};

/// Roots of all crates: their `src/lib.rs` and `src/main.rs`.
pub(crate) fn find_crates(folder: &Path, found: &mut Vec<PathBuf>) {
    if folder.join("Cargo.toml").exists() {
        found.extend(["src/lib.rs", "src/main.rs"].map(|name| folder.join(name)).into_iter().filter(|it| it.exists()));
    }
    let mut folders: Vec<_> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    folders.sort();
    for below in folders.into_iter().filter(|it| it.is_dir()) {
        let name = below.file_name().unwrap().to_str().unwrap();
        if !name.starts_with('.') && !["target", "src", "venv"].contains(&name) {
            find_crates(&below, found);
        }
    }
}

/// What a module has by name.
#[derive(Default)]
struct Module {
    file: String,
    children: BTreeSet<String>,
    /// Names brought by `use`, and where they lead.
    imports: BTreeMap<String, Place>,
    /// Modules with a glob import of all their names.
    globs: Vec<Place>,
    defined: BTreeSet<String>,
}

/// The modules of a crate, and which file names which, with an example.
#[derive(Default)]
pub(crate) struct Crate {
    modules: BTreeMap<Place, Module>,
    /// Macros that the root has, wherever they stand.
    exported: BTreeMap<String, String>,
    arrows: BTreeMap<(String, String), String>,
    /// Files that define a type of a name.
    types: BTreeMap<String, BTreeSet<String>>,
}

impl Crate {
    /// Names that several files give to types of their own.
    pub(crate) fn shared_type_names(&self) -> impl Iterator<Item = (&String, &BTreeSet<String>)> {
        self.types.iter().filter(|(_, files)| files.len() > 1)
    }

    pub(crate) fn read(source: &Path, root: &Path) -> Self {
        let mut read = Self::default();
        let mut files = Vec::new();
        read.file(source, root, Vec::new(), &mut files);
        for (file, place, parsed) in &files {
            let mut reader = Names { sources: &read, file, place: place.clone(), found: Vec::new() };
            reader.visit_file(parsed);
            let found = reader.found;
            for (target, text) in found {
                read.arrows.entry((file.clone(), target)).or_insert(text);
            }
        }
        read
    }

    fn file(&mut self, path: &Path, root: &Path, place: Place, files: &mut Vec<(String, Place, syn::File)>) {
        let parsed = syn::parse_file(&fs::read_to_string(path).unwrap()).unwrap();
        let name = path.strip_prefix(root).unwrap().to_str().unwrap().to_owned();
        let own_folder = ["mod.rs", "lib.rs", "main.rs"].contains(&path.file_name().unwrap().to_str().unwrap());
        let folder = if own_folder { path.parent().unwrap().to_owned() } else { path.with_extension("") };
        let mut below = Vec::new();
        self.module(&name, &place, &folder, &parsed.items, &mut below);
        files.push((name, place, parsed));
        for (path, place) in below {
            self.file(&path, root, place, files);
        }
    }

    /// Notes what a module has; the files of its children go into `below`.
    fn module(
        &mut self,
        file: &str,
        place: &Place,
        folder: &Path,
        items: &[syn::Item],
        below: &mut Vec<(PathBuf, Place)>,
    ) {
        let mut module = Module { file: file.to_owned(), ..Module::default() };
        let items = || items.iter().filter(|item| !is_test(attributes(item)));
        for item in items() {
            let (syn::Item::Mod(syn::ItemMod { ident, content, .. }), inner) = (item, folder) else { continue };
            let name = ident.to_string();
            let child: Place = place.iter().cloned().chain([name.clone()]).collect();
            if let Some((_, items)) = content {
                self.module(file, &child, &inner.join(&name), items, below);
            } else if let Some(path) = [format!("{name}.rs"), format!("{name}/mod.rs")]
                .map(|name| inner.join(name))
                .into_iter()
                .find(|it| it.exists())
            {
                below.push((path, child));
            } else {
                // Written by a build script.
                continue;
            }
            module.children.insert(name);
        }
        for item in items() {
            if let Some(name) = type_name(item) {
                self.types.entry(name).or_default().insert(file.to_owned());
            }
            match item {
                syn::Item::Use(item) => {
                    for Used { path, name } in used(&item.tree) {
                        let Some(target) = absolute(place, &module.children, &path) else { continue };
                        match name {
                            Some(name) => drop(module.imports.insert(name, target)),
                            None => module.globs.push(target),
                        }
                    }
                }
                syn::Item::Macro(item) if item.ident.is_some() => {
                    let name = item.ident.as_ref().unwrap().to_string();
                    if item.attrs.iter().any(|attribute| attribute.path().is_ident("macro_export")) {
                        self.exported.insert(name.clone(), file.to_owned());
                    }
                    module.defined.insert(name);
                }
                other => module.defined.extend(defines(other)),
            }
        }
        self.modules.insert(place.clone(), module);
    }

    /// The file in which something is defined; none if the path ends at a module, or outside the crate.
    fn leads_to(&self, place: &[String], steps: usize) -> Option<&str> {
        let mut module = self.modules.get(&Vec::new())?;
        for (index, name) in place.iter().enumerate() {
            let rest = &place[index + 1..];
            if module.defined.contains(name) {
                return Some(&module.file);
            }
            if module.children.contains(name) {
                module = self.modules.get(&place[..=index])?;
                continue;
            }
            if let Some(target) = module.imports.get(name) {
                let target: Place = target.iter().chain(rest).cloned().collect();
                return self.leads_to(&target, steps.checked_sub(1)?);
            }
            let steps = steps.checked_sub(1)?;
            let brought = module.globs.iter().find_map(|glob| {
                let target: Place = glob.iter().chain(&place[index..]).cloned().collect();
                self.leads_to(&target, steps)
            });
            return brought.or_else(|| self.exported.get(name).filter(|_| index == 0).map(String::as_str));
        }
        None
    }

    /// Sets of files of which each leads to each, the largest first.
    pub(crate) fn circles(&self) -> Vec<Vec<String>> {
        let files: BTreeSet<&String> = self.arrows.keys().map(|(from, _)| from).collect();
        let reached: BTreeMap<&String, BTreeSet<&String>> =
            files.iter().map(|file| (*file, self.reach(file))).collect();
        let mut circles = BTreeSet::new();
        for file in &files {
            let both = |other: &&&String| reached[*file].contains(**other) && reached[**other].contains(*file);
            let circle: Vec<String> = files.iter().filter(both).map(|file| (*file).clone()).collect();
            if circle.len() > 1 {
                circles.insert(circle);
            }
        }
        circles.into_iter().collect()
    }

    fn reach<'s>(&'s self, file: &'s String) -> BTreeSet<&'s String> {
        let (mut reached, mut next) = (BTreeSet::new(), vec![file]);
        while let Some(file) = next.pop() {
            for (_, to) in self.arrows.keys().filter(|(from, _)| from == file) {
                if reached.insert(to) {
                    next.push(to);
                }
            }
        }
        reached
    }

    pub(crate) fn explain(&self, circle: &[String]) -> String {
        let inside = self.arrows.iter().filter(|((from, to), _)| circle.contains(from) && circle.contains(to));
        let arrows: String = inside.map(|((from, to), name)| format!("\n    {from} -> {to}: {name}")).collect();
        format!("{} files name each other in a circle; let one of them know less:{arrows}", circle.len())
    }
}

/// Finds what a file names.
struct Names<'s> {
    sources: &'s Crate,
    file: &'s str,
    place: Place,
    found: Vec<(String, String)>,
}

impl Names<'_> {
    fn path(&mut self, path: &[String]) {
        let Some(module) = self.sources.modules.get(&self.place) else { return };
        let target = absolute(&self.place, &module.children, path).or_else(|| {
            let target = module.imports.get(path.first()?)?;
            Some(target.iter().chain(&path[1..]).cloned().collect())
        });
        let Some(file) = target.and_then(|target| self.sources.leads_to(&target, 20)) else { return };
        if file != self.file {
            self.found.push((file.to_owned(), path.join("::")));
        }
    }

    /// What a macro is given is no syntax yet: words with `::` between them are paths.
    fn tokens(&mut self, tokens: TokenStream) {
        let (mut path, mut colons) = (Vec::new(), 0);
        for token in tokens {
            match token {
                TokenTree::Ident(word) if colons == 2 || path.is_empty() => {
                    path.push(word.to_string());
                    colons = 0;
                }
                TokenTree::Punct(punct) if punct.as_char() == ':' && !path.is_empty() => colons += 1,
                other => {
                    self.path(&std::mem::take(&mut path));
                    colons = 0;
                    match other {
                        TokenTree::Group(group) => self.tokens(group.stream()),
                        TokenTree::Ident(word) => path.push(word.to_string()),
                        _ => {}
                    }
                }
            }
        }
        self.path(&path);
    }

    /// Attributes of serde have paths in texts: `with = "crate::seconds"` means the functions of that module.
    fn texts(&mut self, tokens: TokenStream) {
        for literal in tokens.into_iter().filter(|token| matches!(token, TokenTree::Literal(_))) {
            let Ok(text) = syn::parse2::<syn::LitStr>(literal.into()) else { continue };
            let Ok(path) = text.parse::<syn::Path>() else { continue };
            let path: Place = path.segments.iter().map(|segment| segment.ident.to_string()).collect();
            for function in [None, Some("serialize"), Some("deserialize")] {
                let path: Place = path.iter().cloned().chain(function.map(String::from)).collect();
                self.path(&path);
            }
        }
    }
}

impl<'ast> Visit<'ast> for Names<'_> {
    fn visit_item(&mut self, item: &'ast syn::Item) {
        if !is_test(attributes(item)) {
            visit::visit_item(self, item);
        }
    }

    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        self.place.push(item.ident.to_string());
        visit::visit_item_mod(self, item);
        self.place.pop();
    }

    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        let Some(module) = self.sources.modules.get(&self.place) else { return };
        for Used { path, name } in used(&item.tree) {
            let target = absolute(&self.place, &module.children, &path);
            let from_below = target.is_some_and(|target| target.starts_with(&self.place));
            if matches!(item.vis, syn::Visibility::Inherited) || !from_below {
                self.path(&path);
                // Everything of a module: at least what its own file defines.
                if name.is_none()
                    && let Some(target) = absolute(&self.place, &module.children, &path)
                    && let Some(module) = self.sources.modules.get(&target)
                    && module.file != self.file
                {
                    self.found.push((module.file.clone(), format!("{}::*", path.join("::"))));
                }
            }
        }
    }

    fn visit_impl_item(&mut self, item: &'ast syn::ImplItem) {
        let attributes = match item {
            syn::ImplItem::Fn(item) => &item.attrs,
            syn::ImplItem::Const(item) => &item.attrs,
            _ => &Vec::new(),
        };
        if !is_test(attributes) {
            visit::visit_impl_item(self, item);
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        if path.leading_colon.is_none() {
            let path: Place = path.segments.iter().map(|segment| segment.ident.to_string()).collect();
            self.path(&path);
        }
        visit::visit_path(self, path);
    }

    fn visit_attribute(&mut self, it: &'ast syn::Attribute) {
        if let syn::Meta::List(list) = &it.meta {
            self.tokens(list.tokens.clone());
            self.texts(list.tokens.clone());
        }
    }

    fn visit_macro(&mut self, it: &'ast syn::Macro) {
        visit::visit_macro(self, it);
        self.tokens(it.tokens.clone());
    }
}
