//! What routers carried, by class, as a table: used by `net` and by the demo's summary.

use crate::look::summary::class_name;
use crate::nodes::quantities::{cells, heads};
use crate::terminal::table::{table_of, time};
use rohrpost::Class;
use rohrpost::interfaces::{CarriedLoss, ClassCarried, Links};
use rohrpost_config::Installation;
use std::cmp::Reverse;
use std::time::Duration;

/// A row for each class and node that `is_shown`, the most urgent class first; empty without any.
pub(crate) fn by_class<'a>(
    installation: &Installation,
    links: impl IntoIterator<Item = &'a Links>,
    is_shown: fn(&ClassCarried) -> bool,
) -> String {
    let classes = links.into_iter().flat_map(|node| node.classes.iter().map(move |class| (node, class)));
    let mut classes: Vec<(&Links, &ClassCarried)> = classes.filter(|(_, class)| is_shown(class)).collect();
    classes.sort_by_key(|(_, class)| Reverse(class.class));
    let rows = classes.iter().map(|(node, class)| {
        let age = class.age.map_or("-".into(), |age| time(Duration::from_nanos(age.p99_ns)));
        let before = [class_name(installation, Some(Class(class.class))), node.node.clone()];
        cells(before, *class, [age, lost(&class.lost)])
    });
    let heads = heads::<ClassCarried>(&["class", "node"], &[">age p99", "lost"]);
    if classes.is_empty() { String::new() } else { table_of(&heads, rows) }
}

/// Losses by cause in one cell.
pub(crate) fn lost(lost: &[CarriedLoss]) -> String {
    let words: Vec<String> = lost.iter().map(|lost| format!("{} {}", lost.packages, lost.cause)).collect();
    if words.is_empty() { "none".into() } else { words.join(", ") }
}
