//! What built-in modules would refuse of a configuration, told before anything runs. The crate `config` knows no
//! modules, so it is here that both meet.

use super::{Builtin, description, payload, station, team, world, wormhole};
use rohrpost_config::{
    Document, GUI, Installation, Module, Problem, Program, RECORDER, REPLAY, RecordedItems, Show, nearest, size_text,
};
use rohrpost_mailbox::{BODY_BYTES_MAX, Name};
use rohrpost_modules::common::DataHead;
use rohrpost_modules::schema::{DataKind, Description};
use std::collections::BTreeSet;

/// Everything that built-in modules would refuse, by their settings, by what they call, by the sections of their
/// streams, and by what is to be shown and recorded of them. What programs of one's own would refuse only they know.
pub fn check(installation: &Installation) -> Vec<Problem> {
    let document = installation.document();
    let mut problems = Vec::new();
    for module in &installation.modules {
        let Program::Builtin(name) = &module.program else { continue };
        problems.extend(Builtin::find(name).map(|builtin| (builtin.check)(&document, module)).unwrap_or_default());
        // The streams of a player are those of its recording.
        if name != REPLAY {
            problems.extend(unknown_streams(&document, module, name));
        }
    }
    problems.extend(wormhole::problems(installation, &document));
    problems.extend(team::problems(installation, &document));
    problems.extend(payload::problems(installation, &document));
    problems.extend(station::problems(installation, &document));
    problems.extend(world::problems(installation, &document));
    for show in &installation.gui.show {
        problems.extend(data_of(installation, show));
        problems.extend(far_stream_of(installation, show));
    }
    if let Some(record) = &installation.record {
        problems.extend(installation.modules.iter().filter_map(|module| settings_of_recorder(&document, module)));
        let streams = record.streams.iter().filter_map(|items| item_of(installation, items, true));
        problems.extend(streams.chain(record.data.iter().filter_map(|items| item_of(installation, items, false))));
    }
    problems
}

/// What people should know of an installation that is right: what each wormhole counts on.
pub fn notes(installation: &Installation) -> Vec<String> {
    wormhole::notes(installation)
}

/// Everything that built-in modules would refuse of the values that were saved of their parameters, by line of that
/// file.
pub fn check_saved(installation: &Installation) -> Vec<Problem> {
    let document = installation.document();
    let wrong = installation.modules.iter().filter_map(|module| {
        let Program::Builtin(name) = &module.program else { return None };
        let error = (Builtin::find(name)?.check_saved)(&document, module)?;
        Some(Problem { line: Some(error.line), message: format!("[\"{}\"]: {}", error.module, error.message) })
    });
    wrong.collect()
}

/// Sections for streams that no interface of a built-in module has.
fn unknown_streams(document: &Document<'_>, module: &Module, builtin: &str) -> Vec<Problem> {
    let classes_of = &document.installation().classes;
    let classes = module.names().filter_map(|name| classes_of.name(name.class()));
    let descriptions: Vec<Description> = classes.filter_map(|class| description(builtin, class)).collect();
    let items = descriptions.iter().flat_map(Description::streams);
    let known: BTreeSet<&str> = items.map(|item| item.field.name.as_str()).collect();
    let problem = |stream: &String| {
        let right = match nearest(stream, known.iter().copied()) {
            Some(name) => format!("did you mean `{name}`?"),
            None if known.is_empty() => "it has none; drop the section".into(),
            None => format!("it has {}", known.iter().copied().collect::<Vec<_>>().join(", ")),
        };
        let name = classes_of.format(module.name);
        Problem {
            line: Some(document.stream_line(module, stream)),
            message: format!("module `{name}`: the builtin has no stream `{stream}`; {right}"),
        }
    };
    module.streams.keys().filter(|stream| !known.contains(stream.as_str())).map(problem).collect()
}

/// What a built-in module offers under this name.
fn description_of(installation: &Installation, name: Name) -> Option<Description> {
    let Program::Builtin(builtin) = &installation.module(name)?.program else { return None };
    description(builtin, installation.classes.name(name.class())?)
}

/// The recorder has its section in place of settings.
fn settings_of_recorder(document: &Document<'_>, module: &Module) -> Option<Problem> {
    let is_it = module.program == Program::Builtin(RECORDER.into());
    let key = module.settings.keys().next().filter(|_| is_it)?;
    let name = document.installation().classes.format(module.name);
    let line = Some(document.settings_line(module, key));
    Some(Problem { line, message: format!("module `{name}`: it has no settings; write `{key}` into [record]") })
}

/// What is to be recorded of a built-in module, and that has no such stream or data. Its streams are data, too.
fn item_of(installation: &Installation, items: &RecordedItems, is_stream: bool) -> Option<Problem> {
    let (from, wanted) = (items.from?, items.item.as_ref()?);
    let description = description_of(installation, from)?;
    let is_it = |kind: DataKind| !is_stream || kind == DataKind::Stream;
    if description.data_item(wanted).is_some_and(|item| is_it(item.kind)) {
        return None;
    }
    let fits = description.data.iter().filter(|item| is_it(item.kind));
    let names: Vec<&str> = fits.map(|item| item.field.name.as_str()).collect();
    let what = if is_stream { "stream" } else { "data" };
    let right = match (nearest(wanted, names.iter().copied()), &names[..]) {
        _ if description.data_item(wanted).is_some() => "these are data, name them in `data`".into(),
        (Some(name), _) => format!("did you mean `{name}`?"),
        (None, []) => "it has none; drop the entry".into(),
        (None, names) => format!("it has {}", names.join(", ")),
    };
    let from = installation.classes.format(from);
    Some(Problem { line: Some(items.line), message: format!("[record]: `{from}` has no {what} `{wanted}`; {right}") })
}

/// What the GUI is to show of a built-in module, and that has no such data.
fn data_of(installation: &Installation, show: &Show) -> Option<Problem> {
    let description = description_of(installation, show.from)?;
    let data = show.data.as_ref()?;
    if description.data_item(data).is_some() {
        return None;
    }
    let names: Vec<&str> = description.data.iter().map(|item| item.field.name.as_str()).collect();
    let right = match (nearest(data, names.iter().copied()), &names[..]) {
        (Some(name), _) => format!("did you mean `{name}`?"),
        (None, []) => "it publishes none; drop the entry".into(),
        (None, names) => format!("it has {}", names.join(", ")),
    };
    let from = installation.classes.format(show.from);
    Some(Problem { line: Some(show.line), message: format!("[gui] show: `{from}` has no data `{data}`; {right}") })
}

/// A stream that the GUI is to show and does not get: it is on another node, fits no package, and has no replica here.
fn far_stream_of(installation: &Installation, show: &Show) -> Option<Problem> {
    let stream = show.data.as_ref()?;
    let writer = installation.module(show.from)?;
    let record_bytes = writer.streams.get(stream)?.record_bytes;
    if DataHead::BYTES + record_bytes as usize <= BODY_BYTES_MAX {
        return None;
    }
    let gui = installation.classes.id(GUI)?;
    let has_none = |module: &&Module| {
        module.node != writer.node && installation.replica_on(&module.node, show.from, stream).is_none()
    };
    let bridge = installation.modules.iter().filter(|module| module.name.class() == gui).find(has_none)?;
    let (from, name) = (installation.classes.format(show.from), installation.classes.format(bridge.name));
    let message = format!(
        "[gui] show: `{name}` is on node {}, and stream `{stream}` of `{from}` is on node {}, with records of up to \
         {}, which fit no package; {}",
        bridge.node,
        writer.node,
        size_text(record_bytes.into()),
        installation.replica_remedy(&bridge.node, show.from, stream)
    );
    Some(Problem { line: Some(show.line), message })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    const NODES: &str = include_str!("../../../config/demo-nodes.toml");

    fn told(text: &str) -> Vec<String> {
        let installation = Installation::parse(text, Path::new("robot.toml")).unwrap();
        check(&installation).into_iter().map(|problem| problem.message).collect()
    }

    /// So many modules, each with a mistake in its settings.
    fn mistakes(count: usize) -> Installation {
        let mut text = "installation = \"many\"\n[system]\nname = \"robot\"\nid = 1\n[nodes.main]\n".to_owned();
        let classes = (0..count.div_ceil(256)).map(|class| format!("p{class} = {{ id = {} }}\n", 100 + class));
        text += &format!("[classes]\ntool = {{ id = 16 }}\n{}", classes.collect::<String>());
        for module in 0..count {
            let name = format!("p{}.{}", module / 256, module % 256);
            text += &format!("[[module]]\nname = \"{name}\"\nbuiltin = \"pilot\"\nsettings = {{ wrong = 1 }}\n");
        }
        Installation::parse(&text, Path::new("robot.toml")).unwrap_or_else(|errors| panic!("{errors}"))
    }

    /// Time of the processor for this thread, whatever else the computer does.
    fn processor_ns() -> u64 {
        let told = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap();
        told.split(' ').next().unwrap().parse().unwrap()
    }

    #[test]
    fn ten_times_as_many_mistakes_take_about_ten_times_as_long() {
        // As many in sum, and enough of them for a clock that goes by ticks.
        let times = [100, 1000].map(|count| {
            let (installation, before) = (mistakes(count), processor_ns());
            (0..10_000 / count).for_each(|_| assert_eq!(check(&installation).len(), count));
            processor_ns() - before
        });
        assert!(times[1] < 3 * times[0], "{times:?} ns");
    }

    /// The file with its last replica, that of the picture, changed.
    fn changed(change: impl Fn(&str) -> String) -> String {
        let (before, picture) = NODES.rsplit_once("[[replica]]\n").unwrap();
        format!("{before}{}", change(&format!("[[replica]]\n{picture}")))
    }

    #[test]
    fn a_large_stream_is_shown_on_another_node_by_its_replica_alone() {
        let head = "[gui] show: `gui.0` is on node desk, and stream `image` of `camera.0` is on node base, with \
                    records of up to 1 MiB, which fit no package; ";
        assert_eq!(told(NODES), [""; 0]);
        assert_eq!(
            told(&changed(|_| String::new())),
            [format!("{head}add a [[replica]] with `stream = \"camera.0/image\"` and `to = [\"desk\"]`")]
        );
        let elsewhere = changed(|replica| replica.replace("desk", "brain"));
        let line = elsewhere.lines().position(|line| line.contains("camera.0/image")).unwrap();
        assert_eq!(told(&elsewhere), [format!("{head}add \"desk\" to `to` of the [[replica]] in line {line}")]);
        let [there, here] = ["desk", "base"].map(|node| format!("name = \"gui.0\"\nnode = \"{node}\""));
        let moved = changed(|_| String::new()).replacen(&there, &here, 1);
        assert_eq!(told(&moved), [""; 0], "beside the camera it reads the stream itself");
    }
}
