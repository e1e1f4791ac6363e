//! The cost of sealed datagrams: the hop with keys beside the same hop without, turn by turn.

use super::ground::LanSegment;
use crate::lan::nodes::{Network, UNPACED};
use rohrpost_bench_local::Case;
use rohrpost_bench_local::harness::Cell;
use rohrpost_bench_local::rounds::{Contender, at_most, compare};

/// All cases of this file.
pub(super) fn cases() -> Vec<Case> {
    [64, 1024].map(case).into()
}

fn case(bytes: usize) -> Case {
    Case::new("hop, sealed", bytes, "us", move |settings, subject| {
        let [sealed, open] = [true, false].map(|sealed| LanSegment::new(settings, &Network { sealed, ..UNPACED }));
        let cell = Cell::hop(bytes, settings.count(Cell::HOP_MESSAGES));
        let contenders = [
            Contender::sampled("rohrpost", || sealed.time(&cell)),
            Contender::sampled("not sealed", || open.time(&cell)).beside(at_most(1.25), None),
        ];
        Ok(compare(settings, subject, &contenders))
    })
}
