//! A breadth-first search in C++, compiled when the bench runs.

use rohrpost_bench_local::harness::{Failure, OrFail};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const SOURCE: &str = include_str!("wave.cpp");
const PROGRAM: &str = "rohrpost-bench-wave";

/// The compiled program.
pub struct WaveFloor(PathBuf);

impl WaveFloor {
    /// Compiles it, beside this program.
    ///
    /// # Errors
    /// [`Failure::Skipped`] without a compiler; else what the compiler said.
    pub fn compile() -> Result<Self, Failure> {
        let own = std::env::current_exe().or_fail("this program")?;
        let program = own.with_file_name(PROGRAM);
        // Another bench may run what it has compiled: replaced as a whole.
        let new = own.with_file_name(format!("{PROGRAM}.{}", std::process::id()));
        let mut compiler = Command::new("c++");
        compiler.args(["-std=c++17", "-O3", "-Wall", "-Wextra", "-Werror", "-x", "c++", "-o"]).arg(&new).arg("-");
        let compiler = compiler.stdin(Stdio::piped()).stderr(Stdio::piped()).spawn();
        let mut compiler = compiler.map_err(|error| Failure::Skipped(format!("no C++ compiler, `c++`: {error}")))?;
        if let Some(mut input) = compiler.stdin.take() {
            // A compiler that reads nothing says why at its end.
            let _ = input.write_all(SOURCE.as_bytes());
        }
        let output = compiler.wait_with_output().or_fail("c++")?;
        if !output.status.success() {
            return Err(Failure::of("c++", String::from_utf8_lossy(&output.stderr)));
        }
        std::fs::rename(&new, &program).or_fail(PROGRAM)?;
        Ok(Self(program))
    }

    /// Spreads so many waves from a cell over the grid of a file. Gives the sum of all distances, and the time of each
    /// wave, us.
    ///
    /// # Errors
    /// What the program failed with.
    pub fn spread(&self, grid: &Path, start: u32, waves: usize) -> Result<(u64, Vec<f64>), Failure> {
        let mut program = Command::new(&self.0);
        let output = program.arg(grid).args([start.to_string(), waves.to_string()]).output().or_fail(PROGRAM)?;
        let said = String::from_utf8_lossy(&output.stdout);
        let mut lines = said.lines();
        let sum = lines.next().and_then(|line| line.parse().ok());
        let times: Option<Vec<f64>> = lines.map(|line| Some(line.parse::<f64>().ok()? / 1000.0)).collect();
        match (sum, times) {
            (Some(sum), Some(times)) if output.status.success() => Ok((sum, times)),
            _ => Err(Failure::Failed(format!("{PROGRAM}: {}", output.status))),
        }
    }
}
