//! What a tool asks launch for.

use super::{CHILDREN, ChildState, Children, ControlError, LauncherInterface, NEW_EPOCH, RESTART, START, STOP};
use crate::call::{CallError, append};
use crate::runtime::ToolLink;
use rohrpost_mailbox::Name;
use serde::Serialize;

/// Launch of any node, asked by a tool. The first argument is the name of that launch
/// ([`launcher_of`](super::launcher_of)).
impl ToolLink {
    /// How it stands with all modules that launch watches over, in the order of the configuration.
    ///
    /// ```
    /// # use rohrpost_modules::{call::CallError, runtime::ToolLink};
    /// fn failed(tool: &mut ToolLink) -> Result<Vec<String>, CallError> {
    ///     use rohrpost_modules::launcher::Phase;
    ///
    ///     let states = tool.children(tool.launcher())?;
    ///     Ok(states.into_iter().filter(|state| state.phase == Phase::Failed).map(|state| state.module).collect())
    /// }
    /// ```
    ///
    /// # Errors
    /// See [`CallError`]; [`CallError::NotSent`] when no launch runs on that node, and this is it.
    pub fn children(&mut self, launcher: Name) -> Result<Vec<ChildState>, CallError> {
        let mut states = Vec::new();
        loop {
            let first = states.len() as u16;
            let page: Children = self.ask_launch(launcher, CHILDREN, &(first,))?;
            let more = !page.states.is_empty();
            states.extend(page.states);
            if !more || states.len() >= usize::from(page.total) {
                return Ok(states);
            }
        }
    }

    /// Asks launch to restart a module (`pilot.0`); which of its processes that will be ([`ChildState::lives`]).
    ///
    /// ```
    /// # use rohrpost_modules::{call::CallError, launcher::ControlError, runtime::ToolLink};
    /// fn restart(tool: &mut ToolLink) -> Result<(), CallError<ControlError>> {
    ///     let process = tool.restart(tool.launcher(), "pilot.0")?;
    ///     println!("process {process} of pilot.0 begins");
    ///     Ok(())
    /// }
    /// ```
    ///
    /// # Errors
    /// See [`CallError`] and [`ControlError`].
    pub fn restart(&mut self, launcher: Name, module: &str) -> Result<u32, CallError<ControlError>> {
        self.order(launcher, RESTART, module)
    }

    /// Asks launch to stop a module.
    ///
    /// ```
    /// # use rohrpost_modules::{call::CallError, launcher::ControlError, runtime::ToolLink};
    /// fn stop(tool: &mut ToolLink) -> Result<(), CallError<ControlError>> {
    ///     tool.stop(tool.launcher(), "pilot.0")
    /// }
    /// ```
    ///
    /// # Errors
    /// See [`CallError`] and [`ControlError`].
    pub fn stop(&mut self, launcher: Name, module: &str) -> Result<(), CallError<ControlError>> {
        self.order(launcher, STOP, module)
    }

    /// Asks launch to start a module; which of its processes that will be ([`ChildState::lives`]).
    ///
    /// ```
    /// # use rohrpost_modules::{call::CallError, launcher::ControlError, runtime::ToolLink};
    /// fn start(tool: &mut ToolLink) -> Result<u32, CallError<ControlError>> {
    ///     tool.start(tool.launcher(), "pilot.0")
    /// }
    /// ```
    ///
    /// # Errors
    /// See [`CallError`] and [`ControlError`].
    pub fn start(&mut self, launcher: Name, module: &str) -> Result<u32, CallError<ControlError>> {
        self.order(launcher, START, module)
    }

    /// Begins to have a module restarted, and returns at once; [`Link::poll_for`] has the answer, a `Result` of what
    /// [`ToolLink::restart`] returns.
    ///
    /// # Errors
    /// See [`CallError`].
    ///
    /// [`Link::poll_for`]: crate::call::Link::poll_for
    pub fn begin_restart(&mut self, launcher: Name, module: &str) -> Result<u32, CallError> {
        self.begin_asking(launcher, RESTART, &(module,))
    }

    /// Asks launch to begin a new epoch of its node's time, at its computer's clock; the number of the epoch.
    ///
    /// ```
    /// # use rohrpost_modules::{call::CallError, launcher::ControlError, runtime::ToolLink};
    /// fn the_clock_is_right_now(tool: &mut ToolLink) -> Result<u64, CallError<ControlError>> {
    ///     tool.new_epoch(tool.launcher())
    /// }
    /// ```
    ///
    /// # Errors
    /// See [`CallError`] and [`ControlError`].
    pub fn new_epoch(&mut self, launcher: Name) -> Result<u64, CallError<ControlError>> {
        self.told(launcher, NEW_EPOCH, &())
    }

    fn order<T: serde::de::DeserializeOwned>(
        &mut self,
        launcher: Name,
        function: u16,
        module: &str,
    ) -> Result<T, CallError<ControlError>> {
        self.told(launcher, function, &(module,))
    }

    fn told<T: serde::de::DeserializeOwned>(
        &mut self,
        launcher: Name,
        function: u16,
        arguments: &impl Serialize,
    ) -> Result<T, CallError<ControlError>> {
        let result: Result<T, ControlError> =
            self.ask_launch(launcher, function, arguments).map_err(CallError::widen)?;
        result.map_err(|error| CallError::Module(launcher, error))
    }

    fn ask_launch<T: serde::de::DeserializeOwned>(
        &mut self,
        launcher: Name,
        function: u16,
        arguments: &impl Serialize,
    ) -> Result<T, CallError> {
        let call = self.begin_asking(launcher, function, arguments)?;
        self.link.wait(call, |bytes| postcard::from_bytes(bytes))
    }

    fn begin_asking(&mut self, launcher: Name, function: u16, arguments: &impl Serialize) -> Result<u32, CallError> {
        let write = |body: &mut Vec<u8>| append(body, arguments);
        self.begin(launcher, function, LauncherInterface::hash(), write)
    }
}
