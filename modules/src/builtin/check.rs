//! What built-in modules would refuse of a configuration, told before anything runs. The crate `config` knows no
//! modules, so it is here that both meet.

use super::{Builtin, description};
use rohrpost_config::{Installation, Problem, Program, Show, nearest};

/// Everything that built-in modules would refuse, by their settings, by what they call and by what the GUI is to show
/// of them. What programs of one's own would refuse only they know.
pub fn check(installation: &Installation) -> Vec<Problem> {
    let mut problems = Vec::new();
    for module in &installation.modules {
        let Program::Builtin(name) = &module.program else { continue };
        problems.extend(Builtin::find(name).map(|builtin| (builtin.check)(installation, module)).unwrap_or_default());
    }
    problems.extend(installation.gui.show.iter().filter_map(|show| data_of(installation, show)));
    problems
}

/// Everything that built-in modules would refuse of the values that were saved of their parameters, by line of that
/// file.
pub fn check_saved(installation: &Installation) -> Vec<Problem> {
    let wrong = installation.modules.iter().filter_map(|module| {
        let Program::Builtin(name) = &module.program else { return None };
        let error = (Builtin::find(name)?.check_saved)(installation, module)?;
        Some(Problem { line: Some(error.line), message: format!("[\"{}\"]: {}", error.module, error.message) })
    });
    wrong.collect()
}

/// What the GUI is to show of a built-in module, and that has no such data.
fn data_of(installation: &Installation, show: &Show) -> Option<Problem> {
    let module = installation.module(show.from)?;
    let class = installation.classes.name(show.from.class())?;
    let Program::Builtin(builtin) = &module.program else { return None };
    let description = description(builtin, class)?;
    let data = show.data.as_ref()?;
    if description.data_item(data).is_some() {
        return None;
    }
    let names: Vec<&str> = description.data.iter().map(|item| item.field.name.as_str()).collect();
    let right = match (nearest(data, names.iter().copied()), &names[..]) {
        (Some(name), _) => format!("did you mean `{name}`?"),
        (None, []) => "it publishes none; drop the entry".into(),
        (None, names) => format!("it has {}", names.join(", ")),
    };
    let from = installation.classes.format(show.from);
    Some(Problem { line: Some(show.line), message: format!("[gui] show: `{from}` has no data `{data}`; {right}") })
}
