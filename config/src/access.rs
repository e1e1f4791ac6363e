//! Who may command whom, section `[access]`: by class.

use crate::classes::ClassTable;
use crate::installation::Installation;
use crate::module::{Lines, Module};
use crate::reader::{Item, Reader, Section};
use rohrpost_mailbox::{Class, Name};

/// Which classes may command the modules of a class from other nodes. Of a class without such a rule all may.
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

/// Nobody is listed as a caller of whom it may not command, and no face lets in whom its module keeps out: a router goes by the class of the
/// name that is commanded.
pub(crate) fn judge(installation: &Installation, module: &Module, lines: &Lines, reader: &Reader<'_>) {
    for (to, line) in module.calls.iter().zip(&lines.calls) {
        let refuses = |access: &&Access| access.class == to.class() && !access.callers.contains(&module.name.class());
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
