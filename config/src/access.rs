//! Who may command whom, section `[access]`: by class.

use crate::classes::ClassTable;
use crate::installation::Installation;
use crate::module::{Lines, Module};
use crate::reader::{Item, Reader, Section};
use rohrpost_mailbox::{Class, Name};

/// Which classes may command the modules of a class. Of a class without such a rule all may.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Access {
    /// Whose modules are commanded.
    pub class: Class,
    /// Those who may.
    pub callers: Vec<Class>,
    /// Line in the file.
    pub line: usize,
}

impl Access {
    /// Whether it keeps modules of a class from commanding those of another.
    fn refuses(&self, caller: Class, called: Class) -> bool {
        self.class == called && !self.callers.contains(&caller)
    }

    pub(crate) fn read_all(section: Option<Section<'_>>, classes: &ClassTable) -> Vec<Self> {
        let items = section.map(|section| section.entries()).unwrap_or_default();
        items.iter().filter_map(|item| Self::read(item, classes)).collect()
    }

    fn read(item: &Item<'_>, classes: &ClassTable) -> Option<Self> {
        let known = |name: &str, line: usize| {
            let class = classes.id(name);
            if class.is_none() {
                let mistake = format!("[access]: there is no class `{name}`; define it in [classes], or drop it here");
                item.reader.report(line, mistake);
            }
            class
        };
        let class = known(&item.key, item.line);
        let callers = item.texts("brain");
        let callers = callers.iter().filter_map(|(name, line)| known(name, *line)).collect();
        Some(Self { class: class?, callers, line: item.line })
    }
}

impl Installation {
    /// The rule of `[access]` that keeps whoever has this name from commanding the other one, if there is one. Launch commands all that runs on
    /// its node: it switches modules on and off, whoever else may.
    pub fn access_against(&self, from: Name, to: Name) -> Option<&Access> {
        let rule = self.access.iter().find(|access| access.refuses(from.class(), to.class()))?;
        let is_launch =
            |node: &crate::Node| self.launch_of(node) == from.module() && self.node_of(to) == Some(&node.name);
        (!self.nodes.iter().any(is_launch)).then_some(rule)
    }
}

/// Nobody is listed as a caller of whom it may not command, and no face lets in whom its module keeps out: a router goes by the class of the
/// name that is commanded.
pub(crate) fn judge(installation: &Installation, module: &Module, lines: &Lines, reader: &Reader<'_>) {
    for (to, line) in module.calls.iter().zip(&lines.calls) {
        let refuses = |access: &&Access| access.refuses(module.name.class(), to.class());
        if let Some(access) = installation.access.iter().find(refuses) {
            reader.report(*line, told(installation, module, *to, access));
        }
    }
    let rule = |class| installation.access.iter().find(|access| access.class == class);
    let Some(access) = rule(module.name.class()) else { return };
    for face in module.faces.iter().filter(|face| rule(face.class()).is_none()) {
        reader.report(module.line, told_of_face(installation, module, *face, access));
    }
}

fn told_of_face(installation: &Installation, module: &Module, face: Name, access: &Access) -> String {
    let classes = &installation.classes;
    let class = classes.name(face.class()).unwrap_or_default();
    format!(
        "module `{}` may be commanded by the classes of [access] in line {} alone, and its face `{}` by all; add a line for class `{class}` there",
        classes.format(module.name),
        access.line,
        classes.format(face),
    )
}

fn told(installation: &Installation, module: &Module, to: Name, access: &Access) -> String {
    let classes = &installation.classes;
    let class = |class| classes.name(class).unwrap_or_default();
    format!(
        "module `{}` calls `{}`, and [access] in line {} does not let class `{}` command class `{}`; add it there, or drop the call",
        classes.format(module.name),
        classes.format(to),
        access.line,
        class(module.name.class()),
        class(access.class)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = include_str!("../tests/two_nodes.toml");

    #[test]
    fn a_class_with_a_rule_is_commanded_by_those_listed_and_by_launch_of_its_node() {
        let installation = Installation::parse(FILE, "two_nodes.toml".as_ref()).unwrap();
        let motor = Name::new(1, 200, 0, 0);
        let line = 1 + FILE.lines().position(|line| line.starts_with("motor = [")).unwrap();
        for (from, to, refused, why) in [
            (Name::new(1, 140, 0, 1), motor, false, "it is listed"),
            (Name::new(1, 200, 1, 1), motor, true, "its own class is not"),
            (Name::new(1, 16, 1, 1), motor, true, "nor are tools of its node"),
            (Name::new(1, 16, 0, 1), motor, false, "but launch of it switches it on"),
            (Name::new(1, 16, 4, 1), motor, true, "launch of another node does not"),
            (Name::new(2, 16, 0, 1), motor, true, "nor that of another system"),
            (Name::new(1, 200, 0, 1), Name::new(1, 140, 0, 0), false, "of a class without a rule all may"),
        ] {
            assert_eq!(installation.access_against(from, to).map(|rule| rule.line), refused.then_some(line), "{why}");
        }
    }
}
