//! `rohrpost new`: creates a module's project that compiles, runs and has a test.

mod name;

use crate::terminal::{Failure, say};
use name::ModuleName;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Rohrpost's sources that this command was built from; they contain the library.
const BUILT_FROM: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
/// Sources that are installed with this command, from the folder of its executable.
const INSTALLED: &str = "../share/rohrpost/src";

/// A file of the project: its path, and its content with `{{…}}` for placeholders.
type Template = (&'static str, &'static str);

/// The files that all projects in Rust have.
const RUST: [Template; 3] = [
    ("Cargo.toml", include_str!("template/Cargo.toml.in")),
    (".gitignore", include_str!("template/gitignore.in")),
    ("src/main.rs", include_str!("template/main.rs.in")),
];

/// What the module does before its author changes it.
struct Kind {
    /// What the project is, for the user.
    text: &'static str,
    /// What makes it ready to be launched.
    build: &'static str,
    /// What `program` of robot.toml is.
    program: &'static str,
    /// One of its `settings` there.
    setting: &'static str,
    common: &'static [Template],
    files: [Template; 4],
}

const COUNTER: Kind = Kind {
    text: "a module that counts",
    build: "cargo build && ",
    program: "\"target/debug/{{name}}\"",
    setting: "rate-hz = 10.0",
    common: &RUST,
    files: [
        ("README.md", include_str!("template/README.md.in")),
        ("robot.toml", include_str!("template/robot.toml.in")),
        ("src/lib.rs", include_str!("template/lib.rs.in")),
        ("tests/module.rs", include_str!("template/module.rs.in")),
    ],
};

const CAMERA: Kind = Kind {
    text: "a camera that draws its pictures",
    files: [
        ("README.md", include_str!("template/camera/README.md.in")),
        ("robot.toml", include_str!("template/camera/robot.toml.in")),
        ("src/lib.rs", include_str!("template/camera/lib.rs.in")),
        ("tests/module.rs", include_str!("template/camera/module.rs.in")),
    ],
    ..COUNTER
};

const PYTHON: Kind = Kind {
    text: "a module in Python that counts",
    build: "",
    program: "\"./{{crate}}.py\"",
    setting: "step = 1",
    common: &[],
    files: [
        ("README.md", include_str!("template/python/README.md.in")),
        ("robot.toml", include_str!("template/robot.toml.in")),
        ("{{crate}}.py", include_str!("template/python/module.py.in")),
        ("test_{{crate}}.py", include_str!("template/python/test.py.in")),
    ],
};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  rohrpost new wind-vane
  cd wind-vane && cargo build && rohrpost launch robot.toml
  rohrpost new wind-vane --python      needs no build, and the package `rohrpost` for Python")]
pub(crate) struct Arguments {
    /// The module's class, which names the project too: lower-case letters, digits and `-`.
    name: String,
    /// Begin with a camera: pictures of 1920 by 1080 pixels in a stream.
    #[arg(long)]
    camera: bool,
    /// Write it in Python.
    #[arg(long, conflicts_with_all = ["camera", "rohrpost"])]
    python: bool,
    /// Folder of the project; default: NAME in the present folder.
    #[arg(long, value_name = "DIR")]
    path: Option<PathBuf>,
    /// Folder of Rohrpost's sources; default: those installed with this command, else where it was built from.
    #[arg(long, value_name = "DIR")]
    rohrpost: Option<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode, Failure> {
    let name: ModuleName = arguments.name.parse()?;
    let kind = if arguments.python {
        PYTHON
    } else if arguments.camera {
        CAMERA
    } else {
        COUNTER
    };
    let rohrpost = if arguments.python { String::new() } else { sources(arguments.rohrpost.as_deref())? };
    let folder = arguments.path.clone().unwrap_or_else(|| name.as_str().into());
    // Existing files are never overwritten.
    match fs::read_dir(&folder).map(|mut entries| entries.next().is_none()) {
        Ok(true) => {}
        Ok(false) => {
            return Err(format!("{} is not empty; name another folder with --path DIR", folder.display()).into());
        }
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
        Err(error) => return Err(format!("{}: {error}; name another folder with --path DIR", folder.display()).into()),
    }
    let fill = |text: &str| fill(text, &kind, &name, &rohrpost);
    for (file, template) in kind.common.iter().chain(&kind.files) {
        write(&folder.join(fill(file)), &fill(template))?;
    }
    let (shown, text, build) = (folder.display(), kind.text, kind.build);
    say(format_args!(
        "made {shown}: {text}, its test, and a configuration\n\n  cd {shown}\n  {build}rohrpost launch \
         robot.toml\n\n\
         README.md there says how to go on."
    ));
    Ok(ExitCode::SUCCESS)
}

fn write(file: &Path, text: &str) -> Result<(), Failure> {
    let failed = |error| format!("{}: {error}", file.display());
    if let Some(folder) = file.parent() {
        fs::create_dir_all(folder).map_err(failed)?;
    }
    fs::write(file, text).map_err(failed)?;
    if text.starts_with("#!") {
        fs::set_permissions(file, fs::Permissions::from_mode(0o755)).map_err(failed)?;
    }
    Ok(())
}

fn fill(template: &str, kind: &Kind, name: &ModuleName, rohrpost: &str) -> String {
    let template = template.replace("{{program}}", kind.program).replace("{{setting}}", kind.setting);
    let filled = template.replace("{{name}}", name.as_str()).replace("{{crate}}", &name.crate_name());
    filled.replace("{{Type}}", &name.type_name()).replace("{{rohrpost}}", rohrpost)
}

fn holds_library(folder: &Path) -> bool {
    fs::read_to_string(folder.join("Cargo.toml")).is_ok_and(|manifest| manifest.contains("name = \"rohrpost\""))
}

/// Rohrpost's dependency line for a Cargo.toml.
fn sources(given: Option<&Path>) -> Result<String, Failure> {
    let installed = std::env::current_exe().ok().and_then(|program| Some(program.parent()?.join(INSTALLED)));
    let own = installed.filter(|folder| holds_library(folder)).unwrap_or_else(|| BUILT_FROM.into());
    let folder = given.unwrap_or(&own);
    if !holds_library(folder) {
        let why = if given.is_some() { "holds" } else { "was where this command was built, and holds" };
        return Err(format!(
            "{} {why} no sources of Rohrpost; say where they are with --rohrpost DIR",
            folder.display()
        )
        .into());
    }
    let folder = folder.canonicalize().map_err(|error| format!("{}: {error}", folder.display()))?;
    // Quoted as in TOML.
    Ok(folder.display().to_string().replace('\\', "\\\\").replace('"', "\\\""))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_template_has_no_placeholders_left_and_a_valid_configuration() {
        let name: ModuleName = "wind-vane".parse().unwrap();
        let kinds = [COUNTER, CAMERA, PYTHON];
        let files = kinds.iter().flat_map(|kind| kind.common.iter().chain(&kind.files).map(move |file| (kind, file)));
        for (kind, (file, template)) in files {
            let text = fill(template, kind, &name, "/opt/rohrpost");
            assert!(!text.contains("{{"), "{file}: {text}");
            if *file == "robot.toml" {
                let installation = rohrpost_config::Installation::parse(&text, Path::new(file)).unwrap();
                assert_eq!(installation.modules.len(), 2);
            }
        }
    }

    #[test]
    fn a_camera_has_at_most_sixty_lines() {
        let (_, module) = CAMERA.files.into_iter().find(|(file, _)| *file == "src/lib.rs").unwrap();
        assert!(module.lines().count() <= 60, "{}", module.lines().count());
    }
}
