//! A tool's place on a running node, from which it asks modules for their parameters.

use crate::look::observer::Tool;
use crate::look::target::Running;
use crate::terminal::{Failure, complain};
use rohrpost::output::plain;
use rohrpost::parameter::{Parameter, Refusal};
use rohrpost::{CallError, Fault, Name};

/// A running node, and a place on it.
pub(super) struct Session {
    pub(super) running: Running,
    pub(super) tool: Tool,
}

impl Session {
    pub(super) fn parameters(&mut self, module: Name) -> Result<Vec<Parameter>, Failure> {
        match self.tool.parameters(module) {
            Err(CallError::Fault(_, Fault::Unknown(_))) => {
                let name = self.running.text(module);
                Err(format!("{name} was built with a Rohrpost that had no parameters; rebuild it").into())
            }
            other => other.map_err(|error| self.running.told(module, &error)),
        }
    }

    /// All modules of the configuration; those that cannot be asked are reported.
    pub(super) fn modules(&self) -> Result<Vec<Name>, Failure> {
        let mut asked = Vec::new();
        for (module, silence) in self.running.modules_to_ask()? {
            match silence {
                Some(silence) => complain(format_args!("{}: {}", self.running.text(module), silence.text())),
                None => asked.push(module),
            }
        }
        Ok(asked)
    }

    /// A refusal or failed call, with the module's name and what to try.
    pub(super) fn refused(&self, module: Name, error: CallError<Refusal>) -> Failure {
        match error {
            CallError::NotSent(error @ rohrpost_mailbox::SendError::TooLarge { .. }) => {
                let told = self.running.told(module, &error);
                format!("{told}; raise `size` in [module.mailbox.commands] of the module, or set fewer at a time")
                    .into()
            }
            error => self.running.told(module, &error),
        }
    }
}

/// The parameter of this name; else an error with the nearest name and all names.
pub(super) fn find<'p>(parameters: &'p [Parameter], module: &str, name: &str) -> Result<&'p Parameter, Failure> {
    let unknown = || {
        if parameters.is_empty() {
            return no_parameters(module).into();
        }
        let names: Vec<&str> = parameters.iter().map(|parameter| parameter.field.name.as_str()).collect();
        let nearest = rohrpost_config::nearest(name, names.iter().copied());
        let nearest = nearest.map_or(String::new(), |nearest| format!("did you mean `{nearest}`? "));
        plain::line(&format!("{module} has no parameter `{name}`; {nearest}it has: {}", names.join(", "))).into()
    };
    parameters.iter().find(|parameter| parameter.field.name == name).ok_or_else(unknown)
}

pub(super) fn no_parameters(module: &str) -> String {
    format!("{module} has no parameters: its settings are read when it starts")
}
