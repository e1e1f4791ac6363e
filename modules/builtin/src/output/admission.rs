//! Admits lines sent in the sender's own name, up to its share, and corrects impossible times and loss counts. Knows no
//! clock and no mailbox.

use crate::format::iso;
use rohrpost_config::{Installation, Principal};
use rohrpost_mailbox::{Name, Throttle};
use rohrpost_modules::interfaces::RefusedLines;
use rohrpost_modules::output::OutputLine;
use rohrpost_modules::output::collector_support::{Bucket, LANES, WAITING_LINES, cut};

const SECOND_NS: u64 = 1_000_000_000;
/// How far ahead of the collector's a line's time may be: clocks of nodes differ by less, as long as they have one
/// time.
const AHEAD_MAX_NS: u64 = SECOND_NS;
/// Each refusal is told at most so often.
const TELL_NS: u64 = 5 * SECOND_NS;
/// Nobody is quicker in having a line suppressed.
const SUPPRESSED_EACH_NS: u64 = 10;

/// When a line came.
#[derive(Clone, Copy)]
pub(super) struct Came {
    /// Monotonic, from when the computer started.
    pub(super) mono_ns: u64,
    /// System time.
    pub(super) time_ns: u64,
}

pub(super) struct Admission {
    rate: u32,
    burst: u32,
    /// As many as modules and nodes in the file, twice, and those for names that it does not know.
    writers: Vec<Writer>,
    pub(super) counts: RefusedLines,
    names: Throttle,
    unreadable: Throttle,
}

/// The writer of lines: a principal, by itself or through launch, which passes on what it prints. Each of both ways has
/// an allowance where the lines come from, and so it has here.
struct Writer {
    principal: Principal,
    by_launch: bool,
    share: Bucket,
    /// When its last line came.
    heard_ns: u64,
    beyond: Throttle,
}

/// A line that is not taken; what is to be said of that, if it is time.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct NotTaken(pub(super) Option<String>);

impl Admission {
    /// For modules that may each say so many lines a second, and so many at once.
    pub(super) fn new(rate: u32, burst: u32) -> Self {
        let (names, unreadable) = Default::default();
        Self { rate, burst, writers: Vec::new(), counts: RefusedLines::default(), names, unreadable }
    }

    /// Counts what is no line.
    pub(super) fn unreadable(&mut self, from: Name, now_ns: u64) -> NotTaken {
        self.counts.unreadable += 1;
        let told = self.unreadable.note(now_ns, TELL_NS);
        NotTaken(
            told.map(|lines| format!("{lines} packages are no lines and were dropped, the last of them from {from}")),
        )
    }

    /// Validates a line, and bounds what it claims. Says which principal's share it used.
    pub(super) fn validate(
        &mut self,
        installation: &Installation,
        from: Name,
        line: &mut OutputLine,
        came: Came,
    ) -> Result<Principal, NotTaken> {
        let named = line.module().module();
        let by_launch = from.module() != named;
        let (own, other) = (installation.system.id, from.system());
        if named.system() != own || other != own {
            self.counts.other_system += 1;
            return Err(self.foreign(from, named, came.mono_ns));
        }
        if by_launch && !is_launch_of(installation, from, named) {
            self.counts.foreign_name += 1;
            return Err(self.foreign(from, named, came.mono_ns));
        }
        let principal = installation.principal(named);
        let (rate, burst) = (self.rate, self.burst);
        let writer = self.writer(principal, by_launch);
        let quiet_ns = came.mono_ns.saturating_sub(std::mem::replace(&mut writer.heard_ns, came.mono_ns));
        if !writer.share.take(came.mono_ns) {
            let told = writer.beyond.note(came.mono_ns, TELL_NS);
            self.counts.beyond_share += 1;
            let name = installation.classes.format(named);
            let told =
                told.map(|lines| format!("{lines} lines were dropped: more than the share of the principal of {name}"));
            return Err(NotTaken(told));
        }
        let lost_max = u64::from(rate) * LANES * (quiet_ns / SECOND_NS + 1) + u64::from(burst) * LANES + WAITING_LINES;
        self.bound(line, came.time_ns, lost_max, quiet_ns);
        Ok(principal)
    }

    fn foreign(&mut self, from: Name, named: Name, now_ns: u64) -> NotTaken {
        let told = self.names.note(now_ns, TELL_NS);
        NotTaken(told.map(|lines| {
            format!(
                "{lines} lines in the name of others were dropped, the last of them from {from} in the name of {named}"
            )
        }))
    }

    fn writer(&mut self, principal: Principal, by_launch: bool) -> &mut Writer {
        let is_it = |writer: &Writer| (writer.principal, writer.by_launch) == (principal, by_launch);
        let at = self.writers.iter().position(is_it).unwrap_or_else(|| {
            // All that it may say by its own allowances, and what waited while this collector was away.
            let (lanes, waiting) = (LANES as u32, WAITING_LINES as u32);
            let share = Bucket::new(self.rate * lanes, self.burst * lanes + waiting);
            let beyond = Throttle::default();
            self.writers.push(Writer { principal, by_launch, share, heard_ns: 0, beyond });
            self.writers.len() - 1
        });
        &mut self.writers[at]
    }

    /// A line cannot be later than now, nor tell of more lines than its module can have said since the last one; of the
    /// first in this incarnation of the collector, since the computer started. What it said stands in its text.
    fn bound(&mut self, line: &mut OutputLine, now_ns: u64, lost_max: u64, quiet_ns: u64) {
        let mut marks = String::new();
        if line.time_ns > now_ns.saturating_add(AHEAD_MAX_NS) {
            self.counts.ahead += 1;
            marks += &format!("(says that it is of {}) ", iso(line.time_ns));
            line.time_ns = now_ns;
        }
        let suppressed_max = quiet_ns / SUPPRESSED_EACH_NS + u64::from(u16::MAX);
        for (count, max, what) in
            [(&mut line.lost, lost_max, "lost"), (&mut line.suppressed, suppressed_max, "suppressed")]
        {
            let max = u32::try_from(max).unwrap_or(u32::MAX);
            if *count > max {
                self.counts.losses += 1;
                marks += &format!("(says that {count} lines were {what}) ");
                *count = max;
            }
        }
        if !marks.is_empty() {
            line.text = cut(marks + &line.text);
        }
    }
}

/// Launch of a node passes on what modules of that node print.
fn is_launch_of(installation: &Installation, from: Name, named: Name) -> bool {
    let node = installation.node_of(named).and_then(|node| installation.node(node));
    node.is_some_and(|node| installation.launch_of(node) == from.module())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost_modules::common::OutputLevel;

    const FILE: &str = include_str!("../../../../config/tests/two_nodes.toml");
    const MOTOR: Name = Name::new(1, 200, 0, 0);
    const NOW: Came = Came { mono_ns: 1000 * SECOND_NS, time_ns: 1_700_000_000 * SECOND_NS };

    fn installation() -> Installation {
        Installation::parse(FILE, "two_nodes.toml".as_ref()).unwrap()
    }

    fn line(module: Name) -> OutputLine {
        let (module, time_ns, text) = (module.raw(), NOW.time_ns, "is on".into());
        OutputLine { time_ns, module, level: OutputLevel::Info, lost: 0, suppressed: 0, errno: None, text }
    }

    #[test]
    fn a_line_is_said_in_the_senders_name_or_by_launch_of_its_node() {
        let installation = installation();
        let mut admission = Admission::new(100, 200);
        let (base, command_server) = (Name::new(1, 16, 0, 0), Name::new(1, 16, 4, 0));
        for (from, named, taken, why) in [
            (MOTOR, MOTOR, true, "its own"),
            (MOTOR.with_local(1), MOTOR, true, "from any of its mailboxes"),
            (base, MOTOR, true, "what it printed, from launch of its node"),
            (command_server, MOTOR, false, "launch of another node"),
            (Name::new(1, 16, 1, 0), MOTOR, false, "a tool"),
            (Name::new(1, 32, 0, 0), MOTOR, false, "another module"),
            (MOTOR, base, false, "a module in the name of launch"),
            (base, base, true, "launch itself"),
            (Name::new(2, 200, 0, 0), Name::new(2, 200, 0, 0), false, "another system in its own name"),
            (Name::new(2, 16, 0, 0), MOTOR, false, "and in ours"),
            (Name::new(1, 150, 9, 0), Name::new(1, 150, 9, 0), true, "a program that the file does not know"),
        ] {
            assert_eq!(admission.validate(&installation, from, &mut line(named), NOW).is_ok(), taken, "{why}");
        }
        let counts = RefusedLines { foreign_name: 4, other_system: 2, ..RefusedLines::default() };
        assert_eq!(admission.counts, counts);
    }

    #[test]
    fn nobody_says_more_than_its_share_whatever_its_names_and_others_say_as_much_as_before() {
        let installation = installation();
        let mut admission = Admission::new(10, 20);
        let most = 10 * LANES + 20 * LANES + WAITING_LINES;
        let strangers = (0..20_000_u64).filter(|n| {
            let name = Name::new(1, 150, 1 + (n % 200) as u8, 0);
            let came = Came { mono_ns: NOW.mono_ns + n * SECOND_NS / 20_000, ..NOW };
            admission.validate(&installation, name, &mut line(name), came).is_ok()
        });
        let taken = strangers.count() as u64;
        assert!(taken > 20 && taken <= most, "{taken} of at most {most}");
        assert_eq!(admission.counts.beyond_share, 20_000 - taken);
        assert!(admission.validate(&installation, MOTOR, &mut line(MOTOR), NOW).is_ok());
    }

    #[test]
    fn a_refusal_is_told_once_in_a_while_with_the_number_of_those_before() {
        let installation = installation();
        let mut admission = Admission::new(1, 1);
        let mut told = Vec::new();
        for n in 0..100 {
            let came = Came { mono_ns: NOW.mono_ns + n * SECOND_NS / 10, ..NOW };
            let refused = admission.validate(&installation, Name::new(2, 9, 0, 0), &mut line(MOTOR), came).unwrap_err();
            told.extend(refused.0);
        }
        let begins: Vec<&str> = told.iter().map(|text| text.split(' ').next().unwrap()).collect();
        assert_eq!(begins, ["1", "50"], "{told:?}");
    }

    #[test]
    fn a_time_in_the_future_and_losses_that_cannot_be_are_bounded_and_marked() {
        let installation = installation();
        let mut admission = Admission::new(100, 200);
        let mut validated = |mono_ns: u64, change: fn(&mut OutputLine)| {
            let mut said = line(MOTOR);
            change(&mut said);
            admission.validate(&installation, MOTOR, &mut said, Came { mono_ns, ..NOW }).unwrap();
            said
        };
        assert_eq!(validated(SECOND_NS, |line| line.time_ns += AHEAD_MAX_NS), {
            OutputLine { time_ns: NOW.time_ns + AHEAD_MAX_NS, ..line(MOTOR) }
        });
        let future = validated(2 * SECOND_NS, |line| line.time_ns = u64::MAX);
        assert_eq!(future.time_ns, NOW.time_ns);
        assert!(
            future.text.starts_with("(says that it is of 2554-07-21T") && future.text.ends_with(") is on"),
            "{future:?}"
        );
        let lost = validated(3 * SECOND_NS, |line| line.lost = 4_000_000_000);
        assert_eq!(u64::from(lost.lost), 2 * 100 * LANES + 200 * LANES + WAITING_LINES);
        assert_eq!(lost.text, "(says that 4000000000 lines were lost) is on");
        let suppressed = validated(4 * SECOND_NS, |line| line.suppressed = u32::MAX);
        assert_eq!(suppressed.suppressed, 100_065_535);
        // After a day of silence much may have been lost.
        let day = validated(86_400 * SECOND_NS, |line| line.lost = 20_000_000);
        assert_eq!((day.lost, day.text.as_str()), (20_000_000, "is on"));
        // A mark leaves no room for all of a long text.
        let long = validated(86_401 * SECOND_NS, |line| (line.lost, line.text) = (u32::MAX, "€".repeat(300)));
        assert!(long.text.len() <= rohrpost_modules::output::TEXT_MAX && long.text.ends_with('…'));
        let counts = RefusedLines { ahead: 1, losses: 3, ..RefusedLines::default() };
        assert_eq!(admission.counts, counts);
    }
}
