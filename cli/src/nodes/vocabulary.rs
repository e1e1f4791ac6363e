//! Names of package types: commands and replies by their functions, data by their item, as the modules' interfaces
//! declare them.

use rohrpost::Name;
use rohrpost::common as c;
use rohrpost::schema::Description;
use rohrpost_config::{Installation, Program};
use rohrpost_mailbox::Kind;
use std::collections::BTreeMap;

/// The interfaces that are known so far. A module that did not answer is not asked again.
#[derive(Default)]
pub(crate) struct Vocabulary {
    descriptions: BTreeMap<Name, Option<Description>>,
}

impl Vocabulary {
    /// The name of a package type between two modules; none if it is not known. `ask` asks a module for its interface.
    pub(crate) fn word(
        &mut self,
        kind: Kind,
        from: Name,
        to: Name,
        ask: impl FnOnce(Name) -> Option<Description>,
    ) -> Option<String> {
        match kind {
            Kind::Command(number) => self.function(number, to, ask),
            Kind::Reply(number) => self.function(number, from, ask).map(|name| answered(&name)),
            Kind::Data(number) => {
                let items = &self.description(from, ask)?.data;
                items.iter().find(|item| item.number == number).map(|item| item.field.name.clone())
            }
            Kind::None => None,
        }
    }

    fn function(&mut self, number: u16, module: Name, ask: impl FnOnce(Name) -> Option<Description>) -> Option<String> {
        if number < c::FIRST_OWN {
            return common(number).map(str::to_owned);
        }
        let functions = &self.description(module, ask)?.functions;
        functions.iter().find(|function| function.number == number).map(|function| function.name.clone())
    }

    fn description(&mut self, module: Name, ask: impl FnOnce(Name) -> Option<Description>) -> Option<&Description> {
        self.descriptions.entry(module.module()).or_insert_with(|| ask(module.module())).as_ref()
    }
}

/// The name of a reply to a function.
pub(crate) fn answered(function: &str) -> String {
    format!("{function} answered")
}

/// The interface of a built-in module or of its alias; it need not run.
pub(crate) fn built_in(installation: &Installation, module: Name) -> Option<Description> {
    match &installation.module(module)?.program {
        Program::Builtin(name) => rohrpost_builtin::description(name, installation.classes.name(module.class())?),
        Program::Command(_) => None,
    }
}

/// The functions that every module has.
fn common(number: u16) -> Option<&'static str> {
    Some(match number {
        c::ON => "on",
        c::OFF => "off",
        c::STATUS => "status",
        c::GET_DATA => "get",
        c::SUBSCRIBE => "subscribe",
        c::UNSUBSCRIBE => "unsubscribe",
        c::OUTPUT_LEVEL => "output-level",
        c::DESCRIBE => "describe",
        c::PARAMETERS => "param get",
        c::SET_PARAMETERS => "param set",
        c::TIME => "time",
        _ => return None,
    })
}
