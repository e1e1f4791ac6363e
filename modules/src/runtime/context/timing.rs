//! When a module is called by itself, and the command that it runs.

use super::super::running_command::RunningCommand;
use super::super::schedule::WakeUp;
use super::Context;
use crate::journal::{Question, Tag, nanoseconds};
use std::time::Duration;

impl Context {
    /// Asks for [`crate::Module::tick`] once in this time, from now on; at least 10 µs, at most a day. Ticks that come
    /// too late because the one before took too long are left out.
    ///
    /// Where time is simulated or replayed, this is that time: at ten times the pace there are ten times as many ticks
    /// a second, and none while it stands still.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::Context;
    /// fn tick_at_50_hz(context: &mut Context) {
    ///     context.set_period(std::time::Duration::from_millis(20));
    /// }
    /// ```
    pub fn set_period(&mut self, period: Duration) {
        self.journal.asked(Tag::Ticking, Question::Period(nanoseconds(period)));
        self.schedule.set_period(period);
    }

    /// One more tick at a moment of the monotonic clock ([`ModuleClock::monotonic_ns`]): to keep, and to set wherever a
    /// deadline becomes known.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::Context;
    /// fn tick_in_a_second(context: &Context) {
    ///     context.wake_up().at(Some(context.clock().monotonic_ns() + 1_000_000_000));
    /// }
    /// ```
    pub fn wake_up(&self) -> WakeUp {
        self.schedule.wake_up()
    }

    /// The sender and age of the command that is being run: to keep, and to ask in the functions of an interface.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::{Context, RunningCommand};
    /// struct Motor {
    ///     command: RunningCommand,
    /// }
    ///
    /// impl Motor {
    ///     fn new(context: &Context) -> Self {
    ///         Self { command: context.running_command() }
    ///     }
    ///
    ///     fn drive(&mut self) -> bool {
    ///         self.command.get().age_ns < 50_000_000
    ///     }
    /// }
    /// ```
    pub fn running_command(&self) -> RunningCommand {
        self.running_command.clone()
    }

    /// Ticks, and periods of the data that it publishes, go by the computer's clock, also where time is simulated or
    /// replayed: for a module that serves the computer and not the robot, such as a router or a display. To be called
    /// in [`crate::Module::new`]: periods of earlier subscriptions would not be moved.
    ///
    /// ```
    /// # use rohrpost_modules::runtime::Context;
    /// fn look_at_the_disk_each_second(context: &mut Context) {
    ///     context.use_computer_clock();
    ///     context.set_period(std::time::Duration::from_secs(1));
    /// }
    /// ```
    pub fn use_computer_clock(&mut self) {
        self.schedule.use_computer_clock();
    }
}
