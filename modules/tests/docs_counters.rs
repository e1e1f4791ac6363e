//! The book's tables of counters and other quantities are what their types say.

use rohrpost_modules::interfaces::{
    BeyondClient, BeyondClients, BeyondCrowded, BeyondLink, ClassCarried, ClassPassed, FlowState, LinkCounters,
    SlotState, TunnelState,
};
use rohrpost_modules::schema::{Schema, quantity_fields};

const LAN: &str = include_str!("../../docs/src/lan.md");
const SLOTS: &str = include_str!("../../docs/src/slots.md");
const TCP: &str = include_str!("../../docs/src/tcp.md");

#[track_caller]
fn check<T: Schema>(page: &str, of: &str) {
    let head = format!("| {of} | unit | meaning |");
    let said: Vec<&str> = page.lines().skip_while(|line| *line != head).skip(2).collect();
    let said: Vec<&str> = said.into_iter().take_while(|line| line.starts_with('|')).collect();
    let fields = quantity_fields::<T>();
    let known: Vec<String> =
        fields.iter().map(|field| format!("| `{}` | {} | {} |", field.name, field.unit, field.text)).collect();
    assert_eq!(said.join("\n"), known.join("\n"), "left: the book, right: the type; {head}");
}

#[test]
fn the_book_lists_each_quantity_of_links_slots_flows_and_the_tcp_router_with_its_unit_and_text() {
    check::<LinkCounters>(LAN, "counter");
    check::<ClassCarried>(LAN, "of a class");
    check::<SlotState>(SLOTS, "of time slots");
    check::<TunnelState>(SLOTS, "of the tunnel");
    check::<FlowState>(SLOTS, "of a flow");
    check::<BeyondLink>(TCP, "of a client");
    check::<BeyondClient>(TCP, "of a connection");
    check::<BeyondClients>(TCP, "of the TCP router");
    check::<BeyondCrowded>(TCP, "in `crowded`");
    check::<ClassPassed>(TCP, "of a class");
}
