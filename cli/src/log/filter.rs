//! Which lines are shown. The collector knows nothing of it: it hands out pages, and the tool chooses.

use super::super::call;
use super::super::target::Running;
use super::arguments::Arguments;
use crate::terminal::Failure;
use rohrpost::Name;
use rohrpost::common::OutputLevel;
use rohrpost::output::OutputLine;
use rohrpost_mailbox::Class;

pub(super) struct Filter {
    level: OutputLevel,
    modules: Vec<Name>,
    classes: Vec<Class>,
    /// In small letters.
    text: Option<String>,
    pub(super) since_ns: Option<u64>,
}

/// `NAME=LEVEL`, taken apart.
type Wish<'a> = (&'a str, &'a str);

impl Filter {
    /// Reads the command line: what to set, and what to show.
    pub(super) fn read<'a>(arguments: &'a Arguments, running: &Running) -> Result<(Vec<Wish<'a>>, Self), Failure> {
        let (settings, shown): (Vec<_>, Vec<_>) = arguments.level.iter().partition(|level| level.contains('='));
        let level = match shown[..] {
            [] => OutputLevel::Trace,
            [level] => call::level_of(level)?,
            _ => return Err("--level says twice which lines to show; to set levels write --level NAME=LEVEL".into()),
        };
        let modules = arguments.module.iter().map(|name| module(name, running)).collect::<Result<_, _>>()?;
        let classes = arguments.class.iter().map(|name| class(name, running)).collect::<Result<_, _>>()?;
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
            && self.text.as_ref().is_none_or(|text| line.text.to_lowercase().contains(text))
    }
}

/// The module that a user names by its own name or an alias's: lines carry its own.
pub(super) fn module(text: &str, running: &Running) -> Result<Name, Failure> {
    let name = running.module(text)?;
    let module = running
        .installation
        .module(name)
        .ok_or_else(|| format!("{text} is a program run by hand, and says nothing to the collector"))?;
    Ok(module.name)
}

pub(super) fn class(text: &str, running: &Running) -> Result<Class, Failure> {
    let classes = &running.installation.classes;
    let class = classes.id(text).ok_or_else(|| {
        let all: Vec<&str> = classes.iter().map(|entry| entry.name.as_str()).collect();
        format!("no class `{text}`; there are {}", all.join(", "))
    })?;
    Ok(class)
}
