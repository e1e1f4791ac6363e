//! Which module owns which name: collected in a first pass, so that a module may refer to one further below.

use crate::classes::{ClassTable, ROUTER, TCP, TEAM_ROUTER, TOOL, class_of};
use crate::reader::{Item, Section, nearest};
use rohrpost_mailbox::{ALL_SYSTEMS, Name, local};
use std::collections::BTreeMap;

/// The names of all modules and aliases of a file.
pub(crate) struct Directory<'d> {
    pub(crate) classes: &'d ClassTable,
    /// By the text in the file. A malformed name stays known: its own message is enough.
    owners: BTreeMap<String, Name>,
    /// Classes of implicit modules, without a `[[module]]`.
    reserved: Vec<&'static str>,
}

/// A text that names no module.
pub(crate) struct Unknown {
    nearest: Option<String>,
}

impl Unknown {
    /// The remedy: the nearest name, or a new module, or the caller's text.
    pub(crate) fn or(&self, otherwise: &str) -> String {
        match &self.nearest {
            Some(name) => format!("did you mean `{name}`? Otherwise add one, or {otherwise}"),
            None => format!("add one, or {otherwise}"),
        }
    }
}

impl<'d> Directory<'d> {
    /// `routers` are implicit.
    pub(crate) fn read(modules: &[Section<'d>], classes: &'d ClassTable, routers: &[Name]) -> Self {
        let owners = routers.iter().map(|name| (classes.format(*name), *name)).collect();
        let is_there = |class: &&str| routers.iter().any(|name| classes.name(name.class()) == Some(class));
        let reserved = [ROUTER, TCP, TEAM_ROUTER].into_iter().filter(is_there).collect();
        let mut directory = Self { classes, owners, reserved };
        let mut lines: BTreeMap<&str, usize> = BTreeMap::new();
        for module in modules {
            let name = module.required("name", "name = \"laser.0\"");
            let name = name.and_then(|item| Some((item.text("laser.0")?, item.line)));
            let aliases = module.get("aliases").map(|item| item.texts("odometry.0")).unwrap_or_default();
            for (text, line) in name.into_iter().chain(aliases) {
                match lines.get(text) {
                    Some(first) => module.reader.report(
                        line,
                        format!(
                            "module `{text}` is defined in line {first} already; give one of them another instance"
                        ),
                    ),
                    None => directory.add(module, text, line),
                }
                lines.entry(text).or_insert(line);
            }
        }
        directory
    }

    fn add(&mut self, module: &Section<'d>, text: &'d str, line: usize) {
        let name = self.classes.parse_module(text);
        if let Err(error) = &name {
            module.reader.report(line, error.to_string());
        }
        if class_of(text) == TOOL {
            module.reader.report(
                line,
                format!(
                    "module `{text}`: class `tool` is for programs run by hand; give the module a class of its own"
                ),
            );
        }
        let owner = match class_of(text) {
            ROUTER => "for the routers, which are there by themselves when there are several nodes",
            TEAM_ROUTER => "for the routers of [team], which are there by themselves",
            _ => "for the TCP router and its clients, which are there by themselves with [tcp]",
        };
        if self.reserved.contains(&class_of(text)) {
            module.reader.report(
                line,
                format!("module `{text}`: class `{}` is {owner}; give the module a class of its own", class_of(text)),
            );
        }
        self.owners.insert(text.into(), name.unwrap_or_default());
    }

    /// The module or alias that an entry of a list names; if none does, that is reported.
    pub(crate) fn module(&self, entry: &Item<'_>, text: &str) -> Option<Name> {
        let missing =
            |unknown: &Unknown| entry.report(format!("`{text}` is no [[module]]; {}", unknown.or("drop the entry")));
        self.find(text).inspect_err(missing).ok()
    }

    /// A module of another system: `2.laser.0.0`. Whether it runs, only that system knows; none if no section of this
    /// file leads to other systems.
    pub(crate) fn elsewhere(&self, text: &str) -> Option<Name> {
        let is_reached = self.reserved.iter().any(|class| [TCP, TEAM_ROUTER].contains(class));
        let name = self.classes.parse_name(text).ok().filter(|_| is_reached)?;
        let is_other = ![self.classes.system(), ALL_SYSTEMS].contains(&name.system());
        (is_other && name.local() == local::COMMANDS).then_some(name)
    }

    /// The module or alias that a text names.
    pub(crate) fn find(&self, text: &str) -> Result<Name, Unknown> {
        self.owners.get(text).copied().ok_or_else(|| {
            // By class alone: `laser.0` and `mapper.0` are alike only in what every name has.
            let owners = || self.owners.keys().map(String::as_str);
            let class = nearest(class_of(text), owners().map(class_of));
            let like = owners().filter(|owner| Some(class_of(owner)) == class);
            // Among several of that class, the one with the instance meant.
            let nearest = like.min_by_key(|owner| owner[class_of(owner).len()..] != text[class_of(text).len()..]);
            Unknown { nearest: nearest.map(Into::into) }
        })
    }
}
