//! The core, beside the model: takes an action, from a reduced state and in a frame.

use super::super::wormhole::state::{CoreState, Frame, TICK_NS, Voice, halt_of};
use super::super::{Change, Command, Control, Order, Promise, Refusal, Wormhole};
use super::action::{Action, Bounds};

/// What the wormhole told in the last step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct Told {
    pub(super) control: Option<Control>,
    /// A restart; whether it names the run that promised last.
    pub(super) restart: Option<bool>,
    pub(super) refusal: Option<Refusal>,
}

/// What a step of the core comes to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Outcome {
    pub(super) core: CoreState,
    pub(super) told: Told,
    pub(super) effect: Option<Voice>,
    /// Whether the wormhole is to be looked at by now; none if nothing is waited for.
    pub(super) is_due: Option<bool>,
}

/// Two frames without anything in common. Numbers of the second one wrap with each step, and its time has more than 32
/// bits and is no whole number of ticks.
pub(super) const PLAIN: Frame = Frame {
    now_ns: 1000 * TICK_NS,
    last: Order { incarnation: 5, sequence: 9 },
    ahead: 1,
    idle_ns: 0,
    idle: Command::STOP,
    forgotten: 0,
};
pub(super) const ODD: Frame = Frame {
    now_ns: (1 << 40) + 7,
    last: Order { incarnation: u32::MAX, sequence: 0x8000_0000 },
    ahead: 0x7fff_ffff,
    idle_ns: u64::MAX,
    idle: Command { speed_m_s: 9.0, turn_rate_rad_s: f64::NAN },
    forgotten: 9,
};

/// The very core takes an action.
pub(super) fn take(wormhole: &mut Wormhole, now_ns: &mut u64, action: &Action, voice: Voice, ahead: u32) -> Outcome {
    let (last_run, none) = (wormhole.last_run(), Change::default());
    let (change, answer) = match *action {
        Action::Tick => {
            *now_ns += TICK_NS;
            (none, Ok(()))
        }
        Action::Look => (wormhole.look(*now_ns), Ok(())),
        Action::Promise(sent) => {
            let order = wormhole.order(sent.driver, sent.run, sent.repeats, ahead);
            let duration_ns = u64::from(sent.duration) * TICK_NS;
            let promise = Promise { order, duration_ns, command: voice.command() };
            wormhole.promise(*now_ns, u64::from(sent.age) * TICK_NS, sent.driver, promise)
        }
        Action::Sight(sees) => (wormhole.set_sight(*now_ns, sees), Ok(())),
        Action::Drive(driver) => (wormhole.set_driver(*now_ns, driver), Ok(())),
        Action::Reset => {
            wormhole.reset(*now_ns);
            (none, Ok(()))
        }
        Action::Halt(by) => {
            wormhole.halts.halt(halt_of(by)).expect("there is room");
            (none, Ok(()))
        }
        Action::Resume(by) => {
            wormhole.halts.resume(halt_of(by));
            (none, Ok(()))
        }
        Action::ResumeAll => {
            wormhole.halts.resume_all();
            (none, Ok(()))
        }
        Action::Die => {
            *wormhole = Wormhole::new(wormhole.settings());
            (none, Ok(()))
        }
        Action::Settle => (none, Ok(())),
    };
    let restart = change.restart.map(|run| Some(run) == last_run);
    Outcome {
        core: wormhole.reduced(*now_ns),
        told: Told { control: change.control, restart, refusal: answer.err() },
        effect: wormhole.in_effect(*now_ns).map(Voice::of),
        is_due: wormhole.due_ns().map(|due_ns| due_ns <= *now_ns),
    }
}

impl Bounds {
    /// The core takes an action from a reduced state, in a frame.
    pub(super) fn take(&self, core: &CoreState, action: &Action, voice: Voice, frame: &Frame) -> Outcome {
        let mut now_ns = frame.now_ns;
        take(&mut frame.wormhole(core, self.settings()), &mut now_ns, action, voice, frame.ahead)
    }

    /// Whether time may pass: not if the caller is as late already as it may be.
    pub(super) fn may_tick(&self, core: &CoreState) -> bool {
        let due = PLAIN.wormhole(core, self.settings()).due_ns();
        due.is_none_or(|due_ns| due_ns + u64::from(self.late) * TICK_NS > PLAIN.now_ns)
    }
}
