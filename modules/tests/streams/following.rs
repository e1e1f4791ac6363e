//! Streams of which a module is given each record.

use super::puppets::{CAMERA, CameraInterface, Eye, Picture, Puppeteer, T, VIEWER, Watcher, picture};
use super::support::{Place, wait};
use rohrpost_mailbox::local;
use rohrpost_modules::interface::StreamPort;
use rohrpost_modules::runtime::{Context, Moment, Rate, StreamSubscription};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// Width of a picture, sequence and misses, as they came.
type Seen = Arc<Mutex<Vec<(u32, u32, u32)>>>;

/// Has the viewer note what comes of this stream, each time after `pause`.
fn follows(viewer: &Puppeteer<Watcher>, pause: impl Fn() + Send + 'static) -> Seen {
    let seen = Seen::default();
    let noted = seen.clone();
    viewer.does(move |part, context| {
        let images = context.subscribe_stream(CameraInterface::IMAGE, "camera.0").unwrap();
        let places = context.subscribe_stream(CameraInterface::PLACE, "camera.0").unwrap();
        let data = context.subscribe(CameraInterface::LEVEL, "camera.0", Rate::Each).unwrap();
        part.handler = Some(Box::new(move |data_| {
            assert!(!data_.is_of(&places) && !data_.is_of(&data) && data_.read(&places)?.is_none());
            let (image, view) = (data_.read(&images)?.unwrap(), data_.view(&images)?.unwrap());
            assert_eq!((view.width_px, view.pixels), (image.width_px, &**image.pixels));
            assert!(data_.value.as_ptr_range().contains(&view.pixels.as_ptr()), "where it lies");
            assert_eq!((data_.from, data_.number, data_.mailbox), (CAMERA, 1, local::COMMANDS));
            let Moment::Stamp(stamp) = data_.moment() else { panic!("a record knows its epoch") };
            assert_eq!(stamp.ns, data_.head.stamp_ns);
            assert!(data_.read_from::<u8>(local::COMMANDS)?.is_none());
            pause();
            noted.lock().unwrap().push((image.width_px, data_.head.sequence, data_.head.missed));
            Ok(())
        }));
    });
    seen
}

/// Has the viewer note the pictures that come; `then` is done with their subscription.
fn follows_images(
    viewer: &Puppeteer<Watcher>,
    then: impl FnOnce(&mut Watcher, &mut Context, &StreamSubscription<Picture>) + Send + 'static,
) -> Seen {
    let seen = Seen::default();
    let noted = seen.clone();
    viewer.does(move |part, context| {
        let images = context.subscribe_stream(CameraInterface::IMAGE, "camera.0").unwrap();
        then(part, context, &images);
        part.handler = Some(Box::new(move |data| {
            let image = data.read(&images)?.unwrap();
            noted.lock().unwrap().push((image.width_px, data.head.sequence, data.head.missed));
            Ok(())
        }));
    });
    seen
}

/// Of a camera that was started again at its fourth picture, a viewer that rewinds so sees all from this one on.
fn rewound_from(rewind: fn(&mut Context, &StreamSubscription<Picture>), first: u32) {
    let place = Place::with("");
    let camera = place.start::<Eye>(CAMERA);
    shoots(&camera, 0..3);
    camera.crashes();
    let camera = place.start::<Eye>(CAMERA);
    shoots(&camera, 3..6);
    let viewer = place.start::<Watcher>(VIEWER);
    let seen = follows_images(&viewer, move |_, context, images| rewind(context, images));
    shoots(&camera, 6..7);
    wait("it sees the last", || (widths(&seen).last() == Some(&6)).then_some(()));
    assert_eq!(*seen.lock().unwrap(), (first..7).map(|n| (n, n, 0)).collect::<Vec<_>>());
}

/// Pictures of these widths, in this order, all with time to spare.
fn shoots(camera: &Puppeteer<Eye>, widths: std::ops::Range<u32>) {
    camera.does(move |_, context| {
        for width in widths {
            context.write(port(), T + u64::from(width), &picture(width, 100)).unwrap();
        }
    });
}

fn port() -> StreamPort<Picture> {
    CameraInterface::IMAGE
}

fn widths(seen: &Seen) -> Vec<u32> {
    seen.lock().unwrap().iter().map(|(width, ..)| *width).collect()
}

#[test]
fn each_record_wakes_the_module_also_of_a_stream_that_comes_later() {
    let place = Place::with("");
    let viewer = place.start::<Watcher>(VIEWER);
    let seen = follows(&viewer, || {});
    let camera = place.start::<Eye>(CAMERA);
    for n in 0..50 {
        shoots(&camera, n..n + 1);
        wait("it sees the picture", || (widths(&seen).len() > n as usize).then_some(()));
    }
    assert_eq!(*seen.lock().unwrap(), (0..50).map(|n| (n, n, 0)).collect::<Vec<_>>());
    let mut tool = place.tool();
    let exchanges = tool.exchange(VIEWER).unwrap();
    let image = exchanges.iter().find(|exchange| exchange.data == Some(1) && exchange.packages > 0).unwrap();
    assert_eq!((image.module.as_str(), image.packages, image.lost), ("camera.0", 50, 0));
}

#[test]
fn a_slow_module_is_told_what_it_lost_and_goes_on_with_the_oldest() {
    let place = Place::with("[module.stream.image]\nkeep = 8\n");
    let (camera, viewer) = (place.start::<Eye>(CAMERA), place.start::<Watcher>(VIEWER));
    let (held, holds) = (Arc::new(AtomicBool::new(true)), Arc::new(AtomicU64::new(0)));
    let pause = {
        let (held, holds) = (held.clone(), holds.clone());
        move || {
            holds.fetch_add(1, Ordering::SeqCst);
            while held.load(Ordering::SeqCst) {
                std::thread::yield_now();
            }
        }
    };
    let seen = follows(&viewer, pause);
    shoots(&camera, 0..1);
    wait("it works on the first", || (holds.load(Ordering::SeqCst) == 1).then_some(()));
    // The record that it holds stays as it is, whatever is written.
    shoots(&camera, 1..101);
    held.store(false, Ordering::SeqCst);
    wait("it sees the last", || (widths(&seen).last() == Some(&100)).then_some(()));
    let seen = seen.lock().unwrap().clone();
    let (came, missed) = (seen.len() as u32, seen.last().unwrap().2);
    assert_eq!(came + missed, 101, "each was read or lost");
    assert_eq!(seen[0], (0, 0, 0));
    assert_eq!(seen[1..], (93..101).map(|n| (n, n, 92)).collect::<Vec<_>>());
    assert_eq!(place.tool().status(VIEWER).unwrap().lost, 92);
}

#[test]
fn while_a_module_is_off_records_pass_it_by() {
    let place = Place::with("");
    let (camera, viewer) = (place.start::<Eye>(CAMERA), place.start::<Watcher>(VIEWER));
    let seen = follows(&viewer, || {});
    shoots(&camera, 0..3);
    wait("it sees them", || (widths(&seen).len() == 3).then_some(()));
    let mut tool = place.tool();
    tool.switch(VIEWER, false).unwrap();
    shoots(&camera, 3..6);
    tool.switch(VIEWER, true).unwrap();
    shoots(&camera, 6..8);
    wait("it sees the last", || (widths(&seen).last() == Some(&7)).then_some(()));
    assert_eq!(widths(&seen), [0, 1, 2, 6, 7]);
    assert_eq!(tool.status(VIEWER).unwrap().lost, 0, "what was passed over is no loss");
}

#[test]
fn a_restarted_writer_is_followed() {
    let place = Place::with("");
    let (camera, viewer) = (place.start::<Eye>(CAMERA), place.start::<Watcher>(VIEWER));
    let seen = follows(&viewer, || {});
    shoots(&camera, 0..3);
    camera.crashes();
    let camera = place.start::<Eye>(CAMERA);
    shoots(&camera, 3..6);
    wait("it sees the last", || (widths(&seen).last() == Some(&5)).then_some(()));
    assert_eq!(*seen.lock().unwrap(), (0..6).map(|n| (n, n, 0)).collect::<Vec<_>>());
}

#[test]
fn a_stream_can_be_followed_from_the_oldest_record_of_its_present_writer() {
    rewound_from(|context, images| context.rewind(images), 3);
}

#[test]
fn a_stream_can_be_followed_from_any_record_that_is_kept_also_of_earlier_writers() {
    rewound_from(|context, images| context.rewind_to(images, 2), 2);
}

#[test]
fn what_is_rewound_while_it_is_received_comes_again_and_passes_no_module_by() {
    let place = Place::with("");
    let (camera, viewer) = (place.start::<Eye>(CAMERA), place.start::<Watcher>(VIEWER));
    let seen = follows_images(&viewer, |part, _, images| part.rewinds = Some(*images));
    // Rewound behind the first one.
    shoots(&camera, 0..1);
    wait("it sees the first twice", || (widths(&seen) == [0, 0]).then_some(()));
    let mut tool = place.tool();
    tool.switch(VIEWER, false).unwrap();
    shoots(&camera, 1..3);
    tool.switch(VIEWER, true).unwrap();
    wait("it sees the last", || (widths(&seen).last() == Some(&2)).then_some(()));
    assert_eq!(*seen.lock().unwrap(), [0, 0, 1, 2].map(|n| (n, n, 0)));
}
