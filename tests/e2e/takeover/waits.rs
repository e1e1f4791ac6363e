//! How long what brings a router back has waited for a processor.
//!
//! Launch has no real time, and neither has a router before it gives itself some: beside other programs they take
//! turns. The kernel counts for each thread how long it was ready and did not run (`schedstat`), so a return that is
//! late is explained by that, and by no more than that.

use std::time::Duration;

/// The processes above a router, which start it again and tell when it is there: their ids, and how long the first
/// thread of each had waited.
#[derive(Clone)]
pub(super) struct Waits(Vec<(u32, Duration)>);

impl Waits {
    /// Of the router with this id, up to this test.
    pub(super) fn above(router: u32) -> Self {
        let own = std::process::id();
        let above = std::iter::successors(parent(router), |pid| parent(*pid)).take_while(|pid| *pid != own && *pid > 1);
        Self(above.map(|pid| (pid, waited(pid))).collect())
    }

    /// How long they have waited since, and the router's successor since its beginning.
    pub(super) fn until_it_is_back(&self, router: u32) -> Duration {
        let above = self.0.iter().map(|(pid, before)| waited(*pid).saturating_sub(*before));
        above.sum::<Duration>() + waited(router)
    }
}

/// None of a process that is gone.
fn parent(pid: u32) -> Option<u32> {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
    status.lines().find_map(|line| line.strip_prefix("PPid:"))?.trim().parse().ok()
}

/// How long the first thread of a process was ready without running; nothing for one that is gone.
fn waited(pid: u32) -> Duration {
    let told = std::fs::read_to_string(format!("/proc/{pid}/schedstat")).unwrap_or_default();
    Duration::from_nanos(told.split_whitespace().nth(1).and_then(|ns| ns.parse().ok()).unwrap_or(0))
}

#[test]
fn what_a_thread_waits_for_a_processor_is_counted_for_its_parents_and_itself() {
    let own = std::process::id();
    let mut child = std::process::Command::new("sleep").arg("60").spawn().unwrap();
    assert_eq!(Waits::above(child.id()).0, [], "this test is above it, and no more");
    assert_eq!(parent(child.id()), Some(own));
    let waits = Waits(vec![(own, Duration::ZERO)]);
    let all = || waited(own) + waited(child.id());
    let (before, both, behind) = (all(), waits.until_it_is_back(child.id()), all());
    assert!(before > Duration::ZERO && before <= both && both <= behind, "{before:?}, {both:?}, {behind:?}");
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(waited(child.id()), Duration::ZERO, "it is gone");
}
