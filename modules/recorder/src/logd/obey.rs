//! What the commands of log control do, however they came.

use super::control::{OpenOrder, Told};
use super::folder::below;
use super::{Logd, has_begun};
use rohrpost_recording::{ControlAnswer, ControlCommand, FileChange, Mark, OrderError, PendingOrder, Status, Writer};
use std::path::PathBuf;

/// Both as users write it: seconds since 1970.
const NS_PER_S: u64 = 1_000_000_000;

impl Logd {
    /// Carries out a command, or begins to.
    pub(super) fn obey(&mut self, command: ControlCommand) -> Told {
        let told = match command {
            ControlCommand::On => self.switch_on(),
            ControlCommand::Off => self.switch_off(),
            ControlCommand::Directory(path) => self.go_to(&path),
            ControlCommand::Status => Err(self.how_it_goes()),
            ControlCommand::Mark(text) => self.mark(text),
            ControlCommand::Rotate => {
                self.present_writer().and_then(|writer| open(writer.rotate(), OpenOrder::Rotated))
            }
        };
        match told {
            Ok(order) => {
                let told = self.orders.add_open(order);
                self.look_at_orders();
                told
            }
            Err(answer) => Told::Now(answer),
        }
    }

    /// Tells what became of orders that are open.
    pub(super) fn look_at_orders(&mut self) {
        if let Some(ended) = self.ending.take_if(|writer| !writer.status().is_running) {
            self.finish(ended);
        }
        let Self { orders, options, writer, ending, ended, .. } = self;
        orders.poll(|order| match order {
            OpenOrder::Begun => begun(writer.as_ref().map(Writer::status).as_ref()),
            OpenOrder::Ending => ending.is_none().then(|| ended.clone()),
            OpenOrder::Rotated(pending) => changed(pending, |answer| answer),
            OpenOrder::Marked(pending, time_ns) => changed(pending, |answer| {
                let (s, ns) = (time_ns / NS_PER_S, time_ns % NS_PER_S);
                answer.with("time", format_args!("{s}.{ns:09}"))
            }),
            OpenOrder::Moved(pending, folder) => changed(pending, |answer| {
                options.folder.clone_from(folder);
                with_path(answer, "directory", Some(folder))
            }),
        });
    }

    fn switch_on(&mut self) -> Result<OpenOrder, ControlAnswer> {
        if self.ending.is_some() {
            return Err(ControlAnswer::err(&"the recording before is still being closed; try again"));
        }
        if self.writer.is_none() {
            self.begin().map_err(|error| ControlAnswer::err(&error))?;
            tracing::info!("records again, as log control says");
        }
        Ok(OpenOrder::Begun)
    }

    fn switch_off(&mut self) -> Result<OpenOrder, ControlAnswer> {
        if let Some(mut writer) = self.writer.take() {
            writer.begin_end();
            self.earlier = Some(writer.passed_over());
            self.ending = Some(writer);
            tracing::info!("records no more, as log control says");
        }
        Ok(OpenOrder::Ending)
    }

    fn go_to(&mut self, path: &str) -> Result<OpenOrder, ControlAnswer> {
        let folder = below(&self.root, path, self.folder_mode).map_err(|error| ControlAnswer::err(&error))?;
        let Some(writer) = &mut self.writer else {
            let answer = with_path(ControlAnswer::ok(), "directory", Some(&folder));
            self.options.folder = folder;
            return Err(answer);
        };
        open(writer.move_to(folder.clone()), |pending| OpenOrder::Moved(pending, folder))
    }

    fn mark(&mut self, text: String) -> Result<OpenOrder, ControlAnswer> {
        if !has_begun(&self.clock) {
            return Err(ControlAnswer::err(&"there is no time yet: the log that is played has not begun"));
        }
        let now = self.clock.now();
        let mark = Mark { time_ns: now.ns, epoch: now.epoch, text: text.into() };
        open(self.present_writer()?.mark(mark), |pending| OpenOrder::Marked(pending, now.ns))
    }

    /// The one that writes now, if it does.
    fn present_writer(&mut self) -> Result<&mut Writer, ControlAnswer> {
        let Some(writer) = &mut self.writer else {
            return Err(ControlAnswer::err(&"nothing is recorded; say `on` first"));
        };
        match writer.status().problem {
            Some(problem) => Err(ControlAnswer::err(&format!("nothing is written: {}", problem.error))),
            None => Ok(writer),
        }
    }

    fn how_it_goes(&self) -> ControlAnswer {
        let answer = ControlAnswer::ok().with("recording", if self.writer.is_some() { "on" } else { "off" });
        let answer = with_path(answer, "directory", Some(&self.options.folder));
        let Some(status) = self.writer.as_ref().map(Writer::status) else { return answer };
        let answer = with_path(answer, "file", status.file.as_ref())
            .with("channels", status.channels.len())
            .with("written", status.written)
            .with("synced", status.synced)
            .with("unsure", status.unsure)
            .with("lost", status.lost)
            .with("waiting", status.waiting)
            .with("bytes", status.bytes)
            .with("files_closed", status.files_closed)
            .with("files_torn", status.files_torn);
        match &status.problem {
            Some(problem) => answer.with_text("problem", &problem.error.to_string()),
            None => answer,
        }
    }
}

/// An order that went into the queue, or why it did not.
fn open(
    told: Result<PendingOrder, OrderError>,
    order: impl FnOnce(PendingOrder) -> OpenOrder,
) -> Result<OpenOrder, ControlAnswer> {
    told.map(order).map_err(|error| ControlAnswer::err(&error))
}

/// A recording that has begun has a file, or says why not.
fn begun(status: Option<&Status>) -> Option<ControlAnswer> {
    let Some(status) = status else { return Some(ControlAnswer::err(&"it was switched off again")) };
    match (&status.file, &status.problem) {
        (Some(file), _) => Some(with_path(ControlAnswer::ok(), "file", Some(file))),
        (None, Some(problem)) => Some(ControlAnswer::err(&format!("it is on, but writes nothing: {}", problem.error))),
        (None, None) => None,
    }
}

/// What became of an order to the thread that writes; `more` adds to a good answer.
fn changed(pending: &PendingOrder, more: impl FnOnce(ControlAnswer) -> ControlAnswer) -> Option<ControlAnswer> {
    Some(match pending.poll()? {
        Ok(FileChange { closed, file }) => {
            let answer = with_path(ControlAnswer::ok(), "closed", closed.as_ref());
            more(with_path(answer, "file", Some(&file)))
        }
        Err(error) => ControlAnswer::err(&error),
    })
}

/// Tells a path, if there is one.
fn with_path(answer: ControlAnswer, key: &str, path: Option<&PathBuf>) -> ControlAnswer {
    path.into_iter().fold(answer, |answer, path| answer.with_text(key, &path.to_string_lossy()))
}
