//! What the router says of its slots in words.

use crate::frame::NodeIndex;
use crate::settings::Settings;
use crate::tdma::Silent;

/// Says that it does not send any more, and that it does. `parted`: see [`parted`].
pub(super) fn tell_change(before: Option<Silent>, now: Option<Silent>, parted: impl FnOnce() -> String) {
    if kind(now) == kind(before) {
        return;
    }
    match now {
        None => tracing::info!("sends in its time slots"),
        Some(why @ Silent::BoundTooLarge { .. }) => {
            tracing::warn!(
                "sends nothing, lest it disturbs others: {why}; is a master of time running, and does the network \
                reach it?"
            );
        }
        Some(Silent::OtherTable { .. }) => tracing::warn!("sends nothing, lest it disturbs others: {}", parted()),
        Some(why) => tracing::info!("sends nothing yet: {why}"),
    }
}

/// Which nodes go by which other configuration, and what to type.
pub(super) fn parted(settings: &Settings, by: impl Iterator<Item = (Option<NodeIndex>, u64)>) -> String {
    let node = |node: Option<NodeIndex>| match node.and_then(|node| settings.nodes.get(usize::from(node))) {
        Some(node) => format!("{} ({})", node.name, node.address),
        None => "a node with an address that this file does not have".into(),
    };
    let others: Vec<String> = by.map(|(other, digest)| format!("{} by {digest:016x}", node(other))).collect();
    let own = settings.nodes.get(usize::from(settings.own)).map_or("", |own| own.name.as_str());
    format!(
        "nodes go by other configurations, and so by other time slots: {}, this node ({own}) by {:016x}; copy one \
        file to all of them \
         (`rohrpost check FILE` shows its digest) and type `rohrpost launch FILE --node NAME` on each",
        others.join(", "),
        settings.digest
    )
}

fn kind(silent: Option<Silent>) -> Option<std::mem::Discriminant<Silent>> {
    silent.as_ref().map(std::mem::discriminant)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::harness::settings;

    #[test]
    fn a_refusal_of_a_table_names_nodes_digests_and_what_to_type() {
        let text = parted(&settings(2, 3), [(Some(0), 0xab), (None, 0xcd)].into_iter());
        let own = settings(2, 3).nodes[2].name.clone();
        for words in
            ["n0 (", "00000000000000ab", "does not have by 00000000000000cd", &own, "rohrpost launch FILE --node"]
        {
            assert!(text.contains(words), "{words}: {text}");
        }
    }
}
