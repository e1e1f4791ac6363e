//! A launch from a bundle: its files are verified before anything starts, and its trial is watched.

use crate::terminal::Failure;
use crate::terminal::speech::Speech;
use rohrpost_bundle::{Begun, Bundle, NodeFolder, NodeFolderError, Programs, Trial};
use rohrpost_config::{Installation, duration_text};
use rohrpost_launch::launcher::Phase;
use rohrpost_launch::{Launch, LaunchError, Permit, stop_flag};
use rohrpost_mailbox::sys;
use std::io;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// The end of a trial that cannot be noted on the disk is noted after this time.
const NOTE_AGAIN: Duration = Duration::from_secs(10);

/// The bundle that a launch is from, if it is from one.
pub(super) struct Bundled(Option<InBundle>);

struct InBundle {
    bundle: Bundle,
    trial: Trial,
    /// The file that is launched, by its place in the bundle: what is pushed from now on has no effect on this launch.
    file: PathBuf,
    /// Raised by signals to stop.
    is_told_to_stop: Option<Arc<AtomicBool>>,
    /// When all modules must still be up; `None` before all are on.
    until: Option<Instant>,
    /// Before that the trial is not looked at: its end could not be noted.
    look_at: Instant,
    /// The configuration to be launched, when the node has gone back.
    next: Option<PathBuf>,
}

impl Bundled {
    /// Finds the bundle of a configuration, and begins its trial if that is due. Goes back from a bundle of which the
    /// last launch did not end its trial.
    pub(super) fn begin(file: &Path, speech: &Speech) -> Result<Self, Failure> {
        let mut given = file.to_owned();
        while let Some((node, bundle, file)) = NodeFolder::containing(&given)? {
            let begun = if file == bundle.manifest().configuration().below(bundle.folder()) {
                Trial::begin(&node, bundle.digest())?
            } else {
                Begun::Launch(Trial::beside(&node, bundle.digest())?)
            };
            match begun {
                Begun::Launch(trial) => {
                    let (is_told_to_stop, until, look_at, next) = (None, None, Instant::now(), None);
                    return Ok(Self(Some(InBundle { bundle, trial, file, is_told_to_stop, until, look_at, next })));
                }
                Begun::Back(from, to) => speech.complain(&format!(
                    "bundle version {from}: its launch was killed in its trial, or the computer lost power; back to \
                     version {to}"
                )),
            }
            given = node.configuration()?;
        }
        Ok(Self(None))
    }

    /// The configuration to read, if launch was given this file.
    pub(super) fn file<'f>(&'f self, given: &'f Path) -> &'f Path {
        self.0.as_ref().map_or(given, |inside| &inside.file)
    }

    /// Verifies signature and files, and what the starts of programs need to be permitted. Saved parameters may have
    /// changed since, and modules may have written files. A bundle that is refused, or its configuration, has failed.
    pub(super) fn verify(
        &mut self,
        loaded: Result<Installation, Failure>,
        accept_changed: bool,
        speech: &Speech,
    ) -> Result<(Installation, Permit), Failure> {
        let verified = self.verified(loaded, accept_changed, speech);
        verified.inspect_err(|error| self.fail_start(&error.to_string(), speech))
    }

    fn verified(
        &mut self,
        loaded: Result<Installation, Failure>,
        accept_changed: bool,
        speech: &Speech,
    ) -> Result<(Installation, Permit), Failure> {
        let Some(InBundle { bundle, trial, .. }) = &mut self.0 else { return Ok((loaded?, Arc::new(|_| Ok(())))) };
        let programs = Programs::of(bundle);
        let mut refused: Vec<String> = trial
            .node()
            .trusted()
            .and_then(|trusted| bundle.verify_signature(&trusted))
            .err()
            .iter()
            .map(ToString::to_string)
            .collect();
        for difference in bundle.differences()? {
            if difference.is_harmless() {
                speech.say(&format!("bundle: {difference}"));
            } else {
                refused.push(difference.to_string());
            }
        }
        if refused.is_empty() {
            return Ok((loaded?, Arc::new(move |program| programs.permit(program))));
        }
        let text = format!("bundle {}: {}", bundle.folder().display(), refused.join("\n  "));
        if accept_changed {
            trial.leave_due();
            speech.complain(&format!("warning, --accept-changed-files: {text}"));
            return Ok((loaded?, Arc::new(|_| Ok(()))));
        }
        Err(format!(
            "{text}\nnothing is started; push the bundle again, which repairs it, or launch with --accept-changed-files"
        )
        .into())
    }

    /// Modules are about to start. From now on a signal to stop does not end the process.
    pub(super) fn start(&mut self) -> Result<(), Failure> {
        if let Some(InBundle { trial, is_told_to_stop, .. }) = &mut self.0 {
            *is_told_to_stop = Some(stop_flag()?);
            trial.start()?;
        }
        Ok(())
    }

    /// All modules are on: the time of the trial begins.
    pub(super) fn began(&mut self, speech: &Speech) {
        let Some(InBundle { bundle, trial, until, .. }) = &mut self.0 else { return };
        if trial.is_under_way() {
            let manifest = bundle.manifest();
            *until = Some(Instant::now() + manifest.trial());
            let (version, time) = (manifest.version(), duration_text(manifest.trial()));
            speech.say(&format!("bundle version {version}: its trial has begun; all modules must stay up for {time}"));
        }
    }

    /// Time until there is something to look at.
    pub(super) fn wait(&self) -> Duration {
        let until = self.0.as_ref().and_then(|inside| Some(inside.until?.max(inside.look_at)));
        until.map_or(Duration::MAX, |until| until.saturating_duration_since(Instant::now()))
    }

    /// Looks how the trial goes; true if it has failed. Then the node has gone back, if it could.
    pub(super) fn look(&mut self, launch: &Launch, speech: &Speech) -> bool {
        let Some(InBundle { bundle, trial, until: Some(until), look_at, .. }) = &mut self.0 else { return false };
        let now = Instant::now();
        if now < *look_at {
            return false;
        }
        let is_over = now >= *until;
        let fails = |phase: Phase| match phase {
            Phase::Failed => true,
            Phase::Waiting | Phase::Starting | Phase::Ready => is_over,
            Phase::Running | Phase::StandsBy | Phase::Stopping | Phase::Stopped | Phase::Ended | Phase::LeftOut => {
                false
            }
        };
        let down = launch.phases().filter(|(_, phase)| fails(*phase));
        let mut down: Vec<String> = down.map(|(module, phase)| format!("{module} is {}", phase.name())).collect();
        if is_over {
            down.extend(launch.not_on());
        }
        if !down.is_empty() {
            return self.fail(&format!("did not stay up: {}", down.join(", ")), speech);
        }
        if is_over {
            let version = bundle.manifest().version();
            match trial.pass() {
                Ok(()) => {
                    speech.say(&format!("bundle version {version} has passed its trial"));
                    self.end_trial();
                }
                Err(error) => {
                    speech.complain(&format!("bundle version {version} has passed its trial; not noted: {error}"));
                    *look_at = now + NOTE_AGAIN;
                }
            }
        }
        false
    }

    /// The launch could not start its modules. What is no fault of the bundle leaves its trial due.
    pub(super) fn did_not_start(&mut self, error: &LaunchError, speech: &Speech) {
        match error {
            LaunchError::NotReady { .. } | LaunchError::Programs(_) => self.fail_start(&error.to_string(), speech),
            _ => self.told_to_stop(speech),
        }
    }

    fn fail_start(&mut self, why: &str, speech: &Speech) {
        self.fail(&format!("did not start: {}", why.lines().next().unwrap_or_default()), speech);
    }

    /// The launch ends, and not for a fault of the bundle.
    pub(super) fn told_to_stop(&mut self, speech: &Speech) {
        let Some(InBundle { trial, next: None, .. }) = &mut self.0 else { return };
        if let Err(error) = trial.interrupt() {
            speech.complain(&format!("bundle: that its trial was interrupted is not noted: {error}"));
        }
    }

    /// The configuration to be launched, if the node has gone back and nobody has told launch to stop.
    pub(super) fn next(&self) -> Option<&Path> {
        let InBundle { next, is_told_to_stop, .. } = self.0.as_ref()?;
        let is_over = is_told_to_stop.as_ref().is_some_and(|told| told.load(Ordering::Acquire));
        next.as_deref().filter(|_| !is_over)
    }

    /// True if a trial was under way, which has failed now; false also if that cannot be noted yet.
    fn fail(&mut self, why: &str, speech: &Speech) -> bool {
        let Some(InBundle { bundle, trial, look_at, next, .. }) = &mut self.0 else { return false };
        if !trial.is_under_way() {
            return false;
        }
        let version = bundle.manifest().version();
        let failed = trial.fail().and_then(|back| {
            *next = back.map(|_| trial.node().configuration()).transpose()?;
            Ok(back)
        });
        let is_busy = matches!(failed, Err(NodeFolderError::Busy(_)));
        let then = match failed {
            Ok(Some((_, to))) => format!("back to version {to}"),
            Ok(None) => "it stays: there is no whole bundle before it, or another is current by now".into(),
            Err(error) => format!("it could not go back: {error}"),
        };
        speech.complain(&format!("bundle version {version} {why}; {then}"));
        if is_busy {
            *look_at = Instant::now() + NOTE_AGAIN;
        } else {
            self.end_trial();
        }
        !is_busy
    }

    fn end_trial(&mut self) {
        if let Some(inside) = &mut self.0 {
            inside.until = None;
        }
    }
}

/// Becomes the launch of another configuration, in the same process, so that a service manager sees one that goes on.
/// That launch begins as this one began: with the other arguments, and scheduled as before. Returns only if that fails.
pub(super) fn launch_again(given: &Path, next: &Path, scheduling: Option<sys::Scheduling>) -> io::Error {
    if let Some(scheduling) = scheduling {
        // It was raised for the starts of modules; to lower it is always allowed.
        let _ = sys::schedule(scheduling);
    }
    let mut words = std::env::args_os();
    let name = words.next().unwrap_or_else(|| "rohrpost".into());
    let words = words.map(|word| if word == given.as_os_str() { next.into() } else { word });
    Command::new("/proc/self/exe").arg0(name).args(words).exec()
}
