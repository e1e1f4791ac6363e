//! Streams with records that no recording takes.

use crate::terminal::units::size;
use rohrpost_config::{Installation, RECORDED_BYTES_MAX};

/// Notes on recorded streams with larger records than a recording takes.
pub(super) fn too_large(installation: &Installation) -> Vec<String> {
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
    fn recorded_streams_with_records_that_no_recording_takes_get_a_note() {
        let text = include_str!("../../../../config/tests/record.toml");
        let entry = "aliases = [\"laser.0\"]";
        let line = 2 + text.lines().position(|line| line == entry).unwrap();
        for (stream, record, is_noted) in
            [("scan", "16 MiB", false), ("scan", "16777217 B", true), ("image", "20 MiB", true)]
        {
            let text = text.replacen(entry, &format!("{entry}\nstream.{stream} = {{ record = \"{record}\" }}"), 1);
            let notes = too_large(&Installation::parse(&text, Path::new("record.toml")).unwrap());
            let begin = format!("stream `{stream}` of motor.0 is recorded, and takes records of up to ");
            let told = notes.iter().any(|note| note.starts_with(&begin) && note.contains(&format!("(line {line})")));
            assert_eq!((told, notes.len()), (is_noted, usize::from(is_noted)), "{record}: {notes:?}");
        }
        let text = text.replacen("{ name = \"motor.0/*\", every = 10 }", "", 1);
        let text = text.replacen(entry, &format!("{entry}\nstream.image = {{ record = \"20 MiB\" }}"), 1);
        assert_eq!(too_large(&Installation::parse(&text, Path::new("record.toml")).unwrap()), [""; 0], "not recorded");
    }
}
