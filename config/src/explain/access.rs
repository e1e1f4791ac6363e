//! Which classes may command a module, in words.

use super::Page;
use crate::module::Module;
use rohrpost_mailbox::Name;

impl Page<'_> {
    /// For each name of a module, if one of them has a rule of `[access]`.
    pub(super) fn access(&mut self, module: &Module) {
        let installation = self.installation;
        if module.names().all(|name| installation.access.of(name).is_none()) {
            return;
        }
        let callers = |name: Name| {
            let Some(rule) = installation.access.of(name) else { return "all".into() };
            let callers = installation.classes.iter().filter(|entry| rule.callers.has(entry.class));
            let callers: Vec<&str> = callers.map(|entry| entry.name.as_str()).collect();
            if callers.is_empty() { "no class".into() } else { callers.join(", ") }
        };
        let by = |name| format!("{} by {}", installation.classes.format(name), callers(name));
        let texts: Vec<String> = module.names().map(by).collect();
        self.entry("commanded", &format!("{}; by launch of its node always", texts.join("; ")));
    }
}
