//! The common functions that show and set parameters, and the check of what a module starts with.

use super::context::Context;
use super::error::StartError;
use crate::common::{Change, PARAMETER_PAGE, ParameterPage, SetParameters};
use crate::made::MadeModule;
use crate::parameter::{Parameter, ParameterSet, Refusal, value_text};
use rohrpost_config::Installation;

/// The parameters from an index on, as many as one reply holds.
pub(crate) fn page<M: MadeModule>(module: &mut M, changes: u32, from: u16) -> ParameterPage {
    let mut page = ParameterPage { total: 0, changes, parameters: Vec::new() };
    let Some(set) = module.parameters() else { return page };
    page.total = u16::try_from(set.names().len()).unwrap_or(u16::MAX);
    let mut bytes = 0;
    for parameter in (from..page.total).map_while(|index| set.get(usize::from(index))) {
        // Writing to a growing vector does not fail.
        bytes += postcard::to_stdvec(&parameter).map_or(0, |written| written.len());
        if bytes > PARAMETER_PAGE && !page.parameters.is_empty() {
            break;
        }
        page.parameters.push(parameter);
    }
    page
}

/// A value that will do, and where it goes.
struct Wanted {
    index: usize,
    old: Parameter,
    new: Vec<u8>,
}

/// Sets all of them, or none; nothing else of the module runs meanwhile.
pub(crate) fn set<M: MadeModule>(
    module: &mut M,
    context: &mut Context,
    wish: &SetParameters,
    by: &str,
) -> Result<Vec<Change>, Refusal> {
    let set = module.parameters().ok_or(Refusal::NoParameters)?;
    let wanted = check(set, &wish.values)?;
    if !wish.only_check {
        apply(module, context, &wanted, by)?;
    }
    Ok(wanted.into_iter().map(|Wanted { old, new, .. }| Change { name: old.field.name, old: old.value, new }).collect())
}

fn check(set: &dyn ParameterSet, values: &[(String, Vec<u8>)]) -> Result<Vec<Wanted>, Refusal> {
    let mut wanted: Vec<Wanted> = Vec::with_capacity(values.len());
    for (name, value) in values {
        let unknown = || Refusal::Unknown { name: name.clone(), known: set.names().join(", ") };
        let index = set.names().iter().position(|known| known == name).ok_or_else(unknown)?;
        if wanted.iter().any(|earlier| earlier.index == index) {
            return Err(Refusal::Twice(name.clone()));
        }
        let old = set.get(index).ok_or_else(unknown)?;
        wanted.push(Wanted { index, old, new: set.accept(index, value)? });
    }
    Ok(wanted)
}

fn apply<M: MadeModule>(module: &mut M, context: &mut Context, wanted: &[Wanted], by: &str) -> Result<(), Refusal> {
    let changed: Vec<&Wanted> = wanted.iter().filter(|wanted| wanted.old.value != wanted.new).collect();
    if changed.is_empty() {
        return Ok(());
    }
    put(module, &changed, |wanted| &wanted.new);
    let names: Vec<&str> = changed.iter().map(|wanted| wanted.old.field.name.as_str()).collect();
    if let Err(error) = module.parameters_changed(context, &names) {
        put(module, &changed, |wanted| &wanted.old.value);
        return Err(Refusal::Module(error.to_string()));
    }
    for Wanted { old, new, .. } in changed {
        let text = |bytes: &Vec<u8>| Parameter { value: bytes.clone(), ..old.clone() }.value().map(|v| value_text(&v));
        if let (Ok(before), Ok(after)) = (text(&old.value), text(new)) {
            tracing::info!("{}: {before} -> {} (by {by})", old.field.name, old.field.with_unit(&after));
        }
    }
    Ok(())
}

fn put<M: MadeModule>(module: &mut M, changed: &[&Wanted], value: impl Fn(&Wanted) -> &Vec<u8>) {
    let Some(set) = module.parameters() else { return };
    for wanted in changed {
        set.put(wanted.index, value(wanted));
    }
}

/// What reading the settings could not see: saved values of what is no parameter, and defaults in code that are out of
/// range.
pub(crate) fn check_start<M: MadeModule>(
    module: &mut M,
    installation: &Installation,
    config: &rohrpost_config::Module,
    text: &str,
) -> Result<(), StartError> {
    let mut set = module.parameters();
    if let Some(saved) = &installation.saved {
        let names = set.as_ref().map_or_else(Vec::new, |set| set.names());
        saved.document(installation).check_names(config, &names)?;
    }
    let Some(set) = set.as_mut() else { return Ok(()) };
    for (index, parameter) in (0..set.names().len()).filter_map(|index| Some((index, set.get(index)?))) {
        let refused = |refusal| StartError::Module {
            module: text.to_owned(),
            text: format!("its own default: {refusal}"),
            errno: None,
            is_configuration: true,
        };
        set.accept(index, &parameter.value).map_err(refused)?;
    }
    Ok(())
}
