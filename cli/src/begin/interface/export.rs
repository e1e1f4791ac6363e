//! Finds an interface: of a module that runs, or of a class that is built in.

use crate::look::target::Target;
use crate::terminal::Failure;
use rohrpost::output::plain;
use rohrpost::schema::Description;
use rohrpost_builtin as builtin;
use rohrpost_config::{Installation, Program};

/// The interface of a module (`motor.0`) or class (`motor`). What runs is asked first; the programs of the built-in
/// modules are known without that, those of others are not.
pub(super) fn find(name: &str, target: &Target) -> Result<Description, Failure> {
    let asked = if name.contains('.') { of_module(name, target) } else { of_class(name, target) };
    asked.or_else(|error| built_in(name, target).ok_or_else(|| told(name, &*error)))
}

fn of_module(name: &str, target: &Target) -> Result<Description, Failure> {
    let running = target.find()?;
    running.describe(running.module(name)?)
}

/// Of the first module of this class that answers.
fn of_class(class: &str, target: &Target) -> Result<Description, Failure> {
    let running = target.find()?;
    let Some(id) = running.installation.classes.id(class) else {
        return Err(format!("the configuration has no class `{}`", plain::line(class)).into());
    };
    let names = running.installation.modules.iter().flat_map(|module| module.names()).filter(|it| it.class() == id);
    let mut last = format!("no module of class `{class}` is in the configuration").into();
    for name in names.collect::<Vec<_>>() {
        match running.describe(name) {
            Ok(description) => return Ok(description),
            Err(error) => last = error,
        }
    }
    Err(last)
}

/// What a program that comes with Rohrpost offers: the one that the configuration names for it, else that of its class.
fn built_in(name: &str, target: &Target) -> Option<Description> {
    let Some((class, _)) = name.rsplit_once('.') else {
        return builtin::description(builtin::of_class(name)?, name);
    };
    let installation = Installation::load(target.config()?).ok()?;
    let module = installation.module(installation.classes.parse_name(name).ok()?.module())?;
    match &module.program {
        Program::Builtin(program) => builtin::description(program, class.rsplit('.').next()?),
        Program::Command(_) => None,
    }
}

fn told(name: &str, error: &dyn std::error::Error) -> Failure {
    let advice = "a module says its interface while it runs; what is built in is also known by its class alone";
    format!("no interface of `{}`: {error}\n{advice}, as `rohrpost interface export motor`", plain::line(name)).into()
}
