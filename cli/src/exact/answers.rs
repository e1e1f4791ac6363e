//! Answers to commands that are in journals: a replay in which the modules do not run gives them.

use super::journals;
use crate::terminal::Failure;
use rohrpost_config::Module;
use rohrpost_modules::journal::NotedAnswer;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::Path;

/// What modules have answered.
#[derive(Default, Serialize, Deserialize)]
pub(crate) struct JournalAnswers {
    /// Names of modules of which the files have a journal, from its beginning on.
    pub(crate) names: BTreeSet<String>,
    /// Names under which commands came, in the order of each journal.
    pub(crate) answers: Vec<(String, NotedAnswer)>,
}

impl JournalAnswers {
    /// Of these modules, in files that follow one another.
    pub(crate) fn read(files: &[&Path], modules: &[String]) -> Result<Self, Failure> {
        let (mut all, folder) = (Self::default(), tempfile::tempdir()?);
        for run in journals::of_files(files, modules, folder.path())? {
            let run = run.exact();
            // One that began late says nothing.
            let Ok((installation, module)) = run.installation() else { continue };
            let names = installation.module(module).into_iter().flat_map(Module::names);
            let names: Vec<String> = names.map(|name| installation.classes.format(name)).collect();
            let named = |answer: NotedAnswer| Some((names.get(usize::from(answer.endpoint))?.clone(), answer));
            all.answers.extend(run.answers()?.into_iter().filter_map(named));
            all.names.extend(names);
        }
        Ok(all)
    }
}
