//! What programs in other languages need: a compiler and the library for C, an interpreter and packages for Python.
//!
//! Their sources stand in `benches/languages`; how they talk to the bench, [`crate::foreign::ForeignProgram`] says.

use crate::foreign::ForeignProgram;
use rohrpost_bench_local::harness::{Failure, OrFail};
use rohrpost_bench_local::settings::Settings;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const PACKAGE: &str = env!("CARGO_MANIFEST_DIR");
/// What the C program is called; it is put beside this program.
const C_PROGRAM: &str = "rohrpost-bench-c";
const C_LIBRARY: &str = "librohrpost_c.a";
/// What makes the library as it is installed: optimised as a whole.
const BUILD_C_LIBRARY: &str = "cargo rustc --release -p rohrpost-c --lib --crate-type staticlib";
/// What a static library of Rust's needs besides.
const SYSTEM_LIBRARIES: [&str; 5] = ["-lpthread", "-ldl", "-lm", "-lrt", "-lgcc_s"];
/// What the interpreter may import; all that it finds is told with its version.
const VERSIONS: &str = "
import importlib.metadata as metadata, platform
print('Python', platform.python_version())
for package in ('rohrpost', 'iceoryx2', 'eclipse-zenoh', 'numpy'):
    try:
        print(package, metadata.version(package))
    except metadata.PackageNotFoundError:
        pass
";

/// The interpreter of programs in Python.
pub struct Interpreter {
    program: PathBuf,
    /// The client that is Python alone, of this repository, for an interpreter in which nothing is installed.
    sources: Option<PathBuf>,
}

impl Interpreter {
    /// The one that was named; without it, the system's, with the sources of this repository.
    pub fn of(settings: &Settings) -> Self {
        let sources = || Path::new(PACKAGE).with_file_name("clients").join("python/src");
        match &settings.python {
            Some(program) => Self { program: program.clone(), sources: None },
            None => Self { program: "python3".into(), sources: Some(sources()) },
        }
    }

    /// A script of `benches/languages` with its own arguments.
    pub fn runs(&self, script: &str, own: &[&str]) -> ForeignProgram {
        // `-B`: nothing is written beside the sources.
        let first = vec!["-B".into(), sources_of(script).into()];
        let last = own.iter().map(OsString::from).collect();
        ForeignProgram { program: self.program.clone(), first, last, environment: self.variables() }
    }

    fn variables(&self) -> Vec<(&'static str, OsString)> {
        self.sources.iter().map(|sources| ("PYTHONPATH", sources.into())).collect()
    }

    /// Whether it has what a script needs.
    ///
    /// # Errors
    /// [`Failure::Skipped`] when it has not; [`Failure::Failed`] when there is no such interpreter.
    pub fn require(&self, imports: &str) -> Result<(), Failure> {
        let name = self.program.display();
        // Without the folder in which the bench runs: a folder there may have a package's name.
        self.says(&format!("import sys; del sys.path[0]; import {imports}"))?.map(drop).map_err(|why| {
            Failure::Skipped(format!("{name} cannot `import {imports}` ({why}); name one that can with --python"))
        })
    }

    /// Of itself, and of what is measured in it, for people; empty without an interpreter.
    pub fn versions(&self) -> Vec<String> {
        let said = self.says(VERSIONS).ok().and_then(Result::ok).unwrap_or_default();
        said.lines().map(str::to_owned).collect()
    }

    /// What a script prints, or the last line of what is wrong.
    fn says(&self, script: &str) -> Result<Result<String, String>, Failure> {
        let mut command = Command::new(&self.program);
        command.args(["-B", "-c", script]).envs(self.variables());
        let output = command.output().or_fail(&self.program.display().to_string())?;
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim().to_owned();
        if output.status.success() {
            return Ok(Ok(text(&output.stdout)));
        }
        Ok(Err(text(&output.stderr).lines().last().unwrap_or_default().to_owned()))
    }
}

/// The program in C, compiled as its users do.
///
/// # Errors
/// [`Failure::Skipped`] without a compiler or the library; else what the compiler said.
pub fn compile_c() -> Result<PathBuf, Failure> {
    let own = std::env::current_exe().or_fail("this program")?;
    let folder = own.parent().unwrap_or(Path::new("."));
    // Cargo puts what it makes for tests into `deps` alone.
    let places = [folder.to_owned(), folder.join("deps")];
    let library = places.iter().map(|place| place.join(C_LIBRARY)).find(|library| library.is_file());
    let library = library
        .ok_or_else(|| Failure::Skipped(format!("no {C_LIBRARY} in {}; {BUILD_C_LIBRARY}", folder.display())))?;
    let program = folder.join(C_PROGRAM);
    // Another bench may run what it has compiled: replaced as a whole.
    let new = folder.join(format!("{C_PROGRAM}.{}", std::process::id()));
    let mut compiler = Command::new("cc");
    compiler.args(["-std=c11", "-D_GNU_SOURCE", "-O2", "-Wall", "-Wextra", "-Werror", "-I"]);
    compiler.arg(Path::new(PACKAGE).with_file_name("clients").join("c/include")).arg(sources_of("ping_pong.c"));
    let output = compiler.arg(library).args(SYSTEM_LIBRARIES).arg("-o").arg(&new).output();
    let output = output.map_err(|error| Failure::Skipped(format!("no C compiler, `cc`: {error}")))?;
    if !output.status.success() {
        return Err(Failure::of("cc", String::from_utf8_lossy(&output.stderr)));
    }
    fs::rename(&new, &program).or_fail(C_PROGRAM)?;
    Ok(program)
}

/// First line of what the C compiler says of itself.
pub fn c_version() -> Option<String> {
    let output = Command::new("cc").arg("--version").output().ok()?;
    String::from_utf8_lossy(&output.stdout).lines().next().map(str::to_owned)
}

fn sources_of(file: &str) -> PathBuf {
    Path::new(PACKAGE).join("languages").join(file)
}
