//! A place where bundles are made, and nodes that receive them.

use rohrpost_bundle::{
    Bundle, FilePath, FolderSource, Ingredient, NodeFolder, ReceiveError, Received, Recipe, SECRET_FILE, SigningKey,
    make,
};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tempfile::TempDir;

pub(crate) const CONFIGURATION: &str = "robot.toml";
pub(crate) const PROGRAM: &str = "bin/pilot";
pub(crate) const MAP: &str = "maps/house.map";

pub(crate) struct Workshop {
    folder: TempDir,
    pub(crate) key: SigningKey,
}

impl Workshop {
    pub(crate) fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let key = SigningKey::create(&folder.path().join("keys")).unwrap();
        Self { folder, key }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The next version of a bundle: a program that says `says`, a configuration and a map.
    pub(crate) fn make(&self, says: &str) -> Bundle {
        self.make_for("test", says, &self.path("bundles")).unwrap()
    }

    pub(crate) fn make_for(
        &self,
        installation: &str,
        says: &str,
        folder: &Path,
    ) -> Result<Bundle, rohrpost_bundle::MakeError> {
        let contents =
            [(CONFIGURATION, "[nodes]".to_owned()), (PROGRAM, format!("echo {says}")), (MAP, "#".repeat(99))];
        let files = contents.map(|(path, content)| {
            let (source, path) = (self.path(path), FilePath::parse(path).unwrap());
            fs::create_dir_all(source.parent().unwrap()).unwrap();
            fs::write(&source, content).unwrap();
            Ingredient { path, source }
        });
        fs::set_permissions(self.path(PROGRAM), PermissionsExt::from_mode(0o700)).unwrap();
        let recipe = Recipe {
            installation: installation.into(),
            version: None,
            trial: Duration::from_secs(30),
            configuration: FilePath::parse(CONFIGURATION).unwrap(),
            files: files.to_vec(),
        };
        make(&recipe, &self.key, folder)
    }

    /// A node that trusts the key of this workshop.
    pub(crate) fn node(&self, name: &str) -> NodeFolder {
        let root = self.path(name);
        fs::create_dir_all(root.join("trusted")).unwrap();
        fs::copy(self.path("keys").join(SECRET_FILE).with_extension("pub"), root.join("trusted/ours.pub")).unwrap();
        NodeFolder::new(root)
    }
}

pub(crate) fn push(node: &NodeFolder, bundle: &Bundle) -> Result<Received, ReceiveError> {
    node.receive(&mut FolderSource(bundle))
}

/// Version of what the node has, all of which is right; 0 without a bundle.
#[track_caller]
pub(crate) fn current(node: &NodeFolder) -> u64 {
    if !node.path().join("current").is_symlink() {
        return 0;
    }
    let report = node.report().unwrap();
    assert_eq!(report.problems, [""; 0]);
    report.version
}
