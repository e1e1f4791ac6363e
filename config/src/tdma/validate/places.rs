//! Validates places and lengths of slots: each lies in the cycle, behind synchronisation, without overlap, and each
//! node has one.

use super::Validator;
use crate::units::duration_decimal;
use rohrpost_network::TimeSlot;
use std::time::Duration;

impl Validator<'_> {
    /// Each slot has room for a largest datagram. Slots that then overlap have a message of their own.
    pub(super) fn lengths(&mut self) {
        let needed = self.length_min();
        for index in 0..self.fixed.slots.len() {
            let slot = self.fixed.slots[index];
            if slot.length >= needed {
                continue;
            }
            let (length, guard) = (duration_decimal(slot.length), duration_decimal(self.fixed.guard));
            let what = if slot.length <= self.fixed.guard {
                format!("is {length} long, all of it guard: nobody ever sends in the last {guard} of a slot")
            } else {
                format!(
                    "is {length} long, {guard} of it guard, which leaves no room for what routers say to each other \
                     and one largest datagram"
                )
            };
            let lacking = duration_decimal(needed - slot.length);
            let right = format!("lengthen it by {lacking}: `length = \"{}\"`", duration_decimal(needed));
            self.report(index, format!("{what}; {right}"));
            self.fixed.slots[index].length = needed;
        }
    }

    pub(super) fn places(&mut self) {
        let (begin, cycle) = (self.fixed.windows_end(self.masters()), self.fixed.cycle);
        for index in 0..self.fixed.slots.len() {
            let slot = self.fixed.slots[index];
            if slot.offset >= cycle {
                let right = self.moved_or_shorter(index);
                self.report(index, format!("begins when the cycle of {} is over; {right}", duration_decimal(cycle)));
            } else if slot.offset < begin && begin < cycle {
                let masters = self.masters();
                let windows = if masters == 1 {
                    "the synchronisation window of the master, which ends".into()
                } else {
                    format!("the synchronisation windows of {masters} masters, which end")
                };
                let right = self.moved_or_shorter(index);
                self.report(index, format!("lies in {windows} at {}; {right}", duration_decimal(begin)));
            } else if slot.end() > cycle {
                let right = self.in_the_cycle(index);
                let over = duration_decimal(slot.end() - cycle);
                let once = self.once_longer(index);
                self.report(index, format!("ends {over} after the cycle does{once}; {right}"));
            }
        }
    }

    /// No two slots overlap.
    pub(super) fn collisions(&mut self) {
        for (first, second) in self.fixed.collisions() {
            let (a, b) = (self.fixed.slots[first], self.fixed.slots[second]);
            // A slot with a new place needs no second message.
            if !a.collides(&b) {
                continue;
            }
            let cycles = self.fixed.cycles();
            let both = (0..cycles).find(|cycle| a.is_in(*cycle) && b.is_in(*cycle));
            let when = both.filter(|_| cycles > 1).map(|cycle| format!(", in cycle {cycle} of {cycles}"));
            let shorter = b.offset - a.offset;
            let shorter_text = format!("`length = \"{}\"` there", duration_decimal(shorter));
            let right = if shorter < self.length_min() {
                self.moved_or_shorter(second)
            } else if let Some(place) = self.moved(second) {
                format!("write {place}, or {shorter_text}")
            } else {
                self.fixed.slots[first].length = shorter;
                format!("write {shorter_text}")
            };
            let (over, when) = (duration_decimal(a.end() - b.offset), when.unwrap_or_default());
            let (first_text, once) = (self.described(first), self.once_longer(first));
            self.report(second, format!("begins {over} before {first_text} ends{once}{when}; {right}"));
        }
    }

    /// Each node has a slot.
    pub(super) fn nodes(&mut self) {
        let has_one = |index: u8| self.tdma.slots.iter().any(|slot| slot.node == index);
        for (node, index) in self.installation.lan_nodes().iter().zip(0..).filter(|(_, index)| !has_one(*index)) {
            let master = if self.installation.time.masters().contains(&index) {
                ", although it may be master of time"
            } else {
                ""
            };
            let length = self.length_min();
            let needed = duration_decimal(length);
            let slot = TimeSlot { node: index, offset: Duration::ZERO, length, period: 1, phase: 0 };
            let right = match self.fixed.nearest_room(&slot, self.masters()) {
                Some(offset) => {
                    self.fixed.slots.push(TimeSlot { offset, ..slot });
                    let offset = duration_decimal(offset);
                    format!(
                        "add a [[slot]]: `node = \"{}\"`, `offset = \"{offset}\"`, `length = \"{needed}\"`",
                        node.name
                    )
                }
                None => format!("no {needed} of the cycle are free for one: shorten others"),
            };
            let message = format!("node `{}` has no slot{master}, so it can send nothing; {right}", node.name);
            self.reader.report(node.line, message);
        }
    }

    /// Moves a slot to the nearest place with room; returns how to write that.
    pub(super) fn moved(&mut self, index: usize) -> Option<String> {
        let slot = self.fixed.slots[index];
        let offset = self.fixed.without(index).nearest_room(&slot, self.masters())?;
        self.fixed.slots[index].offset = offset;
        Some(format!("`offset = \"{}\"`", duration_decimal(offset)))
    }

    /// Added to messages about the end of a slot that must become longer.
    pub(super) fn once_longer(&self, index: usize) -> &'static str {
        if self.fixed.slots[index].length > self.tdma.slots[index].length { " once it is long enough" } else { "" }
    }

    fn moved_or_shorter(&mut self, index: usize) -> String {
        if let Some(place) = self.moved(index) {
            return format!("write {place}");
        }
        let length = self.fixed.slots[index].length;
        let it_or = if length > self.length_min() { "it or " } else { "" };
        format!("no {} of the cycle are free for it: shorten {it_or}others", duration_decimal(length))
    }

    /// Ends a slot with the cycle, if enough of it is left, or moves it.
    fn in_the_cycle(&mut self, index: usize) -> String {
        let slot = self.fixed.slots[index];
        let length = self.fixed.cycle - slot.offset;
        if length < self.length_min() {
            return self.moved_or_shorter(index);
        }
        let or_moved = self.moved(index).map_or_else(String::new, |place| format!(", or {place}"));
        self.fixed.slots[index] = TimeSlot { length, ..slot };
        format!("write `length = \"{}\"`{or_moved}", duration_decimal(length))
    }
}
