//! Times of traffic, the same for all robots of a team.

/// Times, ns, and how long ways are searched for.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct TrafficSettings {
    /// Between two messages of a robot with nothing new to say.
    pub beat_ns: u64,
    /// A robot that is silent for longer is not heard: it is not asked, and its cells stay closed.
    pub max_age_ns: u64,
    /// Cells of a silent robot are closed for so long; then whether it is there is up to the sensors.
    pub forget_ns: u64,
    /// No message is longer on its way.
    pub delay_max_ns: u64,
    /// No robot goes from the middle of a cell to that of the next one in less.
    pub step_min_ns: u64,
    /// A claim that is not used for so long ends.
    pub claim_ns: u64,
    /// A robot that cannot go on for so long asks all for a new plan.
    pub stall_ns: u64,
    /// Robots plan with what each knows if they do not come to know the same for so long: when some of them hear each
    /// other only through others.
    pub agree_ns: u64,
    /// Robots ask for other goals no sooner after the last plan, so that goals of several robots come together.
    pub extend_ns: u64,
    /// Looks of the search for ways, as in [`plan_ways`](crate::coordination::plan_ways).
    pub looks_max: u32,
}
