//! The newest lines, numbered as they came. A principal that says much loses its own lines first: of all principals,
//! the one with the most lines gives way, so that nobody says so much that what others said is gone.

use rohrpost_config::Principal;
use rohrpost_modules::output::OutputLine;
use std::collections::VecDeque;

pub(super) struct Ring {
    /// What each said, with its number. There are as many as modules and nodes in the file, and one for names that it
    /// does not know.
    said: Vec<(Principal, VecDeque<(u64, OutputLine)>)>,
    kept: usize,
    max: usize,
    /// Number of the next line.
    next: u64,
}

impl Ring {
    pub(super) fn new(max: usize) -> Self {
        Self { said: Vec::new(), kept: 0, max, next: 0 }
    }

    pub(super) fn push(&mut self, principal: Principal, line: OutputLine) {
        if self.kept >= self.max {
            let most = self.said.iter_mut().max_by_key(|(_, lines)| lines.len());
            self.kept -= usize::from(most.is_some_and(|(_, lines)| lines.pop_front().is_some()));
        }
        let at = self.said.iter().position(|(known, _)| *known == principal).unwrap_or_else(|| {
            self.said.push((principal, VecDeque::new()));
            self.said.len() - 1
        });
        self.said[at].1.push_back((self.next, line));
        self.next += 1;
        self.kept += 1;
    }

    /// Number of the next line that will come.
    pub(super) fn next(&self) -> u64 {
        self.next
    }

    /// The lines that follow each other without a gap from the first one on that is kept of this number or a later one;
    /// and its number.
    pub(super) fn run(&self, number: u64) -> (u64, impl Iterator<Item = &OutputLine>) {
        let mut rests: Vec<_> =
            self.said.iter().map(|(_, lines)| (lines, lines.partition_point(|l| l.0 < number))).collect();
        let first = rests.iter().filter_map(|(lines, at)| Some(lines.get(*at)?.0)).min().unwrap_or(number);
        let run = (first..=u64::MAX).map_while(move |wanted| {
            rests.iter_mut().find_map(|(lines, at)| {
                let (_, line) = lines.get(*at).filter(|(number, _)| *number == wanted)?;
                *at += 1;
                Some(line)
            })
        });
        (first, run)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost_modules::common::OutputLevel;

    const LOUD: Principal = Principal::System(7);
    const QUIET: Principal = Principal::Tools(0);

    fn line(text: &str) -> OutputLine {
        let text = text.into();
        OutputLine { time_ns: 0, module: 0, level: OutputLevel::Info, lost: 0, suppressed: 0, errno: None, text }
    }

    /// All lines with their numbers, run by run.
    fn all(ring: &Ring) -> Vec<(u64, String)> {
        let (mut all, mut next) = (Vec::new(), 0);
        while next < ring.next() {
            let (first, run) = ring.run(next);
            let before = all.len();
            all.extend((first..).zip(run.map(|line| line.text.clone())));
            next = first + (all.len() - before) as u64;
        }
        all
    }

    #[test]
    fn a_loud_principal_loses_its_own_lines_and_nobody_elses() {
        let mut ring = Ring::new(10);
        for number in 0..1000 {
            let (principal, text) = if number % 250 == 100 { (QUIET, "evidence") } else { (LOUD, "noise") };
            ring.push(principal, line(text));
        }
        let kept = all(&ring);
        let evidence: Vec<u64> =
            kept.iter().filter(|(_, text)| text == "evidence").map(|(number, _)| *number).collect();
        assert_eq!((kept.len(), evidence), (10, vec![100, 350, 600, 850]));
        assert_eq!(kept[4..].iter().map(|(number, _)| *number).collect::<Vec<_>>(), [994, 995, 996, 997, 998, 999]);
    }

    #[test]
    fn of_one_the_newest_are_kept_and_pages_go_on_where_the_last_ended() {
        for max in [1, 7, 100] {
            let mut ring = Ring::new(max);
            (0..20).for_each(|n| ring.push(LOUD, line(&n.to_string())));
            let kept = all(&ring);
            let expected: Vec<_> = (20 - max.min(20) as u64..20).map(|n| (n, n.to_string())).collect();
            assert_eq!(kept, expected);
            assert_eq!((ring.run(20).0, ring.run(20).1.count()), (20, 0), "nothing yet");
            assert_eq!((ring.run(u64::MAX).0, ring.run(u64::MAX).1.count()), (u64::MAX, 0));
        }
    }
}
