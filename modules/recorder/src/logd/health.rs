//! Tells what goes wrong with a recording: once when it begins, and when it is over.

use rohrpost::output::errno_of;
use rohrpost_recording::{DiskError, Losses, Status};
use std::mem::{Discriminant, discriminant};
use std::time::{Duration, Instant};

/// Losses are told at most so often.
const LOSSES: Duration = Duration::from_secs(10);

/// What was told.
#[derive(Default)]
pub(super) struct Health {
    /// Which kind of error, while it lasts.
    problem: Option<Discriminant<DiskError>>,
    /// The first of that kind in words, since each try may name another file; empty: there is none.
    complaint: String,
    /// Messages lost when it began.
    lost_before: u64,
    /// Messages lost that were told.
    lost_told: Losses,
    /// When they were.
    told_at: Option<Instant>,
}

impl Health {
    /// Tells what is new.
    pub(super) fn tell(&mut self, status: &Status, now: Instant) {
        let problem = status.problem.as_ref().map(|problem| &problem.error);
        match problem {
            Some(error) if self.problem != Some(discriminant(error)) => {
                self.complaint = format!("records nothing: {error}");
                tracing::error!(errno = errno_of(error), "records nothing: {error}; tries again every second");
                if self.problem.is_none() {
                    self.lost_before = status.lost;
                }
            }
            None if self.problem.is_some() => {
                let lost = status.lost - self.lost_before;
                tracing::warn!("records again; {lost} messages were lost meanwhile");
                (self.lost_told, self.told_at) = (status.losses, Some(now));
            }
            _ => self.losses(status, now),
        }
        self.problem = problem.map(discriminant);
        if self.problem.is_none() {
            self.complaint.clear();
        }
    }

    /// What is wrong with it now.
    pub(super) fn complaint(&self) -> &str {
        &self.complaint
    }

    /// Those while the disk takes what it is given.
    fn losses(&mut self, status: &Status, now: Instant) {
        let is_early = self.told_at.is_some_and(|told| now < told + LOSSES);
        let new = status.losses.since(&self.lost_told);
        if status.problem.is_some() || is_early || new == Losses::default() {
            return;
        }
        let most = status.channels.iter().max_by_key(|channel| channel.lost).map_or("", |channel| &channel.topic);
        tracing::warn!(
            "{} messages were lost, most so far of {most}: {} (`channels` of the recorder counts them)",
            new.all(),
            new.text()
        );
        (self.lost_told, self.told_at) = (status.losses, Some(now));
    }
}
