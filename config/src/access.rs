//! Permission of classes to command others, section `[access]`.

use crate::classes::ClassTable;
use crate::reader::{Item, Section};
use rohrpost_mailbox::Class;

/// Which classes may command the modules of a class. Without such a rule all may.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Access {
    /// The commanded class.
    pub class: Class,
    /// The permitted callers.
    pub callers: Vec<Class>,
    /// Line in the file.
    pub line: usize,
}

impl Access {
    /// Whether it keeps modules of a class from commanding those of another.
    pub(crate) fn refuses(&self, caller: Class, called: Class) -> bool {
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

#[cfg(test)]
mod tests {
    use crate::Installation;
    use rohrpost_mailbox::Name;

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
