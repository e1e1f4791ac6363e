//! A node of its own for each test.

use crate::{eye, seer};
use rohrpost_config::Installation;
use rohrpost_mailbox::{Name, Node, node_directory};
use rohrpost_modules::runtime::{Start, StartError, ToolLink};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

pub(crate) const PATIENCE: Duration = Duration::from_secs(60);

const CONFIG: &str = r#"
installation = "native-NUMBER"
[system]
name = "robot"
id = 1
[classes]
eye = { id = 150, text = "Sees" }
seer = { id = 110, text = "Looks" }
tool = { id = 16, text = "By hand" }
[nodes.main]
[[module]]
name = "eye.0"
program = "eye"
optional = true
settings = { SETTINGS }
[module.stream.picture]
record = "64 KiB"
[[module]]
name = "seer.0"
program = "seer"
optional = true
calls = ["eye.0"]
"#;

pub(crate) struct Place {
    installation: Arc<Installation>,
    node: Arc<Node>,
    path: PathBuf,
    _directory: tempfile::TempDir,
}

impl Place {
    /// With these settings of the eye.
    pub(crate) fn new(settings: &str) -> Self {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = format!("{}-{}", std::process::id(), NUMBER.fetch_add(1, Ordering::Relaxed));
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("robot.toml");
        std::fs::write(&file, CONFIG.replace("NUMBER", &number).replace("SETTINGS", settings)).unwrap();
        let installation = Arc::new(Installation::load(&file).unwrap_or_else(|errors| panic!("{errors}")));
        let path = node_directory(&installation.name, "main");
        let node = Node::create(&path, 0o700).unwrap();
        Self { installation, node, path, _directory: directory }
    }

    pub(crate) fn name(&self, module: &str) -> Name {
        self.installation.classes.parse_module(module).unwrap()
    }

    fn started(&self, module: &str) -> Start {
        let name = self.name(module);
        Start { installation: self.installation.clone(), name, launcher: None, restarts: 0, off: false }
    }

    /// Runs the eye here, until it ends.
    pub(crate) fn run_eye(&self) -> Result<(), StartError> {
        rohrpost_native::run(self.started("eye.0"), eye::interface(), eye::Eye::make)
    }

    pub(crate) fn start_eye(&self) {
        let start = self.started("eye.0");
        std::thread::spawn(move || rohrpost_native::run(start, eye::interface(), eye::Eye::make));
    }

    /// What it sees.
    pub(crate) fn start_seer(&self) -> Receiver<seer::Seen> {
        let (start, (seen, sees)) = (self.started("seer.0"), channel());
        let make = move || rohrpost_native::run(start, seer::interface(), |context| seer::Seer::make(context, seen));
        std::thread::spawn(make);
        sees
    }

    pub(crate) fn tool(&self) -> ToolLink {
        ToolLink::join(&self.installation, &self.node, "main", Duration::from_secs(10)).unwrap()
    }

    pub(crate) fn wait_until<T>(&self, what: &str, mut look: impl FnMut() -> Option<T>) -> T {
        let began = Instant::now();
        loop {
            if let Some(found) = look() {
                return found;
            }
            assert!(began.elapsed() < PATIENCE, "waited in vain: {what}");
        }
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.path);
    }
}
