//! Journals in a recording, put together of their pieces: each in a file, however long it is.

use crate::quota::UnpackedQuota;
use crate::record::ProgressLine;
use crate::terminal::Failure;
use rohrpost::output::plain;
use rohrpost_config::Installation;
use rohrpost_mailbox::Name;
use rohrpost_modules::journal::{ExactRun, JOURNAL_NAME, JOURNAL_NUMBER, Piece};
use rohrpost_recording::{Info, ReadError, Reader, RecordedChannel, info};
use std::collections::BTreeSet;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// Runs in one recording.
const RUNS_MAX: usize = 10_000;
/// Of a line of a configuration in a message.
const LINE_CHARS_MAX: usize = 200;

/// The journal of one run of a module: from its start to its end, or as far as it was recorded.
#[derive(Debug)]
pub(super) struct RecordedRun {
    pub(super) module: String,
    /// Tells it from other runs of the module.
    incarnation: u32,
    /// File with its entries.
    journal: PathBuf,
    len: u64,
    /// Why it goes on no further, if it should.
    pub(super) ends: Option<String>,
    /// Why it cannot be replayed at all: its beginning is missing.
    pub(super) begins_late: Option<String>,
    /// Configurations that the recording says it was made with.
    configurations: Rc<BTreeSet<String>>,
}

/// Runs that are being put together.
struct PiecedRuns<'a> {
    runs: Vec<RecordedRun>,
    folder: &'a Path,
    quota: &'a mut UnpackedQuota,
    configurations: Rc<BTreeSet<String>>,
    /// The file of the run to which a piece was added last.
    open: Option<(usize, File)>,
}

/// Journals of these modules, or of all, in the order in which they begin; put together in that folder.
pub(super) fn read(
    file: &Path,
    modules: &[String],
    folder: &Path,
    quota: &mut UnpackedQuota,
) -> Result<Vec<RecordedRun>, Failure> {
    // Where the file does not tell, since its index is damaged, no configuration is the recorded one.
    let untold = || Rc::new(BTreeSet::from([String::new()]));
    let known = info(file).map_or_else(|_| untold(), |info| configurations(&[info]));
    let mut pieced = PiecedRuns::new(folder, quota, known);
    let damage = pieced.take_all(file, modules, |_, _| {})?;
    let mut runs = pieced.runs;
    if let Some(error) = &damage {
        // What comes behind it may be whole; but no journal is.
        let why = format!("the recording is damaged or cut off here: {error}");
        for run in &mut runs {
            run.ends.get_or_insert_with(|| why.clone());
        }
    }
    let missing = modules.iter().find(|module| !runs.iter().any(|run| run.module == **module));
    match (missing, damage) {
        (Some(_), Some(error)) => Err(error.into()),
        (None, Some(error)) if runs.is_empty() => Err(error.into()),
        (Some(module), None) => Err(no_journal(file, Some(module))),
        (None, None) if runs.is_empty() => Err(no_journal(file, None)),
        (None, _) => Ok(runs),
    }
}

/// Those of these modules in files that follow one another, as far as they are whole.
pub(super) fn of_files(files: &[Info], modules: &[String], folder: &Path) -> Result<Vec<RecordedRun>, Failure> {
    let paths: Vec<&Path> = files.iter().map(|file| file.path.as_path()).collect();
    let mut quota = UnpackedQuota::of_files(&paths);
    let mut pieced = PiecedRuns::new(folder, &mut quota, configurations(files));
    let mut progress = ProgressLine::new();
    for path in paths {
        // Behind a damage a piece is missing.
        pieced.take_all(path, modules, |read, all| progress.tell(read, all))?;
    }
    Ok(pieced.runs)
}

/// What the files say of themselves.
fn configurations(files: &[Info]) -> Rc<BTreeSet<String>> {
    files.iter().flat_map(Info::configurations).map(|(_, text)| text.to_owned()).collect::<BTreeSet<_>>().into()
}

fn is_wanted(channel: &RecordedChannel, modules: &[String]) -> bool {
    let is_journal = channel.item == JOURNAL_NAME
        && channel.texts.get("number").is_some_and(|number| *number == JOURNAL_NUMBER.to_string());
    is_journal && (modules.is_empty() || modules.iter().any(|module| channel.name == *module))
}

impl<'a> PiecedRuns<'a> {
    fn new(folder: &'a Path, quota: &'a mut UnpackedQuota, configurations: Rc<BTreeSet<String>>) -> Self {
        Self { runs: Vec::new(), folder, quota, configurations, open: None }
    }

    /// Takes what a file has of these modules, up to what is wrong with it.
    fn take_all(
        &mut self,
        file: &Path,
        modules: &[String],
        mut progress: impl FnMut(u64, u64),
    ) -> Result<Option<ReadError>, Failure> {
        let mut reader = Reader::open(file)?;
        loop {
            match reader.next() {
                Ok(Some((channel, message))) if is_wanted(&channel, modules) => self.take(&channel, message.data)?,
                Ok(Some(_)) => {}
                Ok(None) => return Ok(None),
                Err(error) => return Ok(Some(error)),
            }
            let (read, all) = reader.progress();
            progress(read, all);
        }
    }

    fn take(&mut self, channel: &RecordedChannel, value: &[u8]) -> Result<(), Failure> {
        let (module, is_repeated) = (channel.name.as_str(), channel.is_repeated());
        let Some(Piece { incarnation, offset, bytes }) = Piece::read(value) else { return Ok(()) };
        let is_it = |run: &RecordedRun| (run.module.as_str(), run.incarnation) == (module, incarnation);
        // After the node's memory was made anew, incarnations are counted from the beginning: then a run begins that
        // has the incarnation of another one. What a file repeats of the one before it begins none.
        let goes_on = |run: &RecordedRun| offset > 0 || is_repeated || (run.len == 0 && run.begins_late.is_none());
        let at = match self.runs.iter().rposition(is_it).filter(|at| goes_on(&self.runs[*at])) {
            Some(at) => at,
            None => self.begin(module, incarnation, offset)?,
        };
        let run = &mut self.runs[at];
        if run.ends.is_some() || run.begins_late.is_some() || offset < run.len {
            return Ok(());
        }
        match offset - run.len {
            0 => self.append(at, bytes),
            lost => {
                run.ends = Some(format!("{lost} bytes of the journal were not recorded: the recorder was too slow"));
                Ok(())
            }
        }
    }

    /// Its place.
    fn begin(&mut self, module: &str, incarnation: u32, offset: u64) -> Result<usize, Failure> {
        let at = self.runs.len();
        if at == RUNS_MAX {
            return Err(
                format!("more than {RUNS_MAX} runs of modules; cut the recording: `rohrpost record cut`").into()
            );
        }
        let begins_late = (offset > 0).then(|| {
            format!(
                "its journal began {offset} bytes before the recording did; record from the module's start on, or \
                 `rohrpost record merge` this file with the one before it"
            )
        });
        let (module, journal) = (module.to_owned(), self.folder.join(format!("journal-{at}")));
        let configurations = self.configurations.clone();
        self.runs.push(RecordedRun { module, incarnation, journal, len: 0, ends: None, begins_late, configurations });
        Ok(at)
    }

    fn append(&mut self, at: usize, bytes: &[u8]) -> Result<(), Failure> {
        self.quota.take(bytes.len())?;
        let run = &mut self.runs[at];
        let failed = |error: std::io::Error| format!("{}: {error}", run.journal.display());
        let open = self.open.take().filter(|(of, _)| *of == at).map(|(_, file)| Ok(file));
        let mut file =
            open.unwrap_or_else(|| File::options().create(true).append(true).open(&run.journal)).map_err(failed)?;
        file.write_all(bytes).map_err(failed)?;
        run.len += bytes.len() as u64;
        self.open = Some((at, file));
        Ok(())
    }
}

impl RecordedRun {
    /// As its program reads it; still without the places of other files.
    pub(super) fn exact(&self) -> ExactRun {
        let journal = self.journal.display().to_string();
        ExactRun { folder: None, report: String::new(), ends: self.ends.clone(), journal, records: None }
    }

    /// The same of a journal that is there from its beginning on; else why it is not.
    pub(super) fn readable(&self, exact: &ExactRun) -> Result<(Installation, Name), String> {
        self.begins_late.clone().map_or_else(|| self.installation(exact), Err)
    }

    /// Why what it names is not run: its configuration is not that of the recording. The journal has it from the
    /// module, the recording from its recorder. Where only the user's own program runs, a module that was restarted
    /// after its configuration was edited is repeated like any other.
    pub(super) fn contradiction(&self, installation: &Installation) -> Option<String> {
        let contradicts = !self.configurations.is_empty() && !self.configurations.contains(&installation.text);
        contradicts.then(|| contradiction(&installation.text, &self.configurations))
    }

    /// The configuration as it was then, and the module: that of the channel.
    pub(super) fn installation(&self, exact: &ExactRun) -> Result<(Installation, Name), String> {
        let (installation, name) = exact.installation().map_err(|error| error.to_string())?;
        let named = installation.classes.format(name);
        if named != self.module {
            return Err(format!("the journal that was recorded of {} is of another module: {named}", self.module));
        }
        Ok((installation, name))
    }
}

/// Where a journal's configuration is another one than those of the recording.
fn contradiction(text: &str, recorded: &BTreeSet<String>) -> String {
    let alike = |other: &str| text.lines().zip(other.lines()).take_while(|(one, other)| one == other).count();
    let nearest = recorded.iter().max_by_key(|other| alike(other)).map_or("", String::as_str);
    let at = alike(nearest);
    let line = |text: &str| {
        let line = text.lines().nth(at).map(|line| line.chars().take(LINE_CHARS_MAX).collect::<String>());
        line.map_or("ends there".to_owned(), |line| format!("has `{line}`"))
    };
    format!(
        "the configuration in its journal is not the one that the recording says it was made with (`rohrpost record \
         info --json`): in line {} the journal {}, and the recording {}. Either the file was altered, or the \
         configuration was while it was recorded",
        at + 1,
        line(text),
        line(nearest)
    )
}

fn no_journal(file: &Path, module: Option<&String>) -> Failure {
    let name = plain::line(module.map_or("pilot.0", String::as_str));
    let of = module.map_or_else(String::new, |_| format!(" of {name}"));
    format!(
        "{}: no journal{of}; name the module in [record] of the configuration before it is recorded, \
         `exact = [\"{name}\"]`",
        file.display()
    )
    .into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(incarnation: u32, offset: u64, bytes: &[u8]) -> Vec<u8> {
        let mut record = vec![0; 64];
        let len = Piece { incarnation, offset, bytes }.write(&mut record);
        record.truncate(len);
        record
    }

    fn channel(module: &str, is_repeated: bool) -> RecordedChannel {
        let texts = is_repeated.then(|| ("repeated".to_owned(), String::new()));
        RecordedChannel {
            topic: format!("{module}/{JOURNAL_NAME}").into(),
            name: module.into(),
            item: JOURNAL_NAME.into(),
            texts: texts.into_iter().collect(),
            ..RecordedChannel::default()
        }
    }

    #[test]
    fn a_run_begins_at_nothing_unless_the_file_repeats_it() {
        let folder = tempfile::tempdir().unwrap();
        let mut quota = UnpackedQuota::new(1 << 20);
        let mut pieced = PiecedRuns::new(folder.path(), &mut quota, Rc::default());
        for (is_repeated, offset, bytes) in [
            (false, 7, &b"late"[..]),
            (false, 0, b"a"),
            (true, 0, b"a"),
            (false, 1, b"b"),
            (true, 1, b"b"),
            (false, 2, b"c"),
            (false, 0, b"x"),
        ] {
            pieced.take(&channel("pilot.0", is_repeated), &record(5, offset, bytes)).unwrap();
        }
        let runs = pieced.runs;
        assert!(runs[0].begins_late.is_some());
        let journals = runs[1..].iter().map(|run| std::fs::read_to_string(&run.journal).unwrap());
        assert_eq!(journals.collect::<Vec<_>>(), ["abc", "x"]);
    }

    #[test]
    fn a_configuration_that_is_not_the_recorded_one_is_told_by_its_first_other_line() {
        let recorded = ["[\"pilot.0\"]\nspeed = 1\n", "a = 1\nprogram = \"pilot\"\n"];
        let recorded = recorded.map(str::to_owned).into();
        for (text, told) in [
            (
                "a = 1\nprogram = \"sh\"\n",
                "in line 2 the journal has `program = \"sh\"`, and the recording has `program = \"pilot\"`",
            ),
            ("a = 1\nprogram = \"pilot\"\nb = 2\n", "in line 3 the journal has `b = 2`, and the recording ends there"),
        ] {
            let said = contradiction(text, &recorded);
            assert!(said.contains(told), "{said}");
        }
    }

    #[test]
    fn too_many_runs_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let mut quota = UnpackedQuota::new(1 << 20);
        let mut pieced = PiecedRuns::new(folder.path(), &mut quota, Rc::default());
        let channel = channel("pilot.0", false);
        let mut begin = |incarnation| pieced.take(&channel, &record(incarnation, 9, b"late"));
        (0..RUNS_MAX as u32).for_each(|incarnation| begin(incarnation).unwrap());
        assert!(begin(u32::MAX).unwrap_err().to_string().starts_with("more than 10000 runs "));
    }

    #[test]
    fn a_journal_takes_no_more_disk_than_it_may() {
        let folder = tempfile::tempdir().unwrap();
        let mut quota = UnpackedQuota::new(5);
        let mut pieced = PiecedRuns::new(folder.path(), &mut quota, Rc::default());
        let channel = channel("pilot.0", false);
        pieced.take(&channel, &record(5, 0, b"abc")).unwrap();
        let told = pieced.take(&channel, &record(5, 3, b"def")).unwrap_err().to_string();
        assert!(told.starts_with("what is to be unpacked of it takes more than 5 B on the disk"), "{told}");
        assert_eq!(std::fs::read_to_string(&pieced.runs[0].journal).unwrap(), "abc");
    }

    #[test]
    fn pieces_are_put_together_until_one_is_missing() {
        let folder = tempfile::tempdir().unwrap();
        let mut quota = UnpackedQuota::new(1 << 20);
        let mut pieced = PiecedRuns::new(folder.path(), &mut quota, Rc::default());
        for (module, incarnation, offset, bytes) in [
            ("pilot.0", 5, 0, &b"ab"[..]),
            ("mapper.0", 6, 9, b"x"),
            ("pilot.0", 7, 0, b"z"),
            ("pilot.0", 5, 2, b"cd"),
            ("pilot.0", 5, 2, b"cd"),
            ("pilot.0", 5, 7, b"h"),
            ("pilot.0", 5, 4, b"efg"),
            ("mapper.0", 6, 10, b"y"),
            ("pilot.0", 7, 0, b"new"),
            ("pilot.0", 7, 3, b"er"),
        ] {
            pieced.take(&channel(module, false), &record(incarnation, offset, bytes)).unwrap();
        }
        pieced.take(&channel("pilot.0", false), b"no piece").unwrap();
        let runs = pieced.runs;
        let told: Vec<(&str, Option<String>, bool, bool)> = runs
            .iter()
            .map(|run| {
                let journal = std::fs::read_to_string(&run.journal).ok();
                (run.module.as_str(), journal, run.ends.is_some(), run.begins_late.is_some())
            })
            .collect();
        let expected = [
            ("pilot.0", Some("abcd"), true, false),
            ("mapper.0", None, false, true),
            ("pilot.0", Some("z"), false, false),
            ("pilot.0", Some("newer"), false, false),
        ];
        assert_eq!(told, expected.map(|(module, text, ends, late)| (module, text.map(str::to_owned), ends, late)));
        assert!(runs[0].ends.as_ref().is_some_and(|why| why.starts_with("3 bytes ")), "{:?}", runs[0].ends);
    }
}
