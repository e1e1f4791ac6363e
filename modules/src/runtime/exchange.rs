//! What a module says of its exchange with others.

use super::context::Context;
use crate::common::{EXCHANGE_PAGE, Exchange, ExchangePage};
use rohrpost_mailbox::Name;

/// From this one on: first the data that it follows, then those that it calls.
pub(super) fn page(context: &Context, from: u16) -> ExchangePage {
    let named = |module: Name| context.installation.classes.format(module);
    let mut link = context.link.unseen().borrow_mut();
    // Answers that nobody waits for any more.
    link.collect();
    let followed = context.followings.tallies().chain(context.followed_streams.tallies()).map(
        |(publisher, number, came, lost)| Exchange {
            module: named(publisher),
            data: Some(number),
            packages: came,
            repeated: 0,
            lost,
            late: 0,
        },
    );
    let called = link.tallies().iter().map(|tally| Exchange {
        module: named(tally.to),
        data: None,
        packages: tally.calls,
        repeated: tally.repeated,
        lost: tally.unanswered,
        late: tally.late,
    });
    let all: Vec<Exchange> = followed.chain(called).collect();
    let total = u16::try_from(all.len()).unwrap_or(u16::MAX);
    ExchangePage { total, exchanges: all.into_iter().skip(from.into()).take(EXCHANGE_PAGE).collect() }
}
