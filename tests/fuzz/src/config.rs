//! Whole configuration files: an installation, or its mistakes, line by line; and all output of `rohrpost check`.

use crate::split;
use rohrpost_builtin::{check, check_saved};
use rohrpost_config::{Errors, Installation, Problem, Saved, explain};

pub(crate) fn run(data: &[u8]) {
    let Some((text, saved)) = split::texts(data) else { return };
    let path = "robot/fuzzed.toml".as_ref();
    let mut installation = match Installation::parse(text, path) {
        Ok(installation) => installation,
        Err(errors) => return validate(&errors, text),
    };
    let again = Installation::parse(text, path).unwrap_or_else(|errors| panic!("the second time: {errors}"));
    assert_eq!(installation.digest(), again.digest());
    match Saved::parse(saved, "robot/saved.toml".as_ref(), &installation) {
        Ok(values) => installation.saved = Some(values),
        Err(errors) => validate(&errors, saved),
    }
    all_of(&installation);
    let lines = |text: &str| text.lines().count().max(1);
    check(&installation).iter().for_each(|problem| told(problem, lines(text)));
    check_saved(&installation).iter().for_each(|problem| told(problem, lines(text).max(lines(saved))));
}

/// There is a reason, and a valid place in the file.
pub(crate) fn validate(errors: &Errors, text: &str) {
    assert!(!errors.problems().is_empty(), "refused, and nobody says why");
    let lines = text.lines().count().max(1);
    errors.problems().iter().for_each(|problem| told(problem, lines));
    assert_eq!(errors.to_string().lines().count(), errors.problems().len(), "each is one line:\n{errors}");
}

fn told(problem: &Problem, lines: usize) {
    let line = problem.line.unwrap_or_else(|| panic!("without a line: {}", problem.message));
    assert!((1..=lines).contains(&line), "line {line} of {lines}: {}", problem.message);
    assert!(!problem.message.is_empty());
}

fn all_of(installation: &Installation) {
    assert!(!explain(installation, None).is_empty());
    for node in &installation.nodes {
        let _ = (explain(installation, Some(&node.name)), node.launch_instance(), node.tools_by_hand());
        let _ = installation.modules_on(&node.name).count();
    }
    let document = installation.document();
    for module in &installation.modules {
        assert_eq!(installation.module(module.name).map(|found| found.name), Some(module.name));
        let _ = (module.memory(), installation.scheduling(module.name.class()), installation.output_level(module.name));
        assert_eq!(installation.node_of(module.name), Some(module.node.as_str()));
        for settings in [document.settings_as::<toml::Table>(module), document.settings_without_saved(module)] {
            for key in settings.unwrap_or_else(|error| panic!("settings are a table: {error}")).keys() {
                assert!(document.settings_line(module, key) <= installation.text.lines().count());
            }
        }
    }
}
