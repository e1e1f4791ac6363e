//! `cargo xtask campaign`: faults against the supervised robot, by the tests of the whole (see `tests/e2e/campaign`).

use crate::cargo::{self, cargo};
use crate::failure::Failure;
use std::process::ExitCode;

/// What the options say of the tests, by the variables that these read.
fn variables(args: &[String]) -> Result<Vec<(&'static str, u64)>, Failure> {
    let mut variables = Vec::new();
    for option in args.chunks(2) {
        let variable = match option[0].as_str() {
            "--runs" => "ROHRPOST_CAMPAIGN_RUNS",
            "--seed" => "ROHRPOST_CAMPAIGN_SEED",
            other => return Err(format!("`{other}`: cargo xtask campaign takes --runs N and --seed S")),
        };
        let number = option.get(1).and_then(|number| number.parse().ok());
        variables.push((variable, number.ok_or_else(|| format!("write a whole number behind {}", option[0]))?));
    }
    Ok(variables)
}

/// Runs the campaign. Each run, and what came of it, is printed.
pub(crate) fn run(args: &[String]) -> Result<ExitCode, Failure> {
    let words = ["test", "--package", "rohrpost-cli", "--test", "e2e", "campaign::", "--", "--nocapture"];
    let mut command = cargo(&words);
    command.args(["--test-threads", "1"]);
    for (variable, number) in variables(args)? {
        command.env(variable, number.to_string());
    }
    cargo::run("a campaign of faults against the supervised robot", &mut command)?;
    Ok(ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_whole_numbers_and_others_are_refused() {
        let of = |line: &str| variables(&line.split_whitespace().map(str::to_owned).collect::<Vec<_>>());
        let both = Ok(vec![("ROHRPOST_CAMPAIGN_RUNS", 150), ("ROHRPOST_CAMPAIGN_SEED", 1)]);
        assert_eq!(of("--runs 150 --seed 1"), both);
        assert_eq!(of(""), Ok(Vec::new()));
        for (line, words) in [("--seed", "behind --seed"), ("--runs -1", "behind --runs"), ("7", "takes --runs N")] {
            assert!(of(line).unwrap_err().contains(words), "{line}");
        }
    }
}
