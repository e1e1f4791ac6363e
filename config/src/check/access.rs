//! Whether what modules call agrees with `[access]`.

use crate::access::Access;
use crate::installation::Installation;
use crate::module::{Lines, Module};
use crate::reader::Reader;
use rohrpost_mailbox::Name;

/// No module is listed as a caller of one that it may not command, and no alias admits a caller that its module
/// refuses: a router checks the class of the commanded name.
pub(crate) fn validate(installation: &Installation, module: &Module, lines: &Lines, reader: &Reader<'_>) {
    for (to, line) in module.calls.iter().zip(&lines.calls) {
        let refuses = |access: &&Access| access.refuses(module.name.class(), to.class());
        if let Some(access) = installation.access.iter().find(refuses) {
            reader.report(*line, told(installation, module, *to, access));
        }
    }
    let rule = |class| installation.access.iter().find(|access| access.class == class);
    let Some(access) = rule(module.name.class()) else { return };
    for alias in module.aliases.iter().filter(|alias| rule(alias.class()).is_none()) {
        reader.report(module.line, alias_text(installation, module, *alias, access));
    }
}

fn alias_text(installation: &Installation, module: &Module, alias: Name, access: &Access) -> String {
    let classes = &installation.classes;
    let class = classes.name(alias.class()).unwrap_or_default();
    format!(
        "module `{}` may be commanded by the classes of [access] in line {} alone, and its alias `{}` by all; add a \
         line for class `{class}` there",
        classes.format(module.name),
        access.line,
        classes.format(alias),
    )
}

fn told(installation: &Installation, module: &Module, to: Name, access: &Access) -> String {
    let classes = &installation.classes;
    let class = |class| classes.name(class).unwrap_or_default();
    format!(
        "module `{}` calls `{}`, and [access] in line {} does not let class `{}` command class `{}`; add it there, or \
         drop the call",
        classes.format(module.name),
        classes.format(to),
        access.line,
        class(module.name.class()),
        class(access.class)
    )
}
