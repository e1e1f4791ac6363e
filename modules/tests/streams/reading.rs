//! Streams that a module looks at when it likes.

use super::puppets::{CAMERA, CameraInterface, Eye, Puppeteer, T, VIEWER, Watcher, picture};
use super::support::{PATIENCE, Place};
use rohrpost_mailbox::{Around, Name, Next, TimeKeeper, TimeSource};
use rohrpost_modules::description::noted;
use rohrpost_modules::fusion::{NoValue, Stamp};
use rohrpost_modules::runtime::Stream;
use rohrpost_modules::schema::{Value, decode};
use rohrpost_modules::types::Pose;
use std::time::Duration;

const MS: u64 = 1_000_000;

/// Writes poses: their stamps in ms after [`T`] are their places along x.
fn moves(camera: &Puppeteer<Eye>, at_ms: &'static [u64]) {
    camera.does(move |_, context| {
        for at in at_ms {
            let pose = Pose { x_m: *at as f64, ..Pose::default() };
            context.write(CameraInterface::PLACE, T + at * MS, &pose).unwrap();
        }
    });
}

/// A reader of the camera's places, for the viewer and for the test.
fn places(viewer: &Puppeteer<Watcher>) -> Stream<Pose> {
    viewer.does(|_, context| context.stream(CameraInterface::PLACE, "camera.0").unwrap())
}

fn next_x_m(places: &mut Stream<Pose>) -> Next<f64> {
    places.try_next().unwrap().map(|record| record.read().unwrap().x_m)
}

#[test]
fn records_are_read_one_by_one_and_the_newest_at_any_time() {
    let place = Place::with("[module.stream.place]\nkeep = 4\n");
    let viewer = place.start::<Watcher>(VIEWER);
    // There before its stream is.
    let mut places = places(&viewer);
    assert!(places.newest().unwrap().is_none() && !places.has_next());
    let camera = place.start::<Eye>(CAMERA);
    assert!(matches!(places.next_within(Duration::ZERO).unwrap(), Next::Nothing));
    moves(&camera, &[10, 20, 30]);
    assert!(places.has_next());
    {
        let newest = places.newest().unwrap().unwrap();
        assert_eq!((newest.info().sequence, newest.stamp_ns(), newest.read().unwrap().x_m), (2, T + 30 * MS, 30.0));
    }
    assert_eq!([next_x_m(&mut places), next_x_m(&mut places)], [Next::Record(10.0), Next::Record(20.0)]);
    moves(&camera, &[40, 50, 60, 70]);
    assert_eq!(next_x_m(&mut places), Next::Lost(1), "keep = 4, and it is told what it missed");
    assert_eq!(next_x_m(&mut places), Next::Record(40.0));
    assert_eq!((places.position(), places.accounts()), (4, (3, 1)));
    places.from(6);
    assert_eq!([next_x_m(&mut places), next_x_m(&mut places)], [Next::Record(70.0), Next::Nothing]);
    assert_eq!(places.record(5).unwrap().unwrap().read().unwrap().x_m, 60.0);
    assert!(places.record(2).unwrap().is_none() && places.record(7).unwrap().is_none());
}

#[test]
fn a_value_at_a_time_is_interpolated_or_says_exactly_why_not() {
    let place = Place::with("[module.stream.place]\nkeep = 5\nlate = \"5 ms\"\n");
    let (camera, viewer) = (place.start::<Eye>(CAMERA), place.start::<Watcher>(VIEWER));
    let mut places = places(&viewer).with_gap(Duration::from_millis(20));
    let at = |places: &mut Stream<Pose>, ms: u64| places.at(T + ms * MS).unwrap().map(|pose| pose.x_m);
    assert_eq!(at(&mut places, 15), Err(NoValue::Empty));
    moves(&camera, &[10, 20, 30, 26]);
    assert_eq!(at(&mut places, 15), Ok(15.0));
    assert_eq!(at(&mut places, 10), Ok(10.0));
    // What is still to be written may be nearer.
    assert_eq!(at(&mut places, 26), Err(NoValue::NotYet { by_ns: MS }));
    assert_eq!(at(&mut places, 40), Err(NoValue::NotYet { by_ns: 15 * MS }));
    moves(&camera, &[60, 80, 90]);
    assert_eq!(at(&mut places, 28), Ok(28.0), "the late one counts as if it had come in order");
    assert_eq!(at(&mut places, 35), Err(NoValue::Gap { gap_ns: 30 * MS, gap_max_ns: 20 * MS }));
    let Err(NoValue::BeforeOldest { by_ns }) = at(&mut places, 5) else { panic!("10 and 20 were overwritten") };
    assert!((21 * MS..=25 * MS).contains(&by_ns), "to 26, or to 30, which came before it: {by_ns}");
    let epoch = places.newest().unwrap().unwrap().stamp().epoch;
    let other = Stamp::new(epoch + 1, T + 28 * MS);
    assert_eq!(places.at(other).unwrap().err(), Some(NoValue::OtherEpoch { asked: epoch + 1, known: epoch }));
    let Around::Records { before, after } = places.around(T + 65 * MS).unwrap() else { panic!("they are there") };
    assert_eq!((before.sequence, after.sequence), (4, 5));
}

#[test]
fn a_restarted_writer_is_read_on_without_a_gap() {
    let place = Place::with("");
    let (camera, viewer) = (place.start::<Eye>(CAMERA), place.start::<Watcher>(VIEWER));
    let mut places = places(&viewer);
    moves(&camera, &[10, 20]);
    assert_eq!(next_x_m(&mut places), Next::Record(10.0));
    camera.crashes();
    assert_eq!(next_x_m(&mut places), Next::Record(20.0), "what was written before it died");
    assert_eq!(next_x_m(&mut places), Next::Nothing);
    let camera = place.start::<Eye>(CAMERA);
    moves(&camera, &[30]);
    let Next::Record(record) = places.next_within(PATIENCE).unwrap() else { panic!("it was written") };
    assert_eq!((record.info().sequence, record.read().unwrap().x_m), (2, 30.0));
    drop(record);
    assert_eq!(places.accounts(), (3, 0));
    assert_eq!(places.at(T + 25 * MS).unwrap().map(|pose| pose.x_m), Ok(25.0), "across both lives");
}

#[test]
fn records_of_two_epochs_are_never_put_together() {
    let place = Place::with("[module.stream.place]\nlate = \"1 s\"\n");
    let keeper = |ns| TimeKeeper::begin(&place.node, TimeSource::Local, ns, 1.0).unwrap();
    let first = keeper(T);
    let (camera, viewer) = (place.start::<Eye>(CAMERA), place.start::<Watcher>(VIEWER));
    let mut places = places(&viewer);
    moves(&camera, &[0, 1000, 2000]);
    assert_eq!(places.at(T + 500 * MS).unwrap().map(|pose| pose.x_m), Ok(500.0));
    drop(first);
    // The clock is set back by some seconds.
    let _second = keeper(T - 3000 * MS);
    moves(&camera, &[100, 200]);
    assert_eq!([next_x_m(&mut places), next_x_m(&mut places)], [Next::Record(0.0), Next::Record(1000.0)]);
    assert_eq!([next_x_m(&mut places), next_x_m(&mut places)], [Next::Record(2000.0), Next::Record(100.0)]);
    // A time without an epoch is of the present one.
    assert!(matches!(places.at(T + 150 * MS).unwrap(), Err(NoValue::NotYet { .. })));
    moves(&camera, &[2000]);
    assert_eq!(places.at(T + 150 * MS).unwrap().map(|pose| pose.x_m), Ok(150.0));
    assert!(matches!(places.at(T + 50 * MS).unwrap(), Err(NoValue::BeforeOldest { .. } | NoValue::OtherEpoch { .. })));
    let before = places.record(1).unwrap().unwrap().stamp();
    assert!(matches!(places.at(before).unwrap().err(), None | Some(NoValue::OtherEpoch { .. })));
}

#[test]
fn a_stream_is_read_by_its_description_alone() {
    let place = Place::with("[module.stream.image]\nrecord = \"1 MiB\"\nreaders = 1\n");
    let (camera, viewer) = (place.start::<Eye>(CAMERA), place.start::<Watcher>(VIEWER));
    let description = noted(&place.node, CAMERA).unwrap();
    let (item, hash) = (description.data_item("image").unwrap().clone(), description.hash());
    let open = |from: Name, interface: u32| {
        let item = item.clone();
        viewer.does(move |_, context| context.stream_untyped(from, &item, interface))
    };
    let mut images = open(CAMERA, hash).unwrap();
    assert!(images.newest().unwrap().is_none());
    // Larger than a package.
    camera.does(|_, context| context.write(CameraInterface::IMAGE, T, &picture(3, 100_000)).map(drop)).unwrap();
    let record = images.newest().unwrap().unwrap();
    assert_eq!((record.info().sequence, record.stamp_ns()), (0, T));
    let Value::Map(fields) = decode(&item.field.ty, record.bytes()).unwrap() else { panic!("it is a structure") };
    let [(_, width_px), (_, Value::Bytes(pixels))] = &fields[..] else { panic!("it has two fields: {fields:?}") };
    assert_eq!((width_px, &pixels[..]), (&Value::U(3), &[3; 100_000][..]));
    drop(record);

    assert_eq!(
        [open(CAMERA, hash), open(Name::new(1, 150, 1, 0), hash)].map(|refused| refused.err().unwrap().to_string()),
        [
            "stream `image` of camera.0 has 1 readers already; end one, or raise its `readers` in \
             [module.stream.image] of camera.0",
            "stream `image` of camera.1 is on node `far`, and this node has no [[replica]] of it; add one, or \
             subscribe to its values with `subscribe(PORT.data(), …)`",
        ]
    );
    drop(images);
    let mut other = open(CAMERA, hash ^ 1).unwrap();
    let told = other.newest().err().unwrap().to_string();
    assert!(told.starts_with("stream `image` of camera.0: interface differs: "), "{told}");
}
