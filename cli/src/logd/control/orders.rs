//! Orders that the recorder was given, and their answers: some are carried out later, by the thread that writes.

use rohrpost_recording::{ControlAnswer, PendingOrder};
use std::collections::VecDeque;
use std::path::PathBuf;

/// Orders that are not carried out yet.
const OPEN_MAX: usize = 32;
/// Answers that are kept for callers that ask again.
const ANSWERS_MAX: usize = 64;

/// An order that is not carried out yet.
pub(in crate::logd) enum OpenOrder {
    /// The recording has begun, and its first file is awaited.
    Begun,
    /// The recording ends, and its file is being closed.
    Ending,
    /// A mark, set at this system time.
    Marked(PendingOrder, u64),
    /// Another file.
    Rotated(PendingOrder),
    /// A file in another folder.
    Moved(PendingOrder, PathBuf),
}

/// All orders so far.
#[derive(Default)]
pub(in crate::logd) struct Orders {
    next: u32,
    open: Vec<(u32, OpenOrder)>,
    answers: VecDeque<(u32, ControlAnswer)>,
}

impl Orders {
    /// Notes an order with its answer; its number.
    pub(in crate::logd) fn add_answered(&mut self, answer: ControlAnswer) -> u32 {
        let number = self.number();
        self.keep(number, answer);
        number
    }

    /// Notes an order that is carried out later; its number.
    pub(in crate::logd) fn add_open(&mut self, order: OpenOrder) -> u32 {
        if self.open.len() >= OPEN_MAX {
            return self.add_answered(ControlAnswer::err(&format!("{OPEN_MAX} orders wait already; try again")));
        }
        let number = self.number();
        self.open.push((number, order));
        number
    }

    /// Asks what became of those that are open.
    pub(in crate::logd) fn poll(&mut self, mut told: impl FnMut(&OpenOrder) -> Option<ControlAnswer>) {
        for (number, order) in std::mem::take(&mut self.open) {
            match told(&order) {
                Some(answer) => self.keep(number, answer),
                None => self.open.push((number, order)),
            }
        }
    }

    /// The answer to an order; none: not yet.
    pub(in crate::logd) fn answer(&self, number: u32) -> Option<ControlAnswer> {
        if self.open.iter().any(|(open, _)| *open == number) {
            return None;
        }
        let kept = self.answers.iter().find(|(answered, _)| *answered == number);
        Some(kept.map_or_else(
            || ControlAnswer::err(&format!("order {number} is unknown; the last {ANSWERS_MAX} answers are kept")),
            |(_, answer)| answer.clone(),
        ))
    }

    fn number(&mut self) -> u32 {
        self.next = self.next.wrapping_add(1);
        self.next
    }

    fn keep(&mut self, number: u32, answer: ControlAnswer) {
        if self.answers.len() >= ANSWERS_MAX {
            self.answers.pop_front();
        }
        self.answers.push_back((number, answer));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_are_answered_once_they_are_carried_out_and_bounded() {
        let mut orders = Orders::default();
        let (at_once, later) = (orders.add_answered(ControlAnswer::ok()), orders.add_open(OpenOrder::Begun));
        assert_eq!((orders.answer(at_once), orders.answer(later)), (Some(ControlAnswer::ok()), None));
        orders.poll(|_| None);
        assert_eq!(orders.answer(later), None);
        orders.poll(|_| Some(ControlAnswer::ok().with("lost", 0)));
        assert_eq!(orders.answer(later).unwrap().line(), "OK lost=0");
        assert_eq!(orders.answer(later).unwrap().line(), "OK lost=0", "a caller may ask again");
        assert!(orders.answer(77).unwrap().line().starts_with("ERR order 77 is unknown"));
        let open: Vec<u32> = (0..=OPEN_MAX).map(|_| orders.add_open(OpenOrder::Ending)).collect();
        let answers: Vec<_> = open.iter().map(|number| orders.answer(*number)).collect();
        assert!(answers[..OPEN_MAX].iter().all(Option::is_none));
        assert!(answers[OPEN_MAX].as_ref().is_some_and(|answer| !answer.is_ok()), "{answers:?}");
        for _ in 0..ANSWERS_MAX {
            orders.add_answered(ControlAnswer::ok());
        }
        assert!(!orders.answer(at_once).unwrap().is_ok(), "too long ago");
    }
}
