//! `cargo xtask fuzz`: builds the fuzz targets with the compiler's coverage counters, which the stable compiler has,
//! too, and lets libFuzzer run them.
//!
//! Inputs with new coverage are kept below `target/fuzz/found`, as a start for longer runs. An input that breaks a
//! promise is a file in `target/fuzz`, and goes into `tests/fuzz/corpus` once the mistake is fixed.

use crate::cargo::{self, cargo, host};
use crate::failure::Failure;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};

const PACKAGE: &str = "rohrpost-fuzz";
/// As `cargo fuzz` builds: coverage of every edge, and of comparisons. Own code checks its arithmetic.
const FLAGS: &str = "-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
    -Cllvm-args=-sanitizer-coverage-trace-compares -Ccodegen-units=1";
/// What nearly all inputs pass through, besides what the profile optimises. More would cost a short run more than it
/// saves.
const OPTIMISED: [&str; 14] = [
    "libfuzzer-sys",
    "mcap",
    "memchr",
    "postcard",
    "ring",
    "rohrpost-config",
    "rohrpost-fuzz",
    "rohrpost-recording",
    "serde_core",
    "serde_json",
    "tempfile",
    "toml",
    "toml_parser",
    "winnow",
];
/// Time limit of an input, also on a busy machine; the slowest of the corpus takes some hundredths of a second.
const INPUT_SECONDS_MAX: u32 = 30;
/// Memory limit, above all needs; a trusted claimed length exceeds it.
const MEGABYTES_MAX: u32 = 1024;
/// An input of this length holds a whole small configuration.
const INPUT_BYTES_MAX: u32 = 4096;

/// `cargo xtask fuzz [TARGET...] [--seconds N]`: long runs, each beginning where the last one ended. `--short`: as in
/// CI.
pub(crate) fn run(args: &[String]) -> Result<ExitCode, Failure> {
    if args == ["--short"] {
        return short().map(|()| ExitCode::SUCCESS);
    }
    let mut seconds = 60;
    let mut names = Vec::new();
    let mut args = args.iter();
    while let Some(arg) = args.next() {
        if arg == "--seconds" {
            let value = args.next().and_then(|value| value.parse().ok());
            seconds = value.ok_or("--seconds: how many?")?;
        } else {
            names.push(arg.clone());
        }
    }
    let fuzzer = Fuzzer::build()?;
    let names = if names.is_empty() { fuzzer.targets()? } else { names };
    fuzzer.run_all(&names, &Effort::Long { seconds })?;
    Ok(ExitCode::SUCCESS)
}

/// A short run of all targets, the same each time; first, the planted mistake must be found.
pub(crate) fn short() -> Result<(), Failure> {
    let fuzzer = Fuzzer::build()?;
    match fuzzer.run("planted", &Effort::Planted) {
        Err(failure) if failure.contains("planted: the fuzzer has found it") => eprintln!("==> as it should be"),
        Err(failure) => return Err(failure),
        Ok(()) => return Err("the fuzzer does not find what is planted for it".into()),
    }
    fuzzer.run_all(&fuzzer.targets()?, &Effort::Short)
}

enum Effort {
    /// Until the mistake is found; mostly by some 100 000 inputs, in seconds.
    Planted,
    /// From the kept corpus alone, with one seed, so many inputs.
    Short,
    /// From all inputs found so far.
    Long { seconds: u32 },
}

struct Fuzzer {
    program: PathBuf,
    corpus: PathBuf,
    work: PathBuf,
}

impl Fuzzer {
    fn build() -> Result<Self, Failure> {
        if Command::new("c++").arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_err() {
            return Err("libFuzzer is compiled from its source, and there is no C++ compiler; on Debian: \
                apt-get update && apt-get install -y g++"
                .into());
        }
        let work = cargo::target().join("fuzz");
        let mut command = cargo(&["build", "--package", PACKAGE, "--features", "libfuzzer"]);
        // Flags for a named target do not reach build scripts and macros.
        let host = host()?;
        for package in OPTIMISED {
            command.args(["--config", &format!("profile.dev.package.{package}.opt-level=1")]);
        }
        command.args(["--target", &host]).env("CARGO_TARGET_DIR", &work).env("RUSTFLAGS", FLAGS);
        cargo::run("building the fuzz targets", &mut command)?;
        let program = work.join(host).join("debug").join(PACKAGE);
        Ok(Self { program, corpus: cargo::root().join("tests/fuzz/corpus"), work })
    }

    /// Each has a folder in the corpus.
    fn targets(&self) -> Result<Vec<String>, Failure> {
        let failed = |error| format!("{}: {error}", self.corpus.display());
        let folders = fs::read_dir(&self.corpus).map_err(failed)?;
        let mut names: Vec<_> = folders.flatten().filter_map(|entry| entry.file_name().into_string().ok()).collect();
        names.sort();
        Ok(names)
    }

    /// One after the other, also after one has failed.
    fn run_all(&self, names: &[String], effort: &Effort) -> Result<(), Failure> {
        let failures: Vec<_> = names.iter().filter_map(|name| self.run(name, effort).err()).collect();
        if failures.is_empty() { Ok(()) } else { Err(failures.join("\n")) }
    }

    fn run(&self, name: &str, effort: &Effort) -> Result<(), Failure> {
        let told = |path: &Path, error| format!("{}: {error}", path.display());
        // In memory, where nodes belong; under one name, since files of an interrupted target stay.
        let memory = Path::new("/dev/shm");
        let around = if memory.is_dir() { memory } else { &self.work };
        let nodes = around.join(format!("rohrpost-fuzz-{}", std::process::id()));
        let _ = fs::remove_dir_all(&nodes);
        let found = match effort {
            Effort::Planted | Effort::Short => nodes.join("found"),
            Effort::Long { .. } => self.work.join("found").join(name),
        };
        for folder in [&nodes, &found] {
            fs::create_dir_all(folder).map_err(|error| told(folder, error))?;
        }
        let mut command = Command::new(&self.program);
        command.env("ROHRPOST_FUZZ", name).env("TMPDIR", &nodes).env("ROHRPOST_DIR", &nodes).current_dir(&self.work);
        command.args(match effort {
            Effort::Planted => ["-seed=1".into(), "-runs=3000000".into(), "-max_total_time=90".into()],
            Effort::Short => ["-seed=1".into(), "-runs=20000".into(), "-max_total_time=6".into()],
            Effort::Long { seconds } => ["-seed=0".into(), "-runs=-1".into(), format!("-max_total_time={seconds}")],
        });
        command.arg(format!("-timeout={INPUT_SECONDS_MAX}")).arg(format!("-rss_limit_mb={MEGABYTES_MAX}"));
        command
            .arg(format!("-max_len={INPUT_BYTES_MAX}"))
            .arg("-print_final_stats=1")
            .arg(format!("-artifact_prefix={name}-"));
        command.arg(&found);
        let kept = self.corpus.join(name);
        if kept.is_dir() {
            command.arg(kept);
        }
        let words = self.corpus.with_file_name("dictionaries").join(name);
        if words.is_file() {
            command.arg(format!("-dict={}", words.display()));
        }
        let log = self.work.join(format!("{name}.log"));
        let output = fs::File::create(&log).map_err(|error| told(&log, error))?;
        command.stdout(Stdio::null()).stderr(output);
        let ended = cargo::run(&format!("fuzzing {name}"), &mut command);
        let _ = fs::remove_dir_all(&nodes);
        let text = fs::read_to_string(&log).unwrap_or_default();
        let about = |line: &&str| line.starts_with("stat::number_of") || line.contains(" DONE ");
        text.lines().filter(about).for_each(|line| eprintln!("    {line}"));
        ended.map_err(|failure| {
            let from = text.find("panicked at").or_else(|| text.find("ERROR: libFuzzer")).unwrap_or(0);
            let said: String = text[from..].chars().take(600).collect();
            format!("{failure}\n{said}\nall of it: {}", log.display())
        })
    }
}
