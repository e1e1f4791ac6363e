//! Whether what modules call agrees with `[access]`.

use crate::access::{AccessRule, Commanded};
use crate::installation::Installation;
use crate::module::{Lines, Module};
use crate::reader::Reader;
use rohrpost_mailbox::Name;

/// No module is listed as a caller of one that it may not command. And no alias of a module with a rule is left without
/// one: rules go by the commanded name, and by each of its names a process is switched off.
pub(crate) fn validate(installation: &Installation, module: &Module, lines: &Lines, reader: &Reader<'_>) {
    let access = &installation.access;
    // Of another system that one's file decides.
    let own = |(to, _): &(&Name, &usize)| to.system() == installation.system.id;
    for (to, line) in module.calls.iter().zip(&lines.calls).filter(own) {
        if let Some(rule) = access.against(module.name, *to) {
            reader.report(*line, told(installation, module, *to, rule));
        }
    }
    let Some(rule) = access.of(module.name) else { return };
    for alias in module.aliases.iter().filter(|alias| access.of(**alias).is_none()) {
        reader.report(module.line, alias_text(installation, module, *alias, rule));
    }
}

fn alias_text(installation: &Installation, module: &Module, alias: Name, rule: &AccessRule) -> String {
    let classes = &installation.classes;
    let class = classes.name(alias.class()).unwrap_or_default();
    let (name, alias) = (classes.format(module.name), classes.format(alias));
    format!(
        "module `{name}` may be commanded by the classes of [access] in line {} alone, and its alias `{alias}` by all; \
         add a line for `\"{alias}\"` or for class `{class}` there",
        rule.line
    )
}

fn told(installation: &Installation, module: &Module, to: Name, rule: &AccessRule) -> String {
    let classes = &installation.classes;
    let class = |class| classes.name(class).unwrap_or_default();
    let commanded = match rule.commanded {
        Commanded::Class(commanded) => format!("class `{}`", class(commanded)),
        Commanded::Module(_) => "it".into(),
    };
    format!(
        "module `{}` calls `{}`, and [access] in line {} does not let class `{}` command {commanded}; add it there, or \
         drop the call",
        classes.format(module.name),
        classes.format(to),
        rule.line,
        class(module.name.class()),
    )
}
