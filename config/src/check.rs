//! Rules across modules.

use crate::installation::Installation;
use crate::mailbox::MailboxLines;
use crate::module::Module;
use crate::reader::Reader;

/// Tools that may be inside a module's command mailbox at the same time.
const TOOLS: usize = 2;

/// Each mailbox has more slots than its participants may hold unfinished: else senders that were stopped close it.
pub(crate) fn claims(installation: &Installation, lines: &[MailboxLines], reader: &Reader<'_>) {
    for (module, lines) in installation.modules.iter().zip(lines) {
        let callers = Senders::of(installation, module, |other| calls(other, module));
        let called = Senders::of(installation, module, |other| calls(module, other));
        for ((key, spec), line) in module.mailboxes.each().into_iter().zip(lines.0) {
            let (senders, tools) = if key == "commands" { (&callers, TOOLS) } else { (&called, 0) };
            let claims = (senders.count() + tools) * usize::from(spec.claims);
            if usize::from(spec.slots) <= claims {
                reader.report(
                    line,
                    format!(
                        "module `{}`, mailbox `{key}`: {} may hold {claims} unfinished at once, so that \
                         `slots = {}` could be closed by senders that stopped midway; write at least `slots = {}`{}",
                        installation.classes.format(module.name),
                        senders.text(tools),
                        spec.slots,
                        claims + 1,
                        if spec.claims > 1 { ", or fewer `claims`" } else { "" }
                    ),
                );
            }
        }
    }
}

fn calls(caller: &Module, called: &Module) -> bool {
    called.names().any(|name| caller.calls.contains(&name))
}

/// Processes that write into a module's mailboxes: those on its node, and its router for all on others.
struct Senders {
    local: usize,
    router: bool,
}

impl Senders {
    fn of(installation: &Installation, module: &Module, sends: impl Fn(&Module) -> bool) -> Self {
        let senders = || installation.modules.iter().filter(|other| other.name != module.name && sends(other));
        Self {
            local: senders().filter(|other| other.node == module.node).count(),
            router: senders().any(|other| other.node != module.node),
        }
    }

    fn count(&self) -> usize {
        self.local + usize::from(self.router)
    }

    fn text(&self, tools: usize) -> String {
        let modules = match self.local {
            0 => None,
            1 => Some("1 module".into()),
            local => Some(format!("{local} modules")),
        };
        let router = self.router.then(|| String::from("the router"));
        let tools = (tools > 0).then(|| format!("{tools} tools"));
        modules.into_iter().chain(router).chain(tools).collect::<Vec<_>>().join(" + ")
    }
}
