//! What the wormhole tells: counts, lines of output, and its state.

use rohrpost_config::ClassTable;
use rohrpost_mailbox::Name;
use rohrpost_modules::call::CallError;
use rohrpost_modules::interfaces::{CauseCount, ControlDriver, ControlMode, ControlState, HeldHalt};
use rohrpost_supervision::{Capped, Driver, Mode, Refusal, Verdict, Why, Wormhole};

/// What was counted, and what was told last.
pub(super) struct Told {
    classes: ClassTable,
    pub(super) late_looks: u64,
    checked: u64,
    gained: u64,
    lost: u64,
    restarts: u64,
    refusals: [u64; Refusal::ALL.len()],
    capped: [u64; Why::ALL.len()],
    refused: [u64; Why::ALL.len()],
    motor: Option<String>,
    drives_itself: bool,
    last: ControlState,
}

impl Told {
    pub(super) fn new(classes: ClassTable) -> Self {
        Self {
            classes,
            late_looks: 0,
            checked: 0,
            gained: 0,
            lost: 0,
            restarts: 0,
            refusals: Default::default(),
            capped: Default::default(),
            refused: Default::default(),
            motor: None,
            drives_itself: false,
            last: ControlState::default(),
        }
    }

    pub(super) fn checked(&mut self, verdict: Verdict) {
        self.checked += 1;
        match verdict {
            Verdict::Passed(_) => {}
            Verdict::Capped(Capped { why, .. }) => add(&mut self.capped, &Why::ALL, why),
            Verdict::Refused(why) => add(&mut self.refused, &Why::ALL, why),
        }
    }

    pub(super) fn refused(&mut self, refusal: Refusal) {
        add(&mut self.refusals, &Refusal::ALL, refusal);
    }

    pub(super) fn gained(&mut self) {
        self.gained += 1;
        tracing::info!("the driver has control");
    }

    pub(super) fn lost(&mut self) {
        self.lost += 1;
        tracing::warn!("the driver has lost control; the robot brakes");
    }

    /// Whether the wormhole itself drives, told once.
    pub(super) fn drives_itself(&mut self, drives_itself: bool) {
        match (self.drives_itself, drives_itself) {
            (false, true) => tracing::warn!("drives to the program's last destination"),
            (true, false) => tracing::info!("drives no further itself"),
            _ => {}
        }
        self.drives_itself = drives_itself;
    }

    /// Whether commands go out to the motor, told once.
    pub(super) fn motor(&mut self, trouble: Option<String>) {
        if trouble != self.motor {
            match &trouble {
                Some(error) => tracing::error!("the motor gets no commands: {error}"),
                None => tracing::info!("the motor gets commands again"),
            }
            self.motor = trouble;
        }
    }

    /// `asked`: what came of asking launch; none if the program is not one of this installation.
    pub(super) fn restarted(&mut self, program: &str, asked: Option<Result<(), CallError>>) {
        self.restarts += 1;
        match asked {
            Some(Ok(())) => tracing::warn!("{program} kept no promise; launch is asked to restart it"),
            Some(Err(error)) => tracing::error!("{program} kept no promise, and launch cannot be asked: {error}"),
            None => tracing::error!("{program} kept no promise, and no launch here knows it"),
        }
    }

    pub(super) fn name(&self, name: Name) -> String {
        self.classes.format(name)
    }

    pub(super) fn state(
        &self,
        wormhole: &Wormhole,
        driven_by: String,
        halts: Vec<HeldHalt>,
        sees: bool,
    ) -> ControlState {
        let refusals = counted(&self.refusals, &Refusal::ALL, "promise refused");
        let capped = counted(&self.capped, &Why::ALL, "command capped");
        let refused = counted(&self.refused, &Why::ALL, "command refused");
        ControlState {
            mode: match wormhole.mode() {
                Mode::Disabled => ControlMode::Disabled,
                Mode::Test => ControlMode::Test,
                Mode::Active => ControlMode::Active,
                Mode::Failed => ControlMode::Failed,
            },
            driver: match wormhole.driver() {
                Driver::Program => ControlDriver::Program,
                Driver::Person => ControlDriver::Person,
            },
            driven_by,
            sees,
            halts,
            held_unnamed: wormhole.halts.has_unnamed(),
            drives_itself: self.drives_itself,
            failures: wormhole.failures(),
            restarts: self.restarts,
            gained: self.gained,
            lost: self.lost,
            late_looks: self.late_looks,
            checked: self.checked,
            causes: refusals.chain(capped).chain(refused).collect(),
        }
    }

    /// Whether what is published is another than last time; then this is the last time.
    pub(super) fn is_news(&mut self, state: &ControlState) -> bool {
        let of = |state: &ControlState| {
            let ControlState { mode, driver, sees, ref halts, held_unnamed, drives_itself, .. } = *state;
            (mode, driver, sees, halts.clone(), held_unnamed, drives_itself)
        };
        let is_news = of(&self.last) != of(state);
        if is_news {
            self.last = state.clone();
        }
        is_news
    }
}

/// What `list`, `status` and `top` show of it; empty if somebody may drive.
pub(super) fn complaint(state: &ControlState) -> String {
    match state {
        ControlState { mode: ControlMode::Failed, .. } => {
            "the program failed too often; the robot stands until somebody calls `reset`".into()
        }
        ControlState { halts, held_unnamed, .. } if *held_unnamed || !halts.is_empty() => {
            let mut holders: Vec<&str> = halts.iter().map(|halt| halt.holder.as_str()).collect();
            holders.dedup();
            holders.extend(held_unnamed.then_some("callers without a name here"));
            format!("halted by {}; `rohrpost resume` lets go", holders.join(", "))
        }
        ControlState { sees: false, .. } => "the robot does not see, and stands".into(),
        ControlState { drives_itself: true, .. } => {
            "the program has lost control; the robot drives on without it".into()
        }
        _ => String::new(),
    }
}

fn add<T: PartialEq>(counts: &mut [u64], all: &[T], one: T) {
    counts.iter_mut().zip(all).filter(|(_, known)| **known == one).for_each(|(count, _)| *count += 1);
}

fn counted<'a, T: std::fmt::Display>(
    counts: &'a [u64],
    all: &'a [T],
    what: &'a str,
) -> impl Iterator<Item = CauseCount> + 'a {
    let happened = counts.iter().zip(all).filter(|(count, _)| **count > 0);
    happened.map(move |(count, cause)| CauseCount { cause: format!("{what}: {cause}"), count: *count })
}
