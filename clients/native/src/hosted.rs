//! A module in another language, as the runtime calls it.

use crate::context::{NativeContext, NativeState};
use crate::following::Following;
use crate::module::{NativeInterface, NativeModule};
use crate::parameters::Parameters;
use crate::peers::Peers;
use crate::record::Front;
use rohrpost_config::Installation;
use rohrpost_mailbox::{Name, Ready};
use rohrpost_modules::interface::{StandIn, StandInCommand};
use rohrpost_modules::parameter::{ParameterSet, Refusal};
use rohrpost_modules::runtime::{Context, Received, Start, StartError, run_described};
use rohrpost_modules::{CommandFailure, MadeModule, ModuleError};
use rohrpost_schema::Value;
use std::collections::BTreeMap;

/// What the configuration says under `settings`.
type Settings = BTreeMap<String, Value>;

/// Runs a module until it is told to end. `make` makes it, switched off: let it follow there what it follows.
///
/// # Errors
/// See [`StartError`].
pub fn run(
    start: Start,
    interface: NativeInterface,
    make: impl FnOnce(&mut NativeContext<'_>) -> Result<Box<dyn NativeModule>, ModuleError>,
) -> Result<(), StartError> {
    let (name, description) = (start.name, interface.description.clone());
    let serves = move |installation: &Installation| served(installation, name, &description.class);
    let serves_too = serves.clone();
    let description = interface.description.clone();
    let described =
        move |_: &Settings, installation: &Installation| Ok(vec![StandIn { name: serves(installation), description }]);
    run_described(start, described, move |settings, context| {
        let mut state = state(interface, settings, serves_too(context.installation()))?;
        let mut context = NativeContext { context, state: &mut state };
        let made = make(&mut context);
        // As after each part of its code.
        context.abandon();
        let module = made?;
        Ok(Hosted { module, state })
    })
}

/// The name of the module that has this class; its own, which is refused then, if none has.
fn served(installation: &Installation, module: Name, class: &str) -> Name {
    let id = installation.classes.id(class);
    let names = installation.module(module).into_iter().flat_map(|module| module.names());
    names.into_iter().find(|name| Some(name.class()) == id).unwrap_or(module)
}

/// The program, or its configuration, stays as it is: another start would end in the same way.
fn refused(refusal: Refusal) -> ModuleError {
    ModuleError::configuration(refusal.to_string())
}

fn state(interface: NativeInterface, settings: Settings, serves: Name) -> Result<NativeState, ModuleError> {
    let NativeInterface { description, parameters, settings: known } = interface;
    let mut parameters = Parameters::new(parameters).map_err(refused)?;
    let mut others = serde_json::Map::new();
    for (name, value) in settings {
        if parameters.has(&name) {
            parameters.configure(&name, &value).map_err(refused)?;
        } else if known.contains(&name) {
            others.insert(name, serde_json::to_value(value)?);
        } else {
            let own = known.iter().map(String::as_str);
            let all: Vec<&str> = parameters.names().into_iter().chain(own).collect();
            let all = if all.is_empty() { "it has none".into() } else { format!("it has {}", all.join(", ")) };
            return Err(ModuleError::configuration(format!("it has no setting `{name}`; {all}")));
        }
    }
    let settings = serde_json::Value::Object(others).to_string();
    let (following, peers) = (Following::default(), Peers::default());
    Ok(NativeState { serves, description, parameters, settings, following, peers, open: None, front: Front::default() })
}

struct Hosted {
    module: Box<dyn NativeModule>,
    state: NativeState,
}

impl Hosted {
    /// Lets a part of the module's code work. A record that it left unfinished is given up.
    fn work<T>(
        &mut self,
        context: &mut Context,
        part: impl FnOnce(&mut dyn NativeModule, &mut NativeContext<'_>) -> T,
    ) -> T {
        let mut context = NativeContext { context, state: &mut self.state };
        let result = part(&mut *self.module, &mut context);
        context.abandon();
        result
    }
}

impl MadeModule for Hosted {
    fn on(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        self.work(context, |module, context| module.on(context))
    }

    fn off(&mut self, context: &mut Context) {
        self.work(context, |module, context| module.off(context));
    }

    fn tick(&mut self, context: &mut Context) -> Result<(), ModuleError> {
        self.work(context, |module, context| module.tick(context))
    }

    fn command(
        &mut self,
        context: &mut Context,
        command: &StandInCommand<'_>,
        reply: &mut Vec<u8>,
    ) -> Result<(), CommandFailure> {
        let StandInCommand { number, arguments, .. } = *command;
        self.work(context, |module, context| module.command(context, number, arguments, reply))
    }

    fn parameters(&mut self) -> Option<&mut dyn ParameterSet> {
        if self.state.parameters.names().is_empty() { None } else { Some(&mut self.state.parameters) }
    }

    fn parameters_changed(&mut self, context: &mut Context, changed: &[&str]) -> Result<(), ModuleError> {
        self.work(context, |module, context| module.parameters_changed(context, changed))
    }

    fn received(&mut self, context: &mut Context, data: &Received<'_>) -> Result<(), ModuleError> {
        let Some(data) = self.state.following.of(data) else { return Ok(()) };
        self.work(context, |module, context| module.received(context, &data))
    }

    fn ready(&mut self, context: &mut Context, ready: Ready) -> Result<(), ModuleError> {
        if self.state.following.ready(context, ready.watch)? {
            return Ok(());
        }
        self.work(context, |module, context| module.ready(context, ready))
    }
}
