//! The table of counters in `docs/src/lan.md` is what their types say.

use rohrpost_modules::interfaces::LinkCounters;
use rohrpost_modules::schema::counter_fields;

const PAGE: &str = include_str!("../../docs/src/lan.md");

#[test]
fn the_book_lists_each_counter_of_a_link_with_its_unit_and_text() {
    let said: Vec<&str> = PAGE.lines().skip_while(|line| *line != "| counter | unit | meaning |").skip(2).collect();
    let said: Vec<&str> = said.into_iter().take_while(|line| line.starts_with('|')).collect();
    let fields = counter_fields::<LinkCounters>();
    let counted: Vec<String> =
        fields.iter().map(|field| format!("| `{}` | {} | {} |", field.name, field.unit, field.text)).collect();
    assert_eq!(said, counted, "left: docs/src/lan.md, right: LinkCounters");
}
