//! The functions that all modules have, as a tool calls them.

use super::{ToolLink, describe};
use crate::call::CallError;
use crate::common::{
    self, Change, Exchange, ExchangePage, OutputLevel, ParameterPage, SetParameters, Status, TimeReport,
};
use crate::parameter::{Parameter, Refusal};
use rohrpost_mailbox::Name;
use rohrpost_schema::Description;

/// Most parameters of a module that are asked for.
const PARAMETERS_MAX: u16 = 1024;
/// Times that parameters are read anew because they were set meanwhile.
const READS_MAX: usize = 5;

impl ToolLink {
    /// Switches a module on or off.
    ///
    /// ```
    /// # use rohrpost_modules::{call::CallError, runtime::ToolLink};
    /// # use rohrpost_mailbox::Name;
    /// fn restart_work(tool: &mut ToolLink, module: Name) -> Result<(), CallError> {
    ///     tool.switch(module, false)?;
    ///     tool.switch(module, true)
    /// }
    /// ```
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn switch(&mut self, module: Name, on: bool) -> Result<(), CallError> {
        self.common(module, if on { common::ON } else { common::OFF }, &())
    }

    /// Begins to switch a module on or off, and returns at once; [`Link::poll`](crate::call::Link::poll) tells how it
    /// went.
    ///
    /// ```
    /// # use rohrpost_modules::{call::CallError, runtime::ToolLink};
    /// # use rohrpost_mailbox::Name;
    /// fn all_off(tool: &mut ToolLink, modules: &[Name]) -> Result<(), CallError> {
    ///     let begin = |module: &Name| tool.begin_switch(*module, false);
    ///     let begun = modules.iter().map(begin).collect::<Result<Vec<u32>, CallError>>()?;
    ///     begun.into_iter().try_for_each(|call| tool.link.wait(call, |_| Ok(())))
    /// }
    /// ```
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn begin_switch(&mut self, module: Name, on: bool) -> Result<u32, CallError> {
        self.begin(module, if on { common::ON } else { common::OFF }, common::HASH, |_| Ok(()))
    }

    /// Asks a module how it is.
    ///
    /// ```
    /// # use rohrpost_modules::{call::CallError, runtime::ToolLink};
    /// # use rohrpost_mailbox::Name;
    /// use rohrpost_modules::common::State;
    ///
    /// fn is_on(tool: &mut ToolLink, module: Name) -> Result<bool, CallError> {
    ///     Ok(tool.status(module)?.state == State::On)
    /// }
    /// ```
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn status(&mut self, module: Name) -> Result<Status, CallError> {
        self.common(module, common::STATUS, &())
    }

    /// Asks a module for system time as its node has it.
    ///
    /// ```
    /// # use rohrpost_modules::{call::CallError, runtime::ToolLink};
    /// # use rohrpost_mailbox::Name;
    /// fn error_s(tool: &mut ToolLink, module: Name) -> Result<f64, CallError> {
    ///     Ok(tool.time(module)?.error_ns as f64 / 1e9)
    /// }
    /// ```
    ///
    /// # Errors
    /// See [`CallError`]. A module built before there was this function says [`crate::call::Fault::Unknown`].
    pub fn time(&mut self, module: Name) -> Result<TimeReport, CallError> {
        self.common(module, common::TIME, &())
    }

    /// Asks a module what came of its exchange with others: the data that it follows, then those that it has called.
    ///
    /// ```
    /// # use rohrpost_modules::{call::CallError, runtime::ToolLink};
    /// # use rohrpost_mailbox::Name;
    /// fn lost(tool: &mut ToolLink, module: Name) -> Result<u64, CallError> {
    ///     Ok(tool.exchange(module)?.iter().map(|exchange| exchange.lost).sum())
    /// }
    /// ```
    ///
    /// # Errors
    /// See [`CallError`]. A module built before there was this function says [`crate::call::Fault::Unknown`].
    pub fn exchange(&mut self, module: Name) -> Result<Vec<Exchange>, CallError> {
        let mut all = Vec::new();
        loop {
            let page: ExchangePage = self.common(module, common::EXCHANGE, &(all.len() as u16,))?;
            let last = page.exchanges.is_empty();
            all.extend(page.exchanges);
            if all.len() >= usize::from(page.total) || last {
                return Ok(all);
            }
        }
    }

    /// Sets which output lines a module sends, and tells which it sent before; none when nothing collects them.
    ///
    /// ```
    /// # use rohrpost_modules::{call::CallError, runtime::ToolLink};
    /// # use rohrpost_mailbox::Name;
    /// use rohrpost_modules::common::OutputLevel;
    ///
    /// fn say_more(tool: &mut ToolLink, module: Name) -> Result<Option<OutputLevel>, CallError> {
    ///     tool.output_level(module, OutputLevel::Debug)
    /// }
    /// ```
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn output_level(&mut self, module: Name, level: OutputLevel) -> Result<Option<OutputLevel>, CallError> {
        self.common(module, common::OUTPUT_LEVEL, &(level,))
    }

    /// Asks a module what it offers.
    ///
    /// ```
    /// # use rohrpost_modules::{call::CallError, runtime::ToolLink};
    /// # use rohrpost_mailbox::Name;
    /// fn functions(tool: &mut ToolLink, module: Name) -> Result<Vec<String>, CallError> {
    ///     Ok(tool.describe(module)?.functions.into_iter().map(|function| function.name).collect())
    /// }
    /// ```
    ///
    /// # Errors
    /// See [`CallError`].
    pub fn describe(&mut self, module: Name) -> Result<Description, CallError> {
        describe(&mut self.link, module, self.timeout)
    }

    /// Asks a module for its parameters and their values; empty, if it has none.
    ///
    /// ```
    /// # use rohrpost_modules::{call::CallError, runtime::ToolLink};
    /// # use rohrpost_mailbox::Name;
    /// fn names(tool: &mut ToolLink, module: Name) -> Result<Vec<String>, CallError> {
    ///     Ok(tool.parameters(module)?.into_iter().map(|parameter| parameter.field.name).collect())
    /// }
    /// ```
    ///
    /// # Errors
    /// See [`CallError`]. A module built before there were parameters says [`crate::call::Fault::Unknown`].
    pub fn parameters(&mut self, module: Name) -> Result<Vec<Parameter>, CallError> {
        let mut found = Vec::new();
        let mut changes = None;
        let mut reads = 0;
        loop {
            let from = found.len() as u16;
            let page: ParameterPage = self.common(module, common::PARAMETERS, &(from,))?;
            // What it says of itself is a claim.
            if page.total > PARAMETERS_MAX {
                let text = format!("its {} parameters are more than {PARAMETERS_MAX}", page.total);
                return Err(CallError::BadReply(module, text));
            }
            // Somebody set some in between: values of one moment belong together.
            if changes.replace(page.changes).is_some_and(|before| before != page.changes) && reads < READS_MAX {
                reads += 1;
                found.clear();
                changes = None;
                continue;
            }
            let last = page.parameters.is_empty();
            found.extend(page.parameters);
            if found.len() >= usize::from(page.total) || last {
                return Ok(found);
            }
        }
    }

    /// Sets parameters of a module, all of them or none; returns what they were and are.
    ///
    /// ```
    /// # use rohrpost_modules::{call::CallError, parameter::Refusal, runtime::ToolLink};
    /// # use rohrpost_mailbox::Name;
    /// use rohrpost_modules::common::SetParameters;
    ///
    /// fn slow_down(tool: &mut ToolLink, module: Name) -> Result<(), CallError<Refusal>> {
    ///     let values = vec![("cruise-m-s".to_owned(), 0.2_f64.to_le_bytes().to_vec())];
    ///     tool.set_parameters(module, &SetParameters { values, only_check: false })?;
    ///     Ok(())
    /// }
    /// ```
    ///
    /// # Errors
    /// See [`CallError`] and [`Refusal`].
    pub fn set_parameters(&mut self, module: Name, wish: &SetParameters) -> Result<Vec<Change>, CallError<Refusal>> {
        let set: Result<_, Refusal> = self.common(module, common::SET_PARAMETERS, wish).map_err(CallError::widen)?;
        set.map_err(|refusal| CallError::Module(module, refusal))
    }
}
