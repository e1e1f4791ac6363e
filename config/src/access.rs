//! Permission of classes to command others, or single modules: section `[access]`.

use crate::classes::class_of;
use crate::directory::Directory;
use crate::reader::{Item, Section};
use rohrpost_mailbox::{Class, Name};

/// What a line of `[access]` is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Commanded {
    /// All names of a class, but those with a line of their own.
    Class(Class),
    /// One module by its name, or by an alias: its other names are not meant.
    Module(Name),
}

impl Commanded {
    /// The class of what is commanded.
    pub const fn class(self) -> Class {
        match self {
            Self::Class(class) => class,
            Self::Module(name) => name.class(),
        }
    }
}

/// A set of classes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ClassSet([u64; 4]);

impl ClassSet {
    /// Whether a class is one of them.
    pub const fn has(self, Class(class): Class) -> bool {
        self.0[(class / 64) as usize] & 1 << (class % 64) != 0
    }
}

impl FromIterator<Class> for ClassSet {
    fn from_iter<I: IntoIterator<Item = Class>>(classes: I) -> Self {
        let mut set = Self::default();
        for Class(class) in classes {
            set.0[usize::from(class / 64)] |= 1 << (class % 64);
        }
        set
    }
}

/// One line of `[access]`: which classes may command a class, or one module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AccessRule {
    /// What they may command.
    pub commanded: Commanded,
    /// The permitted callers.
    pub callers: ClassSet,
    /// Line in the file.
    pub line: usize,
}

/// Instances that a class may have.
const INSTANCES: usize = 256;
/// In place of an index of a rule: there is none.
const NO_RULE: usize = usize::MAX;

/// The lines of `[access]`. What has none may be commanded by all; the default has none.
#[derive(Clone, Debug, Default)]
pub struct Access {
    /// Those of classes, then those of modules.
    rules: Vec<AccessRule>,
    /// Index of the rule for each instance, by class: no command costs a search.
    by_class: Vec<Option<Box<[usize; INSTANCES]>>>,
}

impl Access {
    /// Access by these rules. That of a module goes before that of its class.
    pub fn new(mut rules: Vec<AccessRule>) -> Self {
        rules.sort_by_key(|rule| matches!(rule.commanded, Commanded::Module(_)));
        let mut by_class: Vec<Option<Box<[usize; INSTANCES]>>> = Vec::new();
        for (index, rule) in rules.iter().enumerate() {
            let class = usize::from(rule.commanded.class().0);
            by_class.resize(by_class.len().max(class + 1), None);
            let instances = by_class[class].get_or_insert_with(|| Box::new([NO_RULE; INSTANCES]));
            match rule.commanded {
                Commanded::Class(_) => instances.fill(index),
                Commanded::Module(name) => instances[usize::from(name.instance())] = index,
            }
        }
        Self { rules, by_class }
    }

    /// The rules: those of classes, then those of modules.
    pub fn rules(&self) -> &[AccessRule] {
        &self.rules
    }

    /// The rule for commands to a name, whichever of the module's mailboxes it is. The system does not count: what is
    /// for a module in all systems is for this one, too.
    #[inline]
    pub fn of(&self, to: Name) -> Option<&AccessRule> {
        let instances = self.by_class.get(usize::from(to.class().0))?.as_ref()?;
        self.rules.get(instances[usize::from(to.instance())])
    }

    /// The rule that forbids the owner of a name to command another one, if there is one.
    #[inline]
    pub fn against(&self, from: Name, to: Name) -> Option<&AccessRule> {
        self.of(to).filter(|rule| !rule.callers.has(from.class()))
    }

    pub(crate) fn read(section: Option<Section<'_>>, directory: &Directory<'_>) -> Self {
        let items = section.map(|section| section.entries()).unwrap_or_default();
        Self::new(items.iter().filter_map(|item| AccessRule::read(item, directory)).collect())
    }
}

impl AccessRule {
    fn read(item: &Item<'_>, directory: &Directory<'_>) -> Option<Self> {
        let known = |name: &str, line: usize| {
            let class = directory.classes.id(name);
            if class.is_none() {
                let right = match class_of(name) {
                    class if class == name => "define it in [classes], or drop it here".into(),
                    class => format!("callers are classes, write `{class}`"),
                };
                item.reader.report(line, format!("[access]: there is no class `{name}`; {right}"));
            }
            class
        };
        if item.is_table() {
            return item.wrong(&format!(
                "a list of classes; one module has its name in quotes, such as `\"{}.0\" = [\"brain\"]`",
                class_of(&item.key)
            ));
        }
        let (commanded, key) = if item.key.contains('.') {
            // A malformed name of a module has its own message.
            let name = directory.module(item, &item.key).filter(|name| *name != Name::NONE);
            (name.map(Commanded::Module), format!("\"{}\"", item.key))
        } else {
            (known(&item.key, item.line).map(Commanded::Class), item.key.clone())
        };
        let callers = Item { key, ..item.clone() }.texts("brain");
        let callers = callers.iter().filter_map(|(name, line)| known(name, *line)).collect();
        Some(Self { commanded: commanded?, callers, line: item.line })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Installation;

    const FILE: &str = include_str!("../tests/two_nodes.toml");
    const MOTOR: Name = Name::new(1, 200, 0, 0);

    /// Line of the rule that the file has against a command.
    fn check(file: &str, cases: &[(Name, Name, Option<&str>, &str)]) {
        let installation = Installation::parse(file, "two_nodes.toml".as_ref()).unwrap();
        for (from, to, rule, why) in cases {
            let line = rule.map(|rule| 1 + file.lines().position(|line| line.starts_with(rule)).unwrap());
            assert_eq!(installation.access_against(*from, *to).map(|rule| rule.line), line, "{why}");
        }
    }

    #[test]
    fn a_class_with_a_rule_is_commanded_by_those_listed_and_by_launch_of_its_node() {
        let refused = Some("motor = [");
        check(
            FILE,
            &[
                (Name::new(1, 140, 0, 1), MOTOR, None, "it is listed"),
                (Name::new(1, 200, 1, 1), MOTOR, refused, "its own class is not"),
                (Name::new(1, 16, 1, 1), MOTOR, refused, "nor are tools of its node"),
                (Name::new(1, 16, 0, 1), MOTOR, None, "but launch of it switches it on"),
                (Name::new(1, 16, 4, 1), MOTOR, refused, "launch of another node does not"),
                (Name::new(2, 16, 0, 1), MOTOR, refused, "nor that of another system"),
                (Name::new(1, 200, 0, 1), Name::new(1, 140, 0, 0), None, "of a class without a rule all may"),
            ],
        );
    }

    #[test]
    fn a_module_with_a_rule_is_commanded_by_its_rule_and_not_by_that_of_its_class() {
        let rules = "[access]\n\"motor.1\" = [\"output\"]\n\"pilot.0\" = []\n\"laser.0\" = [\"tool\", \"pilot\"]\n";
        let file = FILE.replace("[access]\n", rules)
            + "[[module]]\nname = \"motor.1\"\nnode = \"base\"\nprogram = \"motor\"\noptional = true\n";
        let caller = |class| Name::new(1, class, 1, 1);
        let (second, alias, pilot) = (Name::new(1, 200, 1, 0), Name::new(1, 150, 0, 0), Name::new(1, 140, 0, 0));
        let (motor, laser) = (Some("motor = ["), Some("laser = ["));
        let (of_second, of_alias, of_pilot) = (Some("\"motor.1\""), Some("\"laser.0\""), Some("\"pilot.0\""));
        check(
            &file,
            &[
                (caller(32), second, None, "it is listed for this module"),
                (caller(140), second, of_second, "the class's line does not count for it"),
                (caller(140), second.with_local(7), of_second, "at none of its mailboxes"),
                (caller(140), Name::new(255, 200, 1, 0), of_second, "nor as one of all systems"),
                (caller(140), MOTOR, None, "but for the others"),
                (caller(32), MOTOR, motor, "for which the module's line does not count"),
                (caller(32), Name::new(1, 200, 9, 0), motor, "nor for names that no module has"),
                (caller(16), alias, None, "an alias has its own line"),
                (caller(32), alias, of_alias, "and refuses by it"),
                (caller(16), Name::new(1, 150, 1, 0), laser, "its class has another"),
                (caller(200), pilot, of_pilot, "a line without callers lets none in"),
                (caller(200), Name::new(1, 140, 1, 0), None, "its class has no line"),
                (Name::new(1, 16, 0, 1), second, None, "launch of its node switches it on"),
                (Name::new(1, 16, 4, 1), second, of_second, "that of another node does not"),
            ],
        );
    }

    #[test]
    fn a_set_of_classes_has_those_that_were_put_in() {
        let classes = [0, 63, 64, 200, 255].map(Class);
        let set: ClassSet = classes.into_iter().collect();
        let all: Vec<Class> = (0..=u8::MAX).map(Class).filter(|class| set.has(*class)).collect();
        assert_eq!(all, classes);
        assert_eq!(ClassSet::default(), [].into_iter().collect());
    }
}
