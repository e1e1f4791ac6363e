//! Runs scenarios of a team in virtual time: `cargo run -p rohrpost-virtual-team -- config/team/alone.toml`. Prints a
//! verdict for each. Exits with 1 if one is not as expected, with 2 if a file is none.

use rohrpost_virtual_team::scenario::Scenario;
use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let mut code = ExitCode::SUCCESS;
    let files: Vec<String> = std::env::args().skip(1).collect();
    if files.is_empty() {
        eprintln!("name scenarios to run, such as config/team/alone.toml");
        return ExitCode::from(2);
    }
    for file in files {
        match Scenario::read(Path::new(&file)) {
            Ok(scenario) => {
                let verdict = scenario.run(1);
                print!("{file}: {verdict}");
                if !verdict.wrong.is_empty() {
                    code = ExitCode::FAILURE;
                }
            }
            Err(error) => {
                eprintln!("{error}");
                code = ExitCode::from(2);
            }
        }
    }
    code
}
