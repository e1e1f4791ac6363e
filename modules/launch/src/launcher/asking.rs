//! What a tool asks launch for.

use super::{CHILDREN, ChildState, Children, ControlError, LauncherInterface, NEW_EPOCH, RESTART, START, STOP};
use rohrpost_mailbox::Name;
use rohrpost_modules::call::{CallError, append};
use rohrpost_modules::runtime::ToolLink;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Launch of any node, asked by a tool. The first argument is the name of that launch
/// ([`launcher_of`](super::launcher_of)).
pub trait AskLaunch {
    /// How it stands with all modules that launch watches over, in the order of the configuration.
    ///
    /// ```
    /// # use rohrpost_modules::{call::CallError, runtime::ToolLink};
    /// use rohrpost_launch::launcher::{AskLaunch, Phase};
    ///
    /// fn failed(tool: &mut ToolLink) -> Result<Vec<String>, CallError> {
    ///     let states = tool.children(tool.launcher())?;
    ///     Ok(states.into_iter().filter(|state| state.phase == Phase::Failed).map(|state| state.module).collect())
    /// }
    /// ```
    ///
    /// # Errors
    /// See [`CallError`]; [`CallError::NotSent`] when no launch runs on that node, and this is it.
    fn children(&mut self, launcher: Name) -> Result<Vec<ChildState>, CallError>;

    /// Asks launch to restart a module (`pilot.0`); which of its processes that will be ([`ChildState::lives`]).
    ///
    /// ```
    /// # use rohrpost_modules::{call::CallError, runtime::ToolLink};
    /// # use rohrpost_launch::launcher::{AskLaunch, ControlError};
    /// fn restart(tool: &mut ToolLink) -> Result<(), CallError<ControlError>> {
    ///     let process = tool.restart(tool.launcher(), "pilot.0")?;
    ///     println!("process {process} of pilot.0 begins");
    ///     Ok(())
    /// }
    /// ```
    ///
    /// # Errors
    /// See [`CallError`] and [`ControlError`].
    fn restart(&mut self, launcher: Name, module: &str) -> Result<u32, CallError<ControlError>>;

    /// Asks launch to stop a module.
    ///
    /// ```
    /// # use rohrpost_modules::{call::CallError, runtime::ToolLink};
    /// # use rohrpost_launch::launcher::{AskLaunch, ControlError};
    /// fn stop(tool: &mut ToolLink) -> Result<(), CallError<ControlError>> {
    ///     tool.stop(tool.launcher(), "pilot.0")
    /// }
    /// ```
    ///
    /// # Errors
    /// See [`CallError`] and [`ControlError`].
    fn stop(&mut self, launcher: Name, module: &str) -> Result<(), CallError<ControlError>>;

    /// Asks launch to start a module; which of its processes that will be ([`ChildState::lives`]).
    ///
    /// ```
    /// # use rohrpost_modules::{call::CallError, runtime::ToolLink};
    /// # use rohrpost_launch::launcher::{AskLaunch, ControlError};
    /// fn start(tool: &mut ToolLink) -> Result<u32, CallError<ControlError>> {
    ///     tool.start(tool.launcher(), "pilot.0")
    /// }
    /// ```
    ///
    /// # Errors
    /// See [`CallError`] and [`ControlError`].
    fn start(&mut self, launcher: Name, module: &str) -> Result<u32, CallError<ControlError>>;

    /// Begins to have a module restarted, and returns at once; [`Link::poll_for`] has the answer, a `Result` of what
    /// [`AskLaunch::restart`] returns.
    ///
    /// # Errors
    /// See [`CallError`].
    ///
    /// [`Link::poll_for`]: rohrpost_modules::call::Link::poll_for
    fn begin_restart(&mut self, launcher: Name, module: &str) -> Result<u32, CallError>;

    /// Asks launch to begin a new epoch of its node's time, at its computer's clock; the number of the epoch.
    ///
    /// ```
    /// # use rohrpost_modules::{call::CallError, runtime::ToolLink};
    /// # use rohrpost_launch::launcher::{AskLaunch, ControlError};
    /// fn the_clock_is_right_now(tool: &mut ToolLink) -> Result<u64, CallError<ControlError>> {
    ///     tool.new_epoch(tool.launcher())
    /// }
    /// ```
    ///
    /// # Errors
    /// See [`CallError`] and [`ControlError`].
    fn new_epoch(&mut self, launcher: Name) -> Result<u64, CallError<ControlError>>;
}

impl AskLaunch for ToolLink {
    fn children(&mut self, launcher: Name) -> Result<Vec<ChildState>, CallError> {
        let mut states = Vec::new();
        loop {
            let first = states.len() as u16;
            let page: Children = ask(self, launcher, CHILDREN, &(first,))?;
            let more = !page.states.is_empty();
            states.extend(page.states);
            if !more || states.len() >= usize::from(page.total) {
                return Ok(states);
            }
        }
    }

    fn restart(&mut self, launcher: Name, module: &str) -> Result<u32, CallError<ControlError>> {
        order(self, launcher, RESTART, &(module,))
    }

    fn stop(&mut self, launcher: Name, module: &str) -> Result<(), CallError<ControlError>> {
        order(self, launcher, STOP, &(module,))
    }

    fn start(&mut self, launcher: Name, module: &str) -> Result<u32, CallError<ControlError>> {
        order(self, launcher, START, &(module,))
    }

    fn begin_restart(&mut self, launcher: Name, module: &str) -> Result<u32, CallError> {
        begin(self, launcher, RESTART, &(module,))
    }

    fn new_epoch(&mut self, launcher: Name) -> Result<u64, CallError<ControlError>> {
        order(self, launcher, NEW_EPOCH, &())
    }
}

/// Asks for what launch may refuse.
fn order<T: DeserializeOwned>(
    tool: &mut ToolLink,
    launcher: Name,
    function: u16,
    arguments: &impl Serialize,
) -> Result<T, CallError<ControlError>> {
    let result: Result<T, ControlError> = ask(tool, launcher, function, arguments).map_err(CallError::widen)?;
    result.map_err(|error| CallError::Module(launcher, error))
}

fn ask<T: DeserializeOwned>(
    tool: &mut ToolLink,
    launcher: Name,
    function: u16,
    arguments: &impl Serialize,
) -> Result<T, CallError> {
    let call = begin(tool, launcher, function, arguments)?;
    tool.link.wait(call, |bytes| postcard::from_bytes(bytes))
}

fn begin(tool: &mut ToolLink, launcher: Name, function: u16, arguments: &impl Serialize) -> Result<u32, CallError> {
    let write = |body: &mut Vec<u8>| append(body, arguments);
    tool.begin(launcher, function, LauncherInterface::hash(), write)
}
