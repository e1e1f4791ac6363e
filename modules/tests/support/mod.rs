//! What tests of modules share: a node with its configuration, and modules on threads or in processes of their own.

use rohrpost_config::Installation;
use rohrpost_mailbox::{Name, Node, node_directory};
use rohrpost_modules::Module;
use rohrpost_modules::call::Caller;
use rohrpost_modules::common::State;
use rohrpost_modules::interface::Proxy;
use rohrpost_modules::runtime::{Start, ToolLink, run_started};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// The longest that anything may take.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// A node with its configuration; removed when dropped.
pub struct Place {
    /// The configuration of the node.
    pub installation: Arc<Installation>,
    /// The node `main`.
    pub node: Arc<Node>,
    _directory: tempfile::TempDir,
}

impl Place {
    /// With this configuration, in which NUMBER becomes one that no other place has, and these files beside it.
    pub fn new(config: &str, files: &[(&str, &[u8])]) -> Self {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = format!("{}-{}", std::process::id(), NUMBER.fetch_add(1, Ordering::Relaxed));
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("robot.toml");
        std::fs::write(&file, config.replace("NUMBER", &number)).unwrap();
        for (name, bytes) in files {
            std::fs::write(directory.path().join(name), bytes).unwrap();
        }
        let installation = Arc::new(Installation::load(&file).unwrap_or_else(|errors| panic!("{errors}")));
        let node = Node::create(&node_directory(&installation.name, "main"), 0o700).unwrap();
        Self { installation, node, _directory: directory }
    }

    /// The name of a module.
    pub fn name(&self, module: &str) -> Name {
        self.installation.classes.parse_module(module).unwrap()
    }

    /// What a module here starts with.
    pub fn start_of(&self, name: Name) -> Start {
        Start { installation: self.installation.clone(), name, launcher: None, restarts: 0, off: false }
    }

    /// Waits until a module is on; meanwhile this looks whether it still can be.
    pub fn wait_until_on(&self, name: Name, mut look: impl FnMut()) {
        let mut tool = self.tool();
        wait("it does not start", || {
            look();
            tool.status(name).ok().filter(|status| status.state == State::On)
        });
        tool.close();
    }

    /// A tool of this node.
    pub fn tool(&self) -> ToolLink {
        ToolLink::join(&self.installation, &self.node, "main", Duration::from_secs(10)).unwrap()
    }

    /// A link that proxies are made of.
    pub fn caller(&self) -> Caller {
        self.tool().link.into()
    }

    /// Calls a module, as a tool of its own.
    pub fn proxy<P: Proxy>(&self, module: &str) -> P {
        P::new(&self.caller(), self.name(module))
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(self.node.path());
    }
}

/// Waits until there is something.
pub fn wait<R>(what: &str, mut look: impl FnMut() -> Option<R>) -> R {
    let began = Instant::now();
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(began.elapsed() < PATIENCE, "{what}");
        std::thread::yield_now();
    }
}

/// A process of its own that runs one test of this program, which plays a module with this configuration.
pub fn process(test: &str, file: &Path) -> Child {
    Command::new(std::env::current_exe().unwrap())
        .args(["--exact", test, "--test-threads=1"])
        .env("ROHRPOST_TEST_CONFIG", file)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .spawn()
        .unwrap()
}

/// Plays this module, in such a process only.
pub fn play<M: Module>(module: &str) {
    let Ok(file) = std::env::var("ROHRPOST_TEST_CONFIG") else { return };
    let words = ["--config", &file, "--name", module].map(String::from);
    run_started::<M>(Start::from_arguments(words.into_iter()).unwrap()).unwrap();
}
