//! Answers to commands that are in journals: a replay in which the modules do not run gives them.

use super::journals;
use crate::terminal::{Failure, complain};
use rohrpost_config::Module;
use rohrpost_modules::journal::NotedAnswer;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::Path;

/// Of all answers together.
const ANSWERS_BYTES_MAX: usize = 64 << 20;

/// What modules have answered.
#[derive(Default, Serialize, Deserialize)]
pub(crate) struct JournalAnswers {
    /// Names of modules of which the files have a journal, from its beginning on.
    pub(crate) names: BTreeSet<String>,
    /// Names under which commands came, in the order of each journal.
    pub(crate) answers: Vec<(String, NotedAnswer)>,
}

impl JournalAnswers {
    /// Of these modules, in files that follow one another. Their journals are put together in a folder of their own
    /// within this one, and removed.
    pub(crate) fn read(files: &[&Path], modules: &[String], folder: &Path) -> Result<Self, Failure> {
        let folder = tempfile::tempdir_in(folder)?;
        let (mut all, mut room) = (Self::default(), Some(ANSWERS_BYTES_MAX));
        for run in journals::of_files(files, modules, folder.path())? {
            let exact = run.exact();
            // One that began late says nothing.
            let Ok((installation, module)) = run.installation(&exact) else { continue };
            let names = installation.module(module).into_iter().flat_map(Module::names);
            let names: Vec<String> = names.map(|name| installation.classes.format(name)).collect();
            exact.each_answer(|answer| {
                let Some(name) = names.get(usize::from(answer.endpoint)) else { return true };
                room = room.and_then(|room| room.checked_sub(answer.bytes() + name.len()));
                if room.is_some() {
                    all.answers.push((name.clone(), answer));
                }
                room.is_some()
            })?;
            all.names.extend(names);
        }
        if room.is_none() {
            complain(format_args!(
                "the answers to commands are more than {} MiB: those behind that are not played",
                ANSWERS_BYTES_MAX >> 20
            ));
        }
        Ok(all)
    }
}
