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

/// What a command brought.
pub(in crate::logd) enum Told {
    /// It is answered.
    Now(ControlAnswer),
    /// It is an order of this number, and answered once that is carried out.
    Later(u32),
}

/// All orders so far.
#[derive(Default)]
pub(in crate::logd) struct Orders {
    next: u32,
    open: Vec<(u32, OpenOrder)>,
    answers: VecDeque<(u32, ControlAnswer)>,
}

impl Orders {
    /// Keeps an answer for a caller that fetches it; its number.
    pub(in crate::logd) fn add_answered(&mut self, answer: ControlAnswer) -> u32 {
        let number = self.number();
        self.keep(number, answer);
        number
    }

    /// Notes an order that is carried out later, if there is room.
    pub(in crate::logd) fn add_open(&mut self, order: OpenOrder) -> Told {
        if self.open.len() >= OPEN_MAX {
            return Told::Now(ControlAnswer::err(&format!("{OPEN_MAX} orders wait already; try again")));
        }
        let number = self.number();
        self.open.push((number, order));
        Told::Later(number)
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

    /// The same, for one that asks no more: the answer makes room for those that others fetch.
    pub(in crate::logd) fn take_answer(&mut self, number: u32) -> Option<ControlAnswer> {
        let answer = self.answer(number)?;
        self.answers.retain(|(answered, _)| *answered != number);
        Some(answer)
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
        let (at_once, later) =
            (orders.add_answered(ControlAnswer::ok()), added(&mut orders, OpenOrder::Begun).unwrap());
        assert_eq!((orders.answer(at_once), orders.answer(later)), (Some(ControlAnswer::ok()), None));
        orders.poll(|_| None);
        assert_eq!(orders.answer(later), None);
        orders.poll(|_| Some(ControlAnswer::ok().with("lost", 0)));
        assert_eq!(orders.answer(later).unwrap().line(), "OK lost=0");
        assert_eq!(orders.answer(later).unwrap().line(), "OK lost=0", "a caller may ask again");
        assert!(orders.answer(77).unwrap().line().starts_with("ERR order 77 is unknown"));
        for _ in 0..OPEN_MAX {
            let number = added(&mut orders, OpenOrder::Ending).unwrap();
            assert_eq!(orders.answer(number), None);
        }
        assert!(!added(&mut orders, OpenOrder::Ending).unwrap_err().is_ok());
        for _ in 0..ANSWERS_MAX {
            orders.add_answered(ControlAnswer::ok());
        }
        assert!(!orders.answer(at_once).unwrap().is_ok(), "too long ago");
    }

    #[test]
    fn answers_that_a_connection_took_push_out_none_that_are_fetched() {
        let mut orders = Orders::default();
        let fetched = orders.add_answered(ControlAnswer::ok());
        for _ in 0..2 * ANSWERS_MAX {
            let taken = added(&mut orders, OpenOrder::Ending).unwrap();
            orders.poll(|_| Some(ControlAnswer::ok()));
            assert_eq!(orders.take_answer(taken), Some(ControlAnswer::ok()));
        }
        assert_eq!(orders.answer(fetched), Some(ControlAnswer::ok()));
    }

    fn added(orders: &mut Orders, order: OpenOrder) -> Result<u32, ControlAnswer> {
        match orders.add_open(order) {
            Told::Later(number) => Ok(number),
            Told::Now(answer) => Err(answer),
        }
    }
}
