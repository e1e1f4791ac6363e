//! Where a drawing goes, and how much of it may wait on the way.

use rerun::log::ChunkBatcherConfig;
use rerun::sink::{GrpcSink, GrpcSinkConnectionState, LogSink};
use rerun::{ApplicationId, RecordingStream, RecordingStreamBuilder, SpawnOptions};
use std::path::PathBuf;
use std::sync::mpsc;
use std::time::Duration;

/// What may wait for a slow sink before drawing blocks.
pub const BYTES_IN_FLIGHT: u64 = 16 * 1024 * 1024;

/// Where a drawing goes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Sink {
    /// A new `.rrd` file, to be opened with `rerun FILE`. Whole only after the scene was dropped.
    File(PathBuf),
    /// A viewer that runs already: `rerun+http://127.0.0.1:9876/proxy`.
    Viewer(String),
    /// A viewer started now, which outlives the scene; needs `rerun` in the `PATH`.
    Window,
}

/// Why a scene could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The file cannot be written.
    #[error("cannot write the drawing to {path}: {cause}")]
    File {
        /// The file asked for.
        path: PathBuf,
        /// What Rerun says.
        cause: rerun::RecordingStreamError,
    },
    /// The address is none.
    #[error("`{url}` is no viewer's address: {cause}; write rerun+http://HOST:9876/proxy")]
    Viewer {
        /// The address asked for.
        url: String,
        /// What Rerun says.
        cause: rerun::RecordingStreamError,
    },
    /// No viewer came up.
    #[error("cannot start a viewer: {0}; install one with `pip install rerun-sdk==0.36.3`, or draw to a file")]
    Window(rerun::RecordingStreamError),
    /// Rerun refused the layout or the first rows.
    #[error("Rerun refused the layout: {0}")]
    Layout(#[from] rerun::RecordingStreamError),
    /// Rerun refused what never changes.
    #[error("cannot begin to draw: {0}")]
    Draw(#[from] crate::DrawError),
}

/// How a scene stands with its sink.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Connection {
    /// It writes to a file or to memory.
    Local,
    /// The viewer has not answered yet; Rerun keeps trying.
    Connecting,
    /// The viewer takes what is drawn.
    Up,
    /// The viewer went away. Rerun never connects again and drops all that is drawn: open a new scene.
    Lost,
    /// The sink's thread did not answer in time: it is stuck in a write, and drawing will block soon.
    Stuck,
}

/// The batcher's settings. A file gets chunks of decent size; a viewer is shown changes within a blink.
fn batching(sink: &Sink) -> ChunkBatcherConfig {
    let flush_tick = match sink {
        Sink::File(_) => Duration::from_millis(500),
        Sink::Viewer(_) | Sink::Window => Duration::from_millis(40),
    };
    ChunkBatcherConfig { flush_tick, max_bytes_in_flight: BYTES_IN_FLIGHT, ..ChunkBatcherConfig::DEFAULT }
}

/// A stream into `sink`, without a layout yet.
pub(crate) fn open(application: ApplicationId, sink: &Sink) -> Result<RecordingStream, OpenError> {
    let builder = RecordingStreamBuilder::new(application).batcher_config(batching(sink));
    match sink {
        Sink::File(path) => builder.save(path).map_err(|cause| OpenError::File { path: path.clone(), cause }),
        Sink::Viewer(url) => {
            builder.connect_grpc_opts(url).map_err(|cause| OpenError::Viewer { url: url.clone(), cause })
        }
        Sink::Window => builder
            .spawn_opts(&SpawnOptions {
                memory_limit: "1GiB".into(),
                server_memory_limit: "128MiB".into(),
                wait_for_bind: true,
                extra_args: vec!["--bind".into(), "127.0.0.1".into()],
                ..SpawnOptions::default()
            })
            .map_err(OpenError::Window),
    }
}

/// Asks the sink's thread how it stands, and waits `patience` for its answer.
pub(crate) fn connection(stream: &RecordingStream, patience: Duration) -> Connection {
    let (answer, answers) = mpsc::channel();
    stream.inspect_sink(move |sink| {
        // Nobody waits any more when the patience ran out; that is no fault.
        let _ = answer.send(standing(sink));
    });
    answers.recv_timeout(patience).unwrap_or(Connection::Stuck)
}

fn standing(sink: &dyn LogSink) -> Connection {
    let sink: &dyn std::any::Any = sink;
    match sink.downcast_ref::<GrpcSink>().map(GrpcSink::status) {
        None => Connection::Local,
        Some(GrpcSinkConnectionState::Connecting { .. }) => Connection::Connecting,
        Some(GrpcSinkConnectionState::Connected) => Connection::Up,
        Some(GrpcSinkConnectionState::Disconnected(_)) => Connection::Lost,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Scene, testing::Drawing};
    use std::time::Instant;

    const PATIENCE: Duration = Duration::from_secs(5);

    #[test]
    fn a_file_is_whole_when_its_scene_was_closed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.rrd");
        let scene = Scene::open("lab", &Sink::File(path.clone()), 0).unwrap();
        assert_eq!(scene.connection(PATIENCE), Connection::Local);
        scene.close().unwrap();
        assert!(std::fs::read(path).unwrap().starts_with(b"RRF2"));
    }

    #[test]
    fn a_scene_waits_for_a_viewer_without_blocking() {
        assert_eq!(Drawing::new().scene.connection(PATIENCE), Connection::Local);
        let start = Instant::now();
        // Port 1 belongs to a service that nobody runs.
        let sink = Sink::Viewer("rerun+http://127.0.0.1:1/proxy".into());
        let mut scene = Scene::open("lab", &sink, 0).unwrap();
        scene.traffic("laser", 1.0, 0).unwrap();
        assert_eq!(scene.connection(PATIENCE), Connection::Connecting);
        assert!(start.elapsed() < PATIENCE);
    }

    #[test]
    fn sinks_that_cannot_be_say_why() {
        for (sink, why) in [
            (Sink::File("/no/such/folder/scene.rrd".into()), "cannot write the drawing to /no/such/folder/scene.rrd: "),
            (Sink::Viewer("localhost".into()), "`localhost` is no viewer's address: "),
        ] {
            let failure = Scene::open("lab", &sink, 0).err().unwrap().to_string();
            assert!(failure.starts_with(why), "{failure}");
        }
    }
}
