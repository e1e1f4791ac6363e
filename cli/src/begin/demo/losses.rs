//! End-to-end losses of the declared flows, as counted by the modules at both ends.

use crate::nodes::vocabulary::{Vocabulary, built_in};
use crate::terminal::table::table;
use rohrpost::common::Exchange;
use rohrpost::schema::Description;
use rohrpost::{Name, ToolLink};
use rohrpost_config::{Flow, Installation};
use rohrpost_mailbox::Kind;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// How long to wait for an overdue answer, and how often to poll.
const OVERDUE: Duration = Duration::from_secs(1);
const AGAIN: Duration = Duration::from_millis(50);

/// The modules' counters of their exchange with others.
pub(super) struct ExchangeLosses {
    told: BTreeMap<Name, Vec<Exchange>>,
}

impl ExchangeLosses {
    /// Asks both ends of each declared flow. A module that does not answer is reported elsewhere. A call that timed out
    /// a moment ago may still get its answer: wait a little for it.
    pub(super) fn ask(installation: &Installation, tool: &mut ToolLink) -> Self {
        let until = Instant::now() + OVERDUE;
        loop {
            let losses = Self::ask_once(installation, tool);
            let calls = losses.told.values().flatten().filter(|exchange| exchange.data.is_none());
            if calls.map(|exchange| exchange.lost).sum::<u64>() == 0 || Instant::now() > until {
                return losses;
            }
            std::thread::sleep(AGAIN);
        }
    }

    fn ask_once(installation: &Installation, tool: &mut ToolLink) -> Self {
        let ends = installation.flows.iter().flat_map(|flow| [flow.from, flow.to]);
        let mut told = BTreeMap::new();
        for module in ends {
            if let std::collections::btree_map::Entry::Vacant(place) = told.entry(module)
                && let Ok(exchange) = tool.exchange(module)
            {
                place.insert(exchange);
            }
        }
        Self { told }
    }

    /// A row for each kind of package on each declared flow between nodes. `ask` asks a module for its interface.
    pub(super) fn table(
        &self,
        installation: &Installation,
        vocabulary: &mut Vocabulary,
        mut ask: impl FnMut(Name) -> Option<Description>,
    ) -> String {
        let name = |name| installation.classes.format(name);
        let mut rows: Vec<[String; 6]> = Vec::new();
        let crosses = |flow: &&Flow| installation.node_of(flow.from) != installation.node_of(flow.to);
        for flow in installation.flows.iter().filter(crosses) {
            let between = format!("{} → {}", name(flow.from), name(flow.to));
            for (what, exchange) in self.of(installation, flow) {
                let of_calls = |count: u64| if exchange.data.is_some() { "-".into() } else { count.to_string() };
                let [again, late] = [exchange.repeated, exchange.late].map(of_calls);
                let [packages, lost] = [exchange.packages, exchange.lost].map(|count| count.to_string());
                let number = exchange.data.map(|number| {
                    let ask = |module| built_in(installation, module).or_else(|| ask(module));
                    let word = vocabulary.word(Kind::Data(number), flow.from, flow.to, ask);
                    format!(" {}", word.unwrap_or_else(|| number.to_string()))
                });
                let what = format!("{what}{}", number.unwrap_or_default());
                rows.push([between.clone(), what, packages, again, late, lost]);
            }
        }
        rows.sort_unstable();
        // Several flows may be declared between the same two modules.
        rows.dedup();
        table(["flow", "what", ">packages", ">sent again", ">too late", ">lost"], rows)
    }

    fn of<'a>(
        &'a self,
        installation: &Installation,
        flow: &Flow,
    ) -> impl Iterator<Item = (&'static str, &'a Exchange)> {
        let [from, to] = [flow.from, flow.to].map(|name| installation.classes.format(name));
        let told = |by: Name, of: String, data: bool| {
            let all = self.told.get(&by).into_iter().flatten();
            all.filter(move |exchange| exchange.module == of && exchange.data.is_some() == data)
        };
        let data = told(flow.to, from.clone(), true).map(|exchange| ("data", exchange));
        let commands = told(flow.from, to, false).map(|exchange| ("commands", exchange));
        let answers = told(flow.to, from, false).map(|exchange| ("answers", exchange));
        data.chain(commands).chain(answers)
    }
}
