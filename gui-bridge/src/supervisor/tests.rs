use crate::{RATE_HZ, Scene, Sink};
use std::io::{Read, Write};
use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(60);

fn until(scene: &mut Scene, what: &str, done: impl Fn(&Scene) -> bool) {
    let start = Instant::now();
    let mut second = 0;
    while !done(scene) {
        assert!(start.elapsed() < PATIENCE, "{what}: {:?}", scene.counts());
        second += 1;
        scene.traffic("laser", f64::from(second), 0);
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn threads() -> usize {
    std::fs::read_dir("/proc/self/task").unwrap().count()
}

#[test]
fn a_viewer_that_is_away_is_no_failure_and_keeps_nobody_waiting() {
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let sink = Sink::Viewer(format!("rerun+http://127.0.0.1:{port}/proxy"));
    let mut scene = Scene::open("lab", sink, RATE_HZ, 0).unwrap();
    for second in 0..100_000 {
        scene.traffic("laser", f64::from(second), 0);
    }
    let counts = scene.counts();
    assert!(counts.drawn == 0 && counts.replaced > 100_000, "{counts:?}");
    assert_eq!(scene.failure(), None);
    let start = Instant::now();
    scene.close().unwrap();
    assert!(start.elapsed() < Duration::from_secs(5));
}

#[test]
fn a_viewer_that_says_nothing_or_hangs_up_is_tried_again_without_end() {
    // Tests that ran before in this process may have left some.
    let before = threads();
    // A viewer of sorts: the first connections are closed, the later ones are never answered.
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let viewer = std::thread::spawn(move || {
        let mut silent = Vec::new();
        for number in 0..4 {
            let (mut socket, _) = listener.accept().unwrap();
            if number < 2 {
                // The first words of HTTP/2's other end: settings, none.
                socket.write_all(&[0, 0, 0, 4, 0, 0, 0, 0, 0]).unwrap();
                let _ = socket.read(&mut [0; 64]);
            } else {
                silent.push(socket);
            }
        }
    });
    let sink = Sink::Viewer(format!("rerun+http://127.0.0.1:{port}/proxy"));
    let mut scene = Scene::open("lab", sink, RATE_HZ, 0).unwrap();
    until(&mut scene, "two that hung up, two that were silent", |scene| {
        let counts = scene.counts();
        counts.rebuilt >= 3 && counts.stuck >= 1
    });
    viewer.join().unwrap();
    scene.close().unwrap();
    let start = Instant::now();
    while threads() > before + 27 {
        assert!(start.elapsed() < PATIENCE, "{} threads are left, there were {before}", threads());
    }
}

/// A file that takes nothing until somebody reads it, as a disk that stands still.
fn slow_file(folder: &tempfile::TempDir) -> std::path::PathBuf {
    let path = folder.path().join("slow.rrd");
    assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
    path
}

/// Reads all that is written to a slow file, across openings and closings by the writer.
struct Reader {
    path: std::path::PathBuf,
    bytes: Arc<AtomicU64>,
    over: Arc<AtomicBool>,
}

impl Reader {
    /// Lets the file move again.
    fn new(path: &std::path::Path) -> Self {
        // For writing, too: so there is no end between one writer and the next, and nobody waits to open it.
        let mut file = std::fs::File::options().read(true).write(true).open(path).unwrap();
        let reader = Self { path: path.into(), bytes: Arc::default(), over: Arc::default() };
        let (bytes, over) = (reader.bytes.clone(), reader.over.clone());
        std::thread::spawn(move || {
            let mut room = [0; 4096];
            while !over.load(Ordering::Acquire) {
                bytes.fetch_add(file.read(&mut room).unwrap() as u64, Ordering::Relaxed);
            }
        });
        reader
    }

    /// Waits until more than so many bytes have come.
    fn wait_for(&self, bytes: u64) {
        let start = Instant::now();
        while self.bytes.load(Ordering::Relaxed) <= bytes {
            assert!(start.elapsed() < PATIENCE, "no more than {bytes} bytes");
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Release);
        std::fs::File::options().write(true).open(&self.path).unwrap().write_all(b"wakes it").unwrap();
    }
}

#[test]
fn a_disk_that_stands_still_is_waited_for_and_keeps_nobody_waiting() {
    let folder = tempfile::tempdir().unwrap();
    let path = slow_file(&folder);
    let turn = crate::supervisor::Turn::default();
    let open = || Scene::open_in_turn("lab", Sink::file(&path), RATE_HZ, 0, turn.clone()).unwrap();
    let mut first = open();
    until(&mut first, "it is noticed", |scene| scene.counts().stuck == 1);
    assert_eq!(first.failure(), None, "it is no failure");
    // Without a reader, a call that waited would wait for ever.
    let start = Instant::now();
    let first = first.leave().unwrap();
    // Switched off and on, and off again: they wait for the first, and the second has nothing to say any more.
    let second = open().leave().unwrap();
    let mut third = open();
    third.traffic("laser", 1.0, 0);
    assert!(start.elapsed() < PATIENCE / 2, "nobody waits: {:?}", start.elapsed());
    let ended = second.close_by(Instant::now() + PATIENCE);
    assert!(matches!(ended, Err(crate::CloseError::Stuck)), "it never had its turn: {ended:?}");
    assert!(!first.has_ended());
    let reader = Reader::new(&path);
    first.close_by(Instant::now() + PATIENCE).unwrap();
    reader.wait_for(1000);
    let from_first = reader.bytes.load(Ordering::Relaxed);
    until(&mut third, "the third has its turn", |scene| scene.counts().drawn > 0);
    third.close().unwrap();
    reader.wait_for(from_first + 1000);
}

#[test]
fn closing_a_drawing_waits_no_longer_than_it_says() {
    let folder = tempfile::tempdir().unwrap();
    let path = slow_file(&folder);
    let scene = Scene::open("lab", Sink::file(&path), RATE_HZ, 0).unwrap();
    let supervisor = scene.leave().unwrap();
    let ended = supervisor.close_by(Instant::now() + Duration::from_millis(50));
    assert!(matches!(ended, Err(crate::CloseError::Stuck)), "{ended:?}");
    drop(Reader::new(&path));
}

/// Runs a test once more with a disk of its own, of 8 MiB; tells whether this is that run, and its folder.
fn on_a_small_disk(test: &str) -> Option<std::path::PathBuf> {
    const FOLDER: &str = "ROHRPOST_TEST_SMALL_DISK";
    if let Some(folder) = std::env::var_os(FOLDER) {
        return Some(folder.into());
    }
    let folder = tempfile::tempdir().unwrap();
    let mount = format!("mount -t tmpfs -o size=8m none \"${FOLDER}\" && exec \"$0\" \"$@\"");
    let unshare = |script: &str| {
        let mut command = std::process::Command::new("unshare");
        command.args(["--user", "--map-root-user", "--mount", "sh", "-c", script]).env(FOLDER, folder.path());
        command
    };
    let may = unshare("mount -t tmpfs -o size=8m none \"$ROHRPOST_TEST_SMALL_DISK\"").output();
    if !may.as_ref().is_ok_and(|may| may.status.success()) {
        rohrpost_test_report::skipped(&format!("a full disk; this computer gives none of one's own: {may:?}"));
        return None;
    }
    let run = unshare(&mount).arg(std::env::current_exe().unwrap()).args(["--exact", test, "--nocapture"]).output();
    let run = run.unwrap();
    let said = format!("{}{}", String::from_utf8_lossy(&run.stdout), String::from_utf8_lossy(&run.stderr));
    assert!(run.status.success() && said.contains("1 passed"), "{said}");
    None
}

#[test]
fn a_disk_that_is_full_is_tried_again_and_the_drawing_goes_on_when_there_is_room() {
    let test = "supervisor::tests::a_disk_that_is_full_is_tried_again_and_the_drawing_goes_on_when_there_is_room";
    let Some(folder) = on_a_small_disk(test) else { return };
    let (path, ballast) = (folder.join("scene.rrd"), folder.join("ballast"));
    std::fs::write(&path, "what was recorded before").unwrap();
    std::fs::write(&ballast, vec![1; 7 * 1024 * 1024]).unwrap();
    let sink = Sink::File { path: path.clone(), bytes_max: 64 * 1024 * 1024 };
    let mut scene = Scene::open("lab", sink, 0.0, 0).unwrap();
    let mut number = 0u64;
    let mut draw = |scene: &mut Scene| {
        number += 1;
        scene.set_time(number * 1_000_000);
        // No two are alike, so they cannot be made small.
        let text: String =
            (0..200).map(|part| format!("{:x}", (number * 1000 + part).wrapping_mul(0x9e37_79b9_7f4a_7c15))).collect();
        scene.output_line("laser.0", crate::Level::Info, &text);
        std::thread::sleep(Duration::from_millis(1));
    };
    let mut until = |scene: &mut Scene, what: &str, done: &dyn Fn(&Scene) -> bool| {
        let start = Instant::now();
        while !done(scene) {
            assert!(start.elapsed() < PATIENCE, "{what}: {:?}", scene.counts());
            draw(scene);
        }
    };
    until(&mut scene, "it is noticed, and tried again in vain", &|scene| scene.counts().stuck >= 3);
    assert_eq!(scene.failure(), None);
    let before = std::fs::read(folder.join("scene.old.rrd")).unwrap();
    assert_eq!(before, b"what was recorded before", "attempts in vain do not push it out");
    std::fs::remove_file(ballast).unwrap();
    let (rebuilt, stuck) = (scene.counts().rebuilt, scene.counts().stuck);
    until(&mut scene, "it begins anew", &|scene| scene.counts().rebuilt > rebuilt);
    let drawn = scene.counts().drawn;
    until(&mut scene, "it goes on", &|scene| scene.counts().drawn > drawn + 1000);
    assert!(scene.counts().stuck <= stuck + 1, "{:?}", scene.counts());
    scene.close().unwrap();
    assert!(std::fs::read(&path).unwrap().starts_with(b"RRF2"));
    assert!(crate::files::is_whole(&path));
}
