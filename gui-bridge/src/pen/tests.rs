use crate::{RATE_HZ, Scene, Sink};
use std::io::{Read, Write};
use std::net::TcpListener;
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
    while threads() > 30 {
        assert!(start.elapsed() < PATIENCE, "{} threads are left", threads());
    }
}
