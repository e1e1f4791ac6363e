//! Answers to commands that are in journals: a replay in which the modules do not run gives them.

use super::journals;
use crate::terminal::{Failure, complain};
use rohrpost_config::{Installation, Module};
use rohrpost_mailbox::Name;
use rohrpost_recorder::player::JournalAnswers;
use rohrpost_recording::Info;
use std::path::Path;

/// Of all answers together.
const ANSWERS_BYTES_MAX: usize = 64 << 20;

/// Of these modules of an installation, in files that follow one another. Their journals are put together in a
/// folder of their own within this one, and removed.
pub(crate) fn read_answers(
    files: &[Info],
    (installation, modules): (&Installation, &[String]),
    folder: &Path,
) -> Result<JournalAnswers, Failure> {
    let folder = tempfile::tempdir_in(folder)?;
    let (mut all, mut room) = (JournalAnswers::default(), Some(ANSWERS_BYTES_MAX));
    for run in journals::of_files(files, modules, folder.path())? {
        let exact = run.exact();
        let (installation, module) = match run.readable(&exact) {
            Ok(recorded) => recorded,
            Err(why) => {
                let name = installation.classes.parse_module(&run.module);
                let mut names = name.map_or(Vec::new(), |name| names_of(installation, name));
                // As the journal's channel has it, whatever the configuration has.
                names.push(run.module);
                all.unreadable.extend(names.into_iter().map(|name| (name, why.clone())));
                continue;
            }
        };
        let names = names_of(&installation, module);
        exact.each_answer(|answer| {
            let Some(name) = names.get(usize::from(answer.endpoint)) else { return true };
            room = room.and_then(|room| room.checked_sub(answer.bytes() + name.len()));
            if room.is_some() {
                all.answers.push((name.clone(), answer));
            }
            room.is_some()
        })?;
        all.names.extend(names);
    }
    if room.is_none() {
        complain(format_args!(
            "the answers to commands are more than {} MiB: those behind that are not played",
            ANSWERS_BYTES_MAX >> 20
        ));
    }
    Ok(all)
}

/// All names of a module, its own first.
fn names_of(installation: &Installation, module: Name) -> Vec<String> {
    let names = installation.module(module).into_iter().flat_map(Module::names);
    names.map(|name| installation.classes.format(name)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost::schema::Type;
    use rohrpost_modules::journal::{JOURNAL_NAME, JOURNAL_NUMBER, Piece};
    use rohrpost_recording::{ChannelSpec, Message, Options, Session, Writer, info};

    const CONFIG: &str = r#"
installation = "test"
[system]
name = "robot"
id = 1
[classes]
motor = { id = 200 }
odometry = { id = 160 }
tool = { id = 16 }
[nodes.main]
[[module]]
name = "motor.0"
aliases = ["odometry.0"]
program = "motor"
"#;

    /// A recording with one piece of this module's journal.
    fn recorded(folder: &Path, module: &str, offset: u64) {
        let options = Options { leave_bytes: 0, ..Options::new(folder, "base") };
        let mut writer = Writer::start(options, Session::default()).unwrap();
        let texts = [("number".to_owned(), JOURNAL_NUMBER.to_string())].into();
        let channel = writer.channel(&ChannelSpec { name: module, item: JOURNAL_NAME, ty: &Type::Bytes, texts });
        let mut record = [0; 64];
        let bytes = b"entries of some other version";
        let len = Piece { incarnation: 1, offset, bytes }.write(&mut record);
        let message = Message { arrival_ns: 5, stamp_ns: 5, epoch: 1, sequence: 0, data: &record[..len] };
        writer.write(channel.unwrap(), &message).unwrap();
        writer.finish().1.unwrap();
    }

    #[test]
    fn why_a_journal_has_no_answers_is_told_for_each_name_of_its_module() {
        let installation = Installation::parse(CONFIG, Path::new("robot.toml")).unwrap();
        for (module, offset, names, why) in [
            ("motor.0", 0, &["motor.0", "odometry.0"][..], "or it is of another version"),
            ("motor.0", 9, &["motor.0", "odometry.0"], "its journal began 9 bytes before the recording did; record"),
            ("gone.0", 9, &["gone.0"], "its journal began 9 bytes before"),
        ] {
            let folder = tempfile::tempdir().unwrap();
            recorded(folder.path(), module, offset);
            let file = info(&folder.path().join("base-0001.mcap")).unwrap();
            let read = read_answers(&[file], (&installation, &[]), folder.path()).unwrap();
            assert!(read.names.is_empty() && read.answers.is_empty());
            assert!(read.unreadable.keys().eq(names), "{:?}", read.unreadable);
            assert!(read.unreadable.values().all(|told| told.contains(why)), "{:?}", read.unreadable);
        }
    }
}
