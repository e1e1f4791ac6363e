//! Where a drawing goes.

use crate::files;
use rerun::external::re_log_types::RecordingId;
use rerun::external::re_uri;
use rerun::log::ChunkBatcherConfig;
use rerun::{ApplicationId, RecordingStream, RecordingStreamBuilder, SpawnError, SpawnOptions};
use std::io::ErrorKind;
use std::path::PathBuf;
use std::time::Duration;

/// What may wait inside of Rerun before drawing blocks.
const BYTES_IN_FLIGHT: u64 = 8 * 1024 * 1024;

/// Where a drawing goes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Sink {
    /// A new `.rrd` file, to be opened with `rerun FILE`. Whole only after the scene was closed. One that is there
    /// already becomes `NAME.old.rrd`.
    File {
        /// Where it is.
        path: PathBuf,
        /// When it has this size, it becomes `NAME.old.rrd` in place of the one before, and a new one is begun with all
        /// that is on the screen then.
        bytes_max: u64,
    },
    /// A viewer that runs, or will run: `rerun+http://127.0.0.1:9876/proxy`.
    Viewer(String),
    /// A viewer started now, which outlives the scene; needs `rerun` in the `PATH`.
    Window,
}

impl Sink {
    /// A file of any size.
    pub fn file(path: impl Into<PathBuf>) -> Self {
        Self::File { path: path.into(), bytes_max: u64::MAX }
    }
}

/// Why a scene could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The file cannot be written.
    #[error("cannot write the drawing to {path}: {cause}")]
    File {
        /// The file asked for.
        path: PathBuf,
        /// What the system says.
        cause: std::io::Error,
    },
    /// A drawing is there already, and stays where it is.
    #[error("cannot rename {path} to {old}: {cause}")]
    PutAside {
        /// The file asked for.
        path: PathBuf,
        /// Where it should go.
        old: PathBuf,
        /// What the system says.
        cause: std::io::Error,
    },
    /// Rerun does not write to the file.
    #[error("Rerun cannot write the drawing: {0}")]
    Save(rerun::RecordingStreamError),
    /// The address is none.
    #[error("`{url}` is no viewer's address: {cause}; write rerun+http://HOST:9876/proxy")]
    Viewer {
        /// The address asked for.
        url: String,
        /// What is wrong with it.
        cause: String,
    },
    /// No viewer is installed.
    #[error("no Rerun viewer is in PATH; install one with `pip install rerun-sdk==0.36.3`, or draw to a file")]
    NoViewer,
    /// No viewer came up.
    #[error("the Rerun viewer does not start: {0}")]
    Window(SpawnError),
    /// The connection to the viewer.
    #[error("cannot connect to the viewer: {0}")]
    Connect(rerun::RecordingStreamError),
    /// The system said no.
    #[error("cannot begin to draw: {0}")]
    System(#[from] std::io::Error),
}

impl OpenError {
    /// Whether it comes right when there is room again.
    pub(crate) fn is_for_want_of_room(&self) -> bool {
        let Self::File { cause, .. } = self else { return false };
        matches!(cause.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded)
    }
}

/// Why the last of a drawing may be missing.
#[derive(Debug, thiserror::Error)]
pub enum CloseError {
    /// The sink did not take all: the disk is full, or the viewer went away.
    #[error("the end of the drawing did not arrive: {0}")]
    Flush(#[from] rerun::sink::SinkFlushError),
    /// Rerun could not take the layout: a bug in this crate.
    #[error("Rerun refused the layout: {0}")]
    Layout(#[from] rerun::RecordingStreamError),
    /// Rerun writes the end of a file when nobody asks any more, and does not say when it cannot.
    #[error("the end of the drawing is not in its file, as if the disk were full; the rest can be read")]
    Torn,
    /// Nothing was drawn any more.
    #[error("it was not drawn: {0}")]
    Failed(String),
    /// It stands still.
    #[error("the end of the drawing did not arrive: its sink stands still")]
    Stuck,
}

/// Where a viewer listens.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Address {
    /// As it was written.
    pub(crate) url: String,
    pub(crate) host: String,
    pub(crate) port: u16,
}

impl Address {
    pub(crate) fn parse(url: &str) -> Result<Self, OpenError> {
        let wrong = |cause: String| OpenError::Viewer { url: url.into(), cause };
        let parsed: re_uri::ProxyUri = url.parse().map_err(|error: re_uri::Error| wrong(error.to_string()))?;
        let origin = parsed.origin;
        if origin.scheme != re_uri::Scheme::RerunHttp {
            return Err(wrong("a bridge speaks to viewers without encryption only".into()));
        }
        // An IPv6 address stands in brackets in a URL, but not where names are resolved.
        let host = origin.host.to_string().trim_matches(['[', ']']).to_owned();
        Ok(Self { url: url.into(), host, port: origin.port })
    }

    /// Where a viewer listens that was started without further words.
    pub(crate) fn of_window() -> Self {
        Self { url: "the window".into(), host: "127.0.0.1".into(), port: rerun::DEFAULT_SERVER_PORT }
    }
}

/// What one stream is made of.
#[derive(Clone)]
pub(crate) struct StreamConfig {
    pub(crate) application: ApplicationId,
    /// The same for all streams of a scene: a viewer that was away for a while goes on with the recording it has.
    pub(crate) recording: RecordingId,
    pub(crate) target: StreamTarget,
}

/// Where one stream goes.
#[derive(Clone)]
pub(crate) enum StreamTarget {
    /// What is there is put aside if it has so many bytes.
    File { path: PathBuf, aside_from: u64 },
    /// The near end of a [`crate::viewer_proxy::ViewerProxy`].
    Viewer(String),
}

/// A stream without a layout yet.
pub(crate) fn open(config: &StreamConfig) -> Result<RecordingStream, OpenError> {
    // A chunk costs more than a kilobyte besides its rows. So a file gets large ones, and a crash of the bridge loses
    // two seconds; a viewer is shown changes within a blink.
    let flush_tick = Duration::from_millis(match config.target {
        StreamTarget::File { .. } => 2000,
        StreamTarget::Viewer(_) => 40,
    });
    let batching =
        ChunkBatcherConfig { flush_tick, max_bytes_in_flight: BYTES_IN_FLIGHT, ..ChunkBatcherConfig::DEFAULT };
    let builder = RecordingStreamBuilder::new(config.application.clone())
        .recording_id(config.recording.clone())
        .batcher_config(batching);
    match &config.target {
        StreamTarget::File { path, aside_from } => {
            files::begin(path, *aside_from)?;
            builder.save(path).map_err(OpenError::Save)
        }
        StreamTarget::Viewer(url) => builder.connect_grpc_opts(url.as_str()).map_err(OpenError::Connect),
    }
}

/// Starts a viewer, unless one runs already.
pub(crate) fn start_window() -> Result<(), OpenError> {
    let options = SpawnOptions {
        memory_limit: "1GiB".into(),
        server_memory_limit: "128MiB".into(),
        wait_for_bind: true,
        extra_args: vec!["--bind".into(), "127.0.0.1".into()],
        ..SpawnOptions::default()
    };
    match rerun::spawn(&options) {
        Ok(_) => Ok(()),
        Err(SpawnError::ExecutableNotFoundInPath { .. }) => Err(OpenError::NoViewer),
        Err(error) => Err(OpenError::Window(error)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scene;
    use std::sync::{Arc, Mutex};
    use tracing::span::{Attributes, Id, Record};
    use tracing::{Event, Level, Metadata, Subscriber};

    /// Notes how important events are.
    #[derive(Default)]
    struct Levels(Arc<Mutex<Vec<Level>>>);

    impl Subscriber for Levels {
        fn enabled(&self, _: &Metadata<'_>) -> bool {
            true
        }

        fn new_span(&self, _: &Attributes<'_>) -> Id {
            Id::from_u64(1)
        }

        fn record(&self, _: &Id, _: &Record<'_>) {}

        fn record_follows_from(&self, _: &Id, _: &Id) {}

        fn event(&self, event: &Event<'_>) {
            self.0.lock().unwrap().push(*event.metadata().level());
        }

        fn enter(&self, _: &Id) {}

        fn exit(&self, _: &Id) {}
    }

    /// Rows of different modules do not come in the order of their time stamps, which Rerun tells its developers: as a
    /// warning, if `re_log` is built with debug assertions. Then each drawing would have one.
    #[test]
    fn what_rerun_tells_its_developers_is_no_warning() {
        let levels = Levels::default();
        let noted = levels.0.clone();
        tracing::subscriber::with_default(levels, || {
            rerun::external::re_log::debug_warn!("Found out-of-order timelines");
            rerun::external::re_log::debug_warn_once!("Found out-of-order timelines");
        });
        let noted = noted.lock().unwrap();
        assert!(
            !noted.is_empty() && noted.iter().all(|level| *level > Level::INFO),
            "{noted:?}; see `re_log` in Cargo.toml"
        );
    }

    #[test]
    fn a_file_is_whole_when_its_scene_was_closed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.rrd");
        let mut scene = Scene::open("lab", Sink::file(&path), 0.0, 0).unwrap();
        scene.traffic("laser", 1.0, 0);
        scene.close().unwrap();
        assert!(std::fs::read(path).unwrap().starts_with(b"RRF2"));
    }

    #[test]
    fn a_full_file_is_put_aside_and_the_next_begins_with_all_that_is_known() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.rrd");
        let sink = Sink::File { path: path.clone(), bytes_max: 100_000 };
        let mut scene = Scene::open("lab", sink, 0.0, 0).unwrap();
        let old = folder.path().join("scene.old.rrd");
        let start = std::time::Instant::now();
        let mut second = 0;
        while scene.counts().rebuilt < 2 {
            assert!(start.elapsed() < Duration::from_secs(60), "{:?}", scene.counts());
            second += 1;
            scene.set_time(second * 1_000_000_000);
            scene.output_line("laser.0", crate::Level::Info, &"x".repeat(4000));
            scene.settle(Duration::from_secs(10));
        }
        scene.close().unwrap();
        let size = |path: &PathBuf| std::fs::metadata(path).unwrap().len();
        // It is looked at now and then, and what waits then is still written.
        assert!(size(&old) >= 100_000, "{}", size(&old));
        let text = std::fs::read(&path).unwrap();
        assert!(text.starts_with(b"RRF2"));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "no more than two");
    }

    #[test]
    fn a_drawing_that_is_there_is_put_aside() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.rrd");
        std::fs::write(&path, "hours of work").unwrap();
        Scene::open("lab", Sink::file(&path), 0.0, 0).unwrap().close().unwrap();
        assert_eq!(std::fs::read(folder.path().join("scene.old.rrd")).unwrap(), b"hours of work");
        assert!(std::fs::read(path).unwrap().starts_with(b"RRF2"));
    }

    #[test]
    fn sinks_that_cannot_be_say_why() {
        let scene = Scene::open("lab", Sink::file("/no/such/folder/scene.rrd"), 0.0, 0).unwrap();
        let start = std::time::Instant::now();
        let why = loop {
            assert!(start.elapsed() < Duration::from_secs(60));
            if let Some(why) = scene.failure() {
                break why;
            }
            std::thread::sleep(Duration::from_millis(1));
        };
        assert!(why.starts_with("cannot write the drawing to /no/such/folder/scene.rrd: "), "{why}");
        assert!(matches!(scene.close(), Err(CloseError::Failed(told)) if told == why));
        for (sink, why) in [
            (Sink::Viewer("localhost".into()), "`localhost` is no viewer's address: "),
            (Sink::Viewer("rerun+https://x:1/proxy".into()), "`rerun+https://x:1/proxy` is no viewer's address: "),
        ] {
            let failure = Scene::open("lab", sink, 0.0, 0).err().unwrap().to_string();
            assert!(failure.starts_with(why), "{failure}");
        }
        let address = Address::parse("rerun+http://[::1]:9877/proxy").unwrap();
        assert_eq!((address.host.as_str(), address.port), ("::1", 9877));
    }
}
