//! `rohrpost bundle check`: what each node has, which of its files differ, and whether all nodes have the same.

use super::place::{NodeAnswer, NodePlace};
use crate::terminal::table::table;
use crate::terminal::{Failure, say};
use rohrpost_bundle::{NodeFolder, NodeReport};
use std::collections::BTreeSet;
use std::process::ExitCode;

/// Digits of a digest that people see.
const DIGITS: usize = 12;

pub(super) fn run(places: &[NodePlace], json: bool) -> Result<ExitCode, Failure> {
    let answers: Vec<NodeAnswer> = places.iter().map(ask).collect();
    let is_right = |answer: &NodeAnswer| answer.report.as_ref().is_some_and(|report| report.problems.is_empty());
    let bundles: BTreeSet<&str> =
        answers.iter().filter_map(|answer| Some(answer.report.as_ref()?.bundle.as_str())).collect();
    let all_right = answers.iter().all(is_right) && bundles.len() == 1;
    if json {
        say(serde_json::to_string(&answers)?);
    } else {
        say(verdict(&answers, bundles.len(), all_right));
        say(table(["node", ">version", "bundle", "trial", "before"], answers.iter().map(row)).trim_end());
        for NodeAnswer { place, report, error } in &answers {
            for problem in report.iter().flat_map(|report| &report.problems).chain(error) {
                say(format_args!("{place}: {problem}"));
            }
        }
    }
    Ok(if all_right { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn ask(place: &NodePlace) -> NodeAnswer {
    let report = match place {
        NodePlace::Folder(folder) => NodeFolder::new(folder).report().map_err(|error| error.to_string()),
        NodePlace::Host(host) => host.report().map_err(|error| error.to_string()),
    };
    let (report, error) = match report {
        Ok(report) => (Some(report), None),
        Err(error) => (None, Some(error)),
    };
    NodeAnswer { place: place.to_string(), report, error }
}

fn verdict(answers: &[NodeAnswer], bundles: usize, all_right: bool) -> &'static str {
    match (answers.len(), bundles) {
        (1, _) if all_right => "all files are as the manifest says\n",
        (_, 1) if all_right => "all nodes have the same bundle, and all files are as the manifest says\n",
        (_, 2..) => "NODES DIFFER: they have several bundles\n",
        _ => "FILES DIFFER, or a node has no bundle\n",
    }
}

fn row(answer: &NodeAnswer) -> [String; 5] {
    let Some(NodeReport { version, bundle, trial, before, .. }) = &answer.report else {
        return [answer.place.clone(), "-".into(), "-".into(), "-".into(), String::new()];
    };
    let before: Vec<String> = before.iter().map(u64::to_string).collect();
    let short = bundle.chars().take(DIGITS).collect();
    [answer.place.clone(), version.to_string(), short, trial.clone(), before.join(", ")]
}
