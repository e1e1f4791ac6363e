//! Notes on what a configuration asks for: more shared memory than this computer has, larger records than a recording
//! takes.

use crate::terminal::units::size;
use rohrpost_config::{Installation, Module, RECORDED_BYTES_MAX, StreamSpec};
use rohrpost_mailbox::sys::Room;
use std::path::Path;

/// Notes on the nodes with more mailboxes and streams than the file system at `place`, where this computer has its
/// nodes, can hold.
pub(super) fn too_small(installation: &Installation, only: Option<&str>, place: &Path, room: Room) -> Vec<String> {
    let nodes = installation.nodes.iter().filter(|node| only.is_none_or(|name| name == node.name));
    let needs = nodes.map(|node| (&node.name, installation.memory_on(&node.name)));
    let too_large = needs.filter(|(_, bytes)| *bytes > room.bytes);
    let note = |(node, bytes): (&String, u64)| {
        format!(
            "node {node} needs {} of shared memory, and this computer has {} in all at {}; if this is that node, \
             `rohrpost doctor --config {} --node {node}` tells how to get more{}",
            size(bytes),
            size(room.bytes),
            place.display(),
            installation.path.display(),
            less(installation, node)
        )
    };
    too_large.map(note).collect()
}

/// How the node would need less, if it has streams.
fn less(installation: &Installation, node: &str) -> String {
    let streams = installation.modules_on(node).flat_map(|module| module.streams.iter().map(move |it| (module, it)));
    let largest = streams.max_by_key(|(_, (_, spec))| spec.memory());
    largest.map_or_else(String::new, |(module, (name, spec)): (&Module, (&String, &StreamSpec))| {
        let (line, memory) = (installation.document().stream_line(module, name), size(spec.memory()));
        let module = installation.classes.format(module.name);
        format!(
            "; of its streams `{name}` of {module} is the largest, {memory} (line {line}): `record` or `keep` is too \
             large"
        )
    })
}

/// Notes on recorded streams with larger records than a recording takes.
pub(super) fn records_too_large(installation: &Installation) -> Vec<String> {
    let document = installation.document();
    let streams = installation.modules.iter().flat_map(|module| module.streams.iter().map(move |it| (module, it)));
    let larger = streams.filter(|(_, (_, spec))| spec.record_bytes as usize > RECORDED_BYTES_MAX);
    let notes = larger.filter_map(|(module, (name, spec))| {
        let record = installation.record.as_ref()?;
        module.names().find_map(|from| record.stream(from, name))?;
        Some(format!(
            "stream `{name}` of {} is recorded, and takes records of up to {} (line {}): a recording takes up to {}, \
             and counts larger ones as lost; lower `record`, or write the value in parts",
            installation.classes.format(module.name),
            size(spec.record_bytes.into()),
            document.stream_line(module, name),
            size(RECORDED_BYTES_MAX as u64)
        ))
    });
    notes.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn nodes_that_do_not_fit_into_shared_memory_get_a_note() {
        let text = include_str!("../../../../config/tests/full.toml");
        let installation = Installation::parse(text, Path::new("full.toml")).unwrap();
        let notes = |only, mib: u64| {
            let room = Room { bytes: mib << 20, free: 0 };
            too_small(&installation, only, Path::new("/dev/shm/robot"), room)
        };
        let line = 1 + text.lines().position(|line| line == "[module.stream.image]").unwrap();
        assert_eq!(
            notes(None, 64),
            [format!(
                "node base needs 141.4 MiB of shared memory, and this computer has 64 MiB in all at /dev/shm/robot; if \
             this is that node, `rohrpost doctor --config full.toml --node base` tells how to get more; of its \
             streams `image` of motor.0 is the largest, 136.0 MiB (line {line}): `record` or `keep` is too large"
            )]
        );
        assert_eq!(notes(None, 1).len(), 2, "desk has mailboxes alone");
        assert_eq!(notes(Some("desk"), 64), [""; 0]);
        assert_eq!(notes(None, 142), [""; 0], "what is free now may be another moment");
    }

    #[test]
    fn recorded_streams_with_records_that_no_recording_takes_get_a_note() {
        let text = include_str!("../../../../config/tests/record.toml");
        let entry = "aliases = [\"laser.0\"]";
        let line = 2 + text.lines().position(|line| line == entry).unwrap();
        for (stream, record, is_noted) in
            [("scan", "16 MiB", false), ("scan", "16777217 B", true), ("image", "20 MiB", true)]
        {
            let text = text.replacen(entry, &format!("{entry}\nstream.{stream} = {{ record = \"{record}\" }}"), 1);
            let notes = records_too_large(&Installation::parse(&text, Path::new("record.toml")).unwrap());
            let begin = format!("stream `{stream}` of motor.0 is recorded, and takes records of up to ");
            let told = notes.iter().any(|note| note.starts_with(&begin) && note.contains(&format!("(line {line})")));
            assert_eq!((told, notes.len()), (is_noted, usize::from(is_noted)), "{record}: {notes:?}");
        }
        let text = text.replacen("{ name = \"motor.0/*\", every = 10 }", "", 1);
        let text = text.replacen(entry, &format!("{entry}\nstream.image = {{ record = \"20 MiB\" }}"), 1);
        assert_eq!(
            records_too_large(&Installation::parse(&text, Path::new("record.toml")).unwrap()),
            [""; 0],
            "not recorded"
        );
    }
}
