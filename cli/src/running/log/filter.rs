//! Selects lines. The collector does not filter: it hands out pages, and the tool selects.

use super::arguments::Arguments;
use crate::look::target::Running;
use crate::running::call;
use crate::terminal::Failure;
use rohrpost::Name;
use rohrpost::common::OutputLevel;
use rohrpost::output::OutputLine;
use rohrpost_config::Installation;
use rohrpost_mailbox::Class;

pub(super) struct Filter {
    level: OutputLevel,
    modules: Vec<Name>,
    classes: Vec<Class>,
    /// In lower case.
    text: Option<String>,
    pub(super) since_ns: Option<u64>,
}

/// A parsed `NAME=LEVEL`.
type LevelAssignment<'a> = (&'a str, &'a str);

impl Filter {
    /// Parses the command line: levels to set, and lines to show. `find` finds a module, alias or tool by its name.
    pub(super) fn read<'a>(
        arguments: &'a Arguments,
        installation: &Installation,
        find: &dyn Fn(&str) -> Result<Name, Failure>,
    ) -> Result<(Vec<LevelAssignment<'a>>, Self), Failure> {
        let (settings, shown): (Vec<_>, Vec<_>) = arguments.level.iter().partition(|level| level.contains('='));
        let level = match shown[..] {
            [] => OutputLevel::Trace,
            [level] => call::level_of(level)?,
            _ => return Err("--level selects lines twice; to set levels write --level NAME=LEVEL".into()),
        };
        let own = |text: &String| own_name(text, find(text)?, installation);
        let modules = arguments.module.iter().map(own).collect::<Result<_, _>>()?;
        let classes = arguments.class.iter().map(|name| class(name, installation)).collect::<Result<_, _>>()?;
        let text = arguments.text.as_ref().map(|text| text.to_lowercase());
        let settings = settings.into_iter().filter_map(|setting| setting.split_once('=')).collect();
        Ok((settings, Self { level, modules, classes, text, since_ns: None }))
    }

    pub(super) fn passes(&self, line: &OutputLine) -> bool {
        let module = line.module();
        let named = self.modules.contains(&module) || self.classes.contains(&module.class());
        line.level <= self.level
            && (named || self.modules.is_empty() && self.classes.is_empty())
            && self.since_ns.is_none_or(|since_ns| line.time_ns >= since_ns)
            && self.text.as_ref().is_none_or(|text| line.full_text().to_lowercase().contains(text))
    }
}

/// Resolves a module's own name or an alias: lines carry the module's own name.
pub(super) fn module(text: &str, running: &Running) -> Result<Name, Failure> {
    own_name(text, running.module(text)?, &running.installation)
}

fn own_name(text: &str, name: Name, installation: &Installation) -> Result<Name, Failure> {
    let module = installation.module(name);
    let module =
        module.ok_or_else(|| format!("{text} is a program run by hand, and sends no lines to the collector"))?;
    Ok(module.name)
}

pub(super) fn class(text: &str, installation: &Installation) -> Result<Class, Failure> {
    let classes = &installation.classes;
    let class = classes.id(text).ok_or_else(|| {
        let all: Vec<&str> = classes.iter().map(|entry| entry.name.as_str()).collect();
        format!("no class `{text}`; there are {}", all.join(", "))
    })?;
    Ok(class)
}
