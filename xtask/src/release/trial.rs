//! Packages, installed where nothing is, and the demo run there.

use super::tree::Tree;
use crate::cargo::{self, output};
use crate::failure::Failure;
use crate::files::{copy, empty_folder, make_folder, read, write};
use crate::venv;
use std::path::Path;
use std::process::Command;

/// Installs a package in an empty root and runs what it brings there, in namespaces of this process alone: as root of
/// them, with `/proc`, devices and a shared memory of its own, and the libraries that the package depends on.
const IN_A_ROOT: &str = r#"set -e
dpkg --root="$1" --force-depends --install "$2"
mount --rbind /proc "$1/proc"
mount --rbind /dev "$1/dev"
mount -t tmpfs tmpfs "$1/dev/shm"
cd "$1"
chroot "$1" /usr/bin/rohrpost new weather --path /tmp/weather
exec chroot "$1" /usr/bin/rohrpost demo --no-gui --seconds 3
"#;

/// A `.deb`, without a clone, a compiler or anything else.
pub(super) fn in_an_empty_root(package: &Path, tree: &Tree, root: &Path) -> Result<(), Failure> {
    empty_folder(root)?;
    for folder in ["proc", "dev", "tmp", "var/lib/dpkg/info", "var/lib/dpkg/updates"] {
        make_folder(&root.join(folder))?;
    }
    write(&root.join("var/lib/dpkg/status"), "")?;
    // The name of each binary stands above its libraries, with a colon.
    let needed = output(Command::new("ldd").args(&tree.binaries))?;
    for library in needed.split_whitespace().filter(|word| word.starts_with('/') && !word.ends_with(':')) {
        copy(Path::new(library), &root.join(library.trim_start_matches('/')))?;
    }
    let mut install = Command::new("unshare");
    install.args(["--map-root-user", "--mount", "--ipc", "sh", "-c", IN_A_ROOT, "sh"]).arg(root).arg(package);
    install.env("PATH", "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin").env_remove("ROHRPOST_DIR");
    cargo::run("installing the .deb in an empty root, and running a demo there", &mut install)?;
    let made = root.join("tmp/weather/Cargo.toml");
    if read(&made)?.contains("path = \"/usr/share/rohrpost/src\"") {
        Ok(())
    } else {
        Err(format!("{} does not lead to the sources that the package brings", made.display()))
    }
}

/// A wheel, with the command that it carries, and a project that this begins.
pub(super) fn in_a_fresh_venv(wheel: &Path, venv: &Path) -> Result<(), Failure> {
    let mut fresh = Command::new("python3");
    // With another's pip, which need not be installed then.
    cargo::run("making a fresh environment of Python", fresh.args(["-m", "venv", "--without-pip"]).arg(venv))?;
    let (bin, mut install) = (venv.join("bin"), Command::new(venv::clients()?));
    install.args(["-m", "pip", "--disable-pip-version-check", "--python"]).arg(bin.join("python"));
    install.args(["install", "--quiet", "--no-index"]).arg(wheel);
    cargo::run("installing the wheel in it", &mut install)?;
    let is_available = "import rohrpost, sys; sys.exit(not rohrpost.is_available())";
    let mut ask = Command::new(bin.join("python"));
    cargo::run("asking it for modules on the node, which it has", ask.args(["-c", is_available]))?;
    // In a folder without configurations of its own.
    let memory = venv.join("shm");
    make_folder(&memory)?;
    let mut demo = Command::new(bin.join("rohrpost"));
    demo.args(["demo", "--no-gui", "--seconds", "3"]).current_dir(venv).env("ROHRPOST_DIR", &memory);
    cargo::run("running a demo by the command that it carries", &mut demo)?;
    let project = venv.join("weather");
    output(Command::new(bin.join("rohrpost")).args(["new", "weather"]).current_dir(venv))?;
    // The versions that are here already; a build would take a minute.
    copy(&cargo::root().join("Cargo.lock"), &project.join("Cargo.lock"))?;
    let mut resolve = cargo::cargo(&["tree", "--offline"]);
    let resolved = output(resolve.current_dir(&project))?;
    let sources = venv.join("share/rohrpost/src");
    if resolved.contains(&*sources.to_string_lossy()) {
        Ok(())
    } else {
        Err(format!("the project that `rohrpost new` makes does not use {}", sources.display()))
    }
}
