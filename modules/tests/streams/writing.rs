//! What a module writes, and what others get of it.

use super::puppets::{CAMERA, CameraInterface, CameraProxy, Eye, T, VIEWER, Watcher, picture};
use super::support::{PATIENCE, Place};
use rohrpost_mailbox::{Next, StreamId, local};
use rohrpost_modules::call::{CallError, Fault, append};
use rohrpost_modules::common::{DataHead, SUBSCRIBE, Subscribe};
use rohrpost_modules::interface::Proxy;
use rohrpost_modules::schema::{Bytes, DataKind};
use rohrpost_modules::types::Pose;

const IMAGE: u16 = CameraInterface::IMAGE.number;

#[test]
fn a_value_filled_in_place_is_read_where_it_lies() {
    let place = Place::with("[module.stream.image]\nrecord = \"8 MiB\"\nkeep = 2\n");
    let (camera, viewer) = (place.start::<Eye>(CAMERA), place.start::<Watcher>(VIEWER));
    let images = viewer.does(|_, context| context.stream(CameraInterface::IMAGE, "camera.0").unwrap());
    let images = std::sync::Mutex::new(images);
    let len = 1920 * 1080 * 3;
    let sequence = camera.does(move |_, context| {
        let mut open = context.begin(CameraInterface::IMAGE, T).unwrap();
        let front = picture(1920, 0);
        let room = open.fill(&front, len).unwrap();
        assert_eq!(room.len(), len);
        (0..).zip(room).for_each(|(at, byte)| *byte = at as u8);
        open.finish().unwrap()
    });
    assert_eq!(sequence, 0);
    let mut images = images.into_inner().unwrap();
    let Next::Record(record) = images.try_next().unwrap() else { panic!("it was written") };
    let view = record.view().unwrap();
    assert_eq!((view.width_px, view.pixels.len()), (1920, len));
    assert!((0..).zip(view.pixels).all(|(at, byte)| *byte == at as u8));
    assert!(record.bytes().as_ptr_range().contains(&view.pixels.as_ptr()), "in the record, not a copy of it");
    assert_eq!(record.read().unwrap().pixels.len(), len);
}

#[test]
fn a_value_that_is_begun_and_dropped_never_was() {
    let place = Place::with("");
    let camera = place.start::<Eye>(CAMERA);
    let sequences = camera.does(|_, context| {
        let first = context.write(CameraInterface::IMAGE, T, &picture(1, 10)).unwrap();
        let mut open = context.begin(CameraInterface::IMAGE, T + 2).unwrap();
        open.fill(&picture(2, 0), 100).unwrap().fill(2);
        drop(open);
        // What was begun and dropped is not behind.
        (first, context.write(CameraInterface::IMAGE, T + 1, &picture(3, 10)).unwrap())
    });
    assert_eq!(sequences, (0, 1));
    assert_eq!(place.published(IMAGE), 2);
    let newest = CameraProxy::new(&place.caller(), CAMERA).image().unwrap();
    assert_eq!(newest, (T + 1, picture(3, 10)));
}

#[test]
fn streams_go_on_as_data_for_all_that_take_data() {
    let place = Place::with("[module.stream.image]\nrecord = \"100 KiB\"\n");
    let camera = place.start::<Eye>(CAMERA);
    let proxy = CameraProxy::new(&place.caller(), CAMERA).with_timeout(PATIENCE);
    assert!(matches!(proxy.image(), Err(CallError::Fault(_, Fault::NothingYet))));
    let mut tool = place.tool();
    let streams: Vec<_> = tool.describe(CAMERA).unwrap().data.iter().map(|item| item.kind).collect();
    assert_eq!(streams, [DataKind::Stream, DataKind::Stream, DataKind::Data]);
    tool.data().unwrap();
    for (id, period_us) in [(1, 0), (2, 1000)] {
        let wish = Subscribe { number: IMAGE, id, period_us, lease_ms: 60_000, mailbox: local::DATA };
        let write = |body: &mut Vec<u8>| append(body, &wish);
        tool.call(CAMERA, SUBSCRIBE, CameraInterface::hash(), write, |_| Ok(())).unwrap();
    }
    camera.does(|_, context| context.write(CameraInterface::IMAGE, T, &picture(7, 1000)).unwrap());
    let mut came = Vec::new();
    while came.len() < 2 {
        let package = tool.data().unwrap().receive_timeout(PATIENCE).expect("it was subscribed to");
        let (data, value) = DataHead::split(package.body()).unwrap();
        assert_eq!((data.stamp_ns, value), (T, &*postcard::to_stdvec(&picture(7, 1000)).unwrap()));
        came.push(package.head().id);
    }
    came.sort_unstable();
    assert_eq!(came, [1, 2], "the one that wants each, and the periodic one");
    assert_eq!(proxy.image().unwrap(), (T, picture(7, 1000)));

    // Larger than a package: in the stream alone, and said where it is asked for.
    camera.does(|_, context| context.write(CameraInterface::IMAGE, T + 1, &picture(8, 70_000)).unwrap());
    let error = proxy.image().unwrap_err().to_string();
    assert!(error.contains("the result of 70004 bytes does not fit in a package"), "{error}");
    camera.does(|_, context| context.write(CameraInterface::IMAGE, T + 2, &picture(9, 10)).unwrap());
    let mut each = || {
        let package = tool.data().unwrap().receive_timeout(PATIENCE).expect("it was subscribed to");
        let (data, _) = DataHead::split(package.body()).unwrap();
        (package.head().id == 1).then_some((data.stamp_ns, data.sequence, data.missed))
    };
    let next = std::iter::repeat_with(&mut each).flatten().next().unwrap();
    assert_eq!(next, (T + 2, 2, 1), "what fits no package is missed, and the subscriber sees it");
    assert_eq!(place.published(IMAGE), 3, "each write is counted, once");
    // Nothing but the ring keeps them.
    let id = StreamId { name: CAMERA, number: IMAGE };
    assert_eq!(place.node.inspect_stream(id).unwrap().unwrap().written, 3);
}

#[test]
fn writes_are_counted_without_readers_and_mailboxes_get_nothing() {
    let place = Place::with("");
    let camera = place.start::<Eye>(CAMERA);
    camera.does(|_, context| {
        for n in 1..=100u32 {
            let pose = Pose { x_m: n.into(), ..Pose::default() };
            assert_eq!(context.write(CameraInterface::PLACE, T + u64::from(n), &pose).unwrap(), u64::from(n) - 1);
        }
        let now_ns = context.now().ns;
        context.write_now(CameraInterface::PLACE, &Pose::default()).unwrap();
        assert!(now_ns > T + 100, "now is later than the tests' time");
    });
    assert_eq!(place.published(CameraInterface::PLACE.number), 101);
}

#[test]
fn fill_takes_an_empty_field_of_bytes_at_the_end() {
    let place = Place::with("");
    let camera = place.start::<Eye>(CAMERA);
    let errors = camera.does(|_, context| {
        let mut open = context.begin(CameraInterface::IMAGE, T).unwrap();
        let full = open.fill(&picture(1, 1), 10).unwrap_err().to_string();
        let nothing = open.finish().unwrap_err().to_string();
        let no_bytes = {
            let mut open = context.begin(CameraInterface::PLACE, T).unwrap();
            open.fill(&Pose::default(), 10).unwrap_err().to_string()
        };
        let mut open = context.begin(CameraInterface::IMAGE, T).unwrap();
        // What is put in last counts.
        open.fill(&picture(1, 0), 10).unwrap().fill(1);
        open.put(&picture(2, 3)).unwrap();
        open.finish().unwrap();
        [full, nothing, no_bytes]
    });
    let why = "is not filled in place: its last field must be `Bytes`, and empty in what is given to `fill`";
    assert_eq!(errors[0], format!("a value of stream `image` {why}"));
    assert_eq!(errors[1], "a value of stream `image` is finished and was never put in; use `put` or `fill` before");
    assert_eq!(errors[2], format!("a value of stream `place` {why}"));
    let (_, newest) = CameraProxy::new(&place.caller(), CAMERA).image().unwrap();
    assert_eq!((newest.width_px, newest.pixels), (2, Bytes(vec![2; 3])));
}
