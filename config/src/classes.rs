//! Classes by name and number, and with them mailbox names as people write them: `laser.0`, `1.laser.0.2`.

use crate::reader::{Section, is_word, nearest};
use rohrpost_mailbox::{Class, Name, local};

/// Class of programs run by hand; every installation has it.
pub const TOOL: &str = "tool";

/// Class of the routers, which are implicit when there are several nodes.
pub const ROUTER: &str = "router";

/// Class of the TCP router and of its clients, which are implicit with `[tcp]`.
pub const TCP: &str = "tcp";
/// Class of the routers of `[team]`, which are implicit with it; also the name of that built-in module.
pub const TEAM_ROUTER: &str = "team-router";

/// Class of the modules that draw.
pub const GUI: &str = "gui";

/// One class of an installation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ClassEntry {
    /// Its id, and the priority of everything it sends.
    pub class: Class,
    /// Its name in `[classes]`.
    pub name: String,
    /// What its modules do, in words; may be empty.
    pub text: String,
}

/// The classes of an installation: turns names into numbers and back.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ClassTable {
    /// The system that names without one belong to.
    system: u8,
    /// Most urgent first.
    entries: Vec<ClassEntry>,
}

/// Why a text is not a module's or mailbox's name in this installation.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NameTextError {
    /// Not as many parts as a name has.
    #[error(
        "`{0}` is no mailbox name; write class.instance (`laser.0`), with a local id `laser.0.2`, or `1.laser.0.2`"
    )]
    Parts(String),
    /// Not class and instance.
    #[error("`{0}` is no module name; write class.instance, such as `laser.0`")]
    Module(String),
    /// No class of this name.
    #[error("`{text}`: there is no class `{class}`; {right}")]
    Class {
        /// The whole text.
        text: String,
        /// The part that names no class.
        class: String,
        /// The nearest class, or all of them.
        right: String,
    },
    /// A part is no number from 0 to 255.
    #[error("`{0}`: {1} `{2}` is not a number from 0 to 255")]
    Byte(String, &'static str, String),
    /// System or class zero means "none" or "own", and no name has it.
    #[error("`{0}`: {1} 0 is reserved; write 1 to 255")]
    Reserved(String, &'static str),
}

impl ClassTable {
    /// Class of a name.
    pub fn id(&self, name: &str) -> Option<Class> {
        self.entries.iter().find(|entry| entry.name == name).map(|entry| entry.class)
    }

    /// Name of a class.
    pub fn name(&self, class: Class) -> Option<&str> {
        self.entry(class).map(|entry| entry.name.as_str())
    }

    /// What the modules of a class do, in words.
    pub fn text(&self, class: Class) -> Option<&str> {
        self.entry(class).map(|entry| entry.text.as_str())
    }

    /// All classes, most urgent first.
    pub fn iter(&self) -> impl Iterator<Item = &ClassEntry> {
        self.entries.iter()
    }

    /// The class of programs run by hand.
    pub fn tool(&self) -> Class {
        // A file without it has given no installation.
        self.id(TOOL).unwrap_or_default()
    }

    /// Reads a module's name: `laser.0`. The class is one of this installation, by its name.
    pub fn parse_module(&self, text: &str) -> Result<Name, NameTextError> {
        let Some((class, instance)) = text.split_once('.').filter(|(_, instance)| !instance.contains('.')) else {
            return Err(NameTextError::Module(text.into()));
        };
        let Some(class) = self.id(class) else { return Err(self.no_class(text, class)) };
        Ok(Name::new(self.system, class.0, byte(text, "instance", instance)?, local::COMMANDS))
    }

    /// The system that names without one belong to.
    pub(crate) fn system(&self) -> u8 {
        self.system
    }

    /// Reads any mailbox name: `laser.0`, `laser.0.2`, `1.laser.0.2`, the class by name or number (`1.150.0.2`).
    pub fn parse_name(&self, text: &str) -> Result<Name, NameTextError> {
        let parts: Vec<&str> = text.split('.').collect();
        let (system, class, instance, local) = match parts[..] {
            [class, instance] => (self.system, class, instance, local::COMMANDS),
            [class, instance, local] => (self.system, class, instance, byte(text, "local id", local)?),
            [system, class, instance, local] => {
                (byte(text, "system", system)?, class, instance, byte(text, "local id", local)?)
            }
            _ => return Err(NameTextError::Parts(text.into())),
        };
        let class = match self.id(class) {
            Some(class) => class,
            None if class.starts_with(|c: char| c.is_ascii_digit()) => Class(byte(text, "class", class)?),
            None => return Err(self.no_class(text, class)),
        };
        for (part, value) in [("system", system), ("class", class.0)] {
            if value == 0 {
                return Err(NameTextError::Reserved(text.into(), part));
            }
        }
        Ok(Name::new(system, class.0, byte(text, "instance", instance)?, local))
    }

    /// Writes a name as people read it: `laser.0` for a module, `laser.0.2` for its other mailboxes, `2.laser.0.0` in
    /// another system. [`parse_name`](Self::parse_name) reads it back.
    pub fn format(&self, name: Name) -> String {
        let class = self.class_text(name);
        match (name.system() == self.system, name.local()) {
            (true, local::COMMANDS) => format!("{class}.{}", name.instance()),
            (true, local) => format!("{class}.{}.{local}", name.instance()),
            (false, _) => self.format_full(name),
        }
    }

    /// Writes a name with all its four parts: `1.laser.0.2`.
    pub fn format_full(&self, name: Name) -> String {
        format!("{}.{}.{}.{}", name.system(), self.class_text(name), name.instance(), name.local())
    }

    /// Reads `[classes]`. Classes with a wrong id stay known, so that one mistake gives one message.
    pub(crate) fn read(section: Option<Section<'_>>, system: u8) -> Self {
        let mut table = Self { system, entries: Vec::new() };
        let Some(section) = section else { return table };
        for item in section.entries() {
            let name = item.key.clone();
            if !is_word(&name) {
                item.report(format!(
                    "`{name}` is no class name; use lower-case letters, digits and `-`, a letter first"
                ));
            }
            let what = format!("class `{name}`");
            let Some(class) = item.section(&what) else { continue };
            let id = class.required("id", "id = 150").and_then(|id| id.whole(1..=255, 150)).unwrap_or(0);
            let text = class.or("text", "", |text| text.text("What its modules do"));
            class.finish();
            if let Some(other) = table.name(Class(id)).filter(|_| id != 0) {
                let free = (1..=255u8).rev().filter(|free| table.entry(Class(*free)).is_none());
                let free = free.min_by_key(|free| free.abs_diff(id)).unwrap_or(1);
                item.report(format!(
                    "class `{name}` has id {id}, which is class `{other}`'s; ids are priorities and unique, {free} is \
                     free"
                ));
            }
            table.entries.push(ClassEntry { class: Class(id), name, text: text.into() });
        }
        if table.id(TOOL).is_none() {
            section.report(
                "class `tool` is missing, which programs run by hand use; \
                 add `tool = { id = 16, text = \"Programs run by hand\" }`",
            );
        }
        table.entries.sort_by_key(|entry| std::cmp::Reverse(entry.class));
        table
    }

    fn entry(&self, class: Class) -> Option<&ClassEntry> {
        self.entries.iter().find(|entry| entry.class == class)
    }

    fn class_text(&self, name: Name) -> String {
        self.name(name.class()).map_or_else(|| name.class().0.to_string(), Into::into)
    }

    fn no_class(&self, text: &str, class: &str) -> NameTextError {
        let names = || self.entries.iter().map(|entry| entry.name.as_str());
        let right = match nearest(class, names()) {
            Some(name) => format!("did you mean `{name}`?"),
            None => format!("the classes are {}", names().collect::<Vec<_>>().join(", ")),
        };
        NameTextError::Class { text: text.into(), class: class.into(), right }
    }
}

/// The part of a module's name that names its class.
pub(crate) fn class_of(text: &str) -> &str {
    text.split('.').next().unwrap_or(text)
}

fn byte(text: &str, part: &'static str, digits: &str) -> Result<u8, NameTextError> {
    // `parse` alone would take "+1" and "01": two spellings of one name.
    let number = digits.parse().ok().filter(|number: &u8| number.to_string() == digits);
    number.ok_or_else(|| NameTextError::Byte(text.into(), part, digits.into()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn table() -> ClassTable {
        let entry = |id, name: &str| ClassEntry { class: Class(id), name: name.into(), text: String::new() };
        ClassTable { system: 1, entries: vec![entry(200, "motor"), entry(150, "laser"), entry(16, "tool")] }
    }

    #[test]
    fn names_read_in_every_spelling() {
        for (text, name, formatted) in [
            ("laser.0", Name::new(1, 150, 0, 0), "laser.0"),
            ("laser.0.2", Name::new(1, 150, 0, 2), "laser.0.2"),
            ("1.laser.0.2", Name::new(1, 150, 0, 2), "laser.0.2"),
            ("1.150.0.2", Name::new(1, 150, 0, 2), "laser.0.2"),
            ("2.laser.7.0", Name::new(2, 150, 7, 0), "2.laser.7.0"),
            ("99.3", Name::new(1, 99, 3, 0), "99.3"),
            ("255.motor.0.0", Name::new(255, 200, 0, 0), "255.motor.0.0"),
        ] {
            assert_eq!(table().parse_name(text), Ok(name), "{text}");
            assert_eq!(table().format(name), formatted);
        }
        assert_eq!(table().format_full(Name::new(1, 150, 0, 0)), "1.laser.0.0");
    }

    #[test]
    fn wrong_names_say_what_is_right() {
        for (text, message) in [
            (
                "laser",
                "`laser` is no mailbox name; write class.instance (`laser.0`), with a local id `laser.0.2`, or \
                 `1.laser.0.2`",
            ),
            ("lasr.0", "`lasr.0`: there is no class `lasr`; did you mean `laser`?"),
            ("pump.0", "`pump.0`: there is no class `pump`; the classes are motor, laser, tool"),
            ("laser.256", "`laser.256`: instance `256` is not a number from 0 to 255"),
            ("laser.+1", "`laser.+1`: instance `+1` is not a number from 0 to 255"),
            ("laser.00", "`laser.00`: instance `00` is not a number from 0 to 255"),
            ("laser.0.x", "`laser.0.x`: local id `x` is not a number from 0 to 255"),
            ("300.laser.0.0", "`300.laser.0.0`: system `300` is not a number from 0 to 255"),
            ("0.laser.0.0", "`0.laser.0.0`: system 0 is reserved; write 1 to 255"),
            ("1.0.0.0", "`1.0.0.0`: class 0 is reserved; write 1 to 255"),
        ] {
            assert_eq!(table().parse_name(text).unwrap_err().to_string(), message);
        }
        for (text, message) in [
            ("laser.0.2", "`laser.0.2` is no module name; write class.instance, such as `laser.0`"),
            ("150.0", "`150.0`: there is no class `150`; the classes are motor, laser, tool"),
        ] {
            assert_eq!(table().parse_module(text).unwrap_err().to_string(), message);
        }
    }

    proptest! {
        #[test]
        fn every_name_reads_back(system in 1u8.., class in 1u8.., instance: u8, local: u8) {
            let name = Name::new(system, class, instance, local);
            prop_assert_eq!(table().parse_name(&table().format(name)), Ok(name));
            prop_assert_eq!(table().parse_name(&table().format_full(name)), Ok(name));
        }

        #[test]
        fn no_text_brings_it_down(text in "[a-z0-9.+-]{0,20}") {
            let _ = (table().parse_name(&text), table().parse_module(&text));
        }
    }
}
