//! What is refused, and how it says so.

use super::puppets::{CAMERA, CameraInterface, Eye, OtherCameraInterface, OtherEye, T, VIEWER, Watcher, picture};
use super::support::Place;
use rohrpost_mailbox::{Name, Participant, StreamId, StreamShape};
use rohrpost_modules::interface::StreamPort;
use rohrpost_modules::runtime::{Context, StartError};
use rohrpost_modules::types::Pose;

fn writes<T: rohrpost_modules::schema::Data>(
    context: &mut Context,
    port: StreamPort<T>,
    stamp_ns: u64,
    value: &T,
) -> String {
    context.write(port, stamp_ns, value).map_or_else(|error| error.to_string(), |sequence| format!("record {sequence}"))
}

#[test]
fn a_value_that_is_refused_names_the_key_that_lets_it_in() {
    let place = Place::with("[module.stream.image]\nrecord = \"1 KiB\"\nlate = \"1 ms\"\n");
    let camera = place.start::<Eye>(CAMERA);
    let said = camera.does(|_, context| {
        let (image, pose) = (CameraInterface::IMAGE, CameraInterface::PLACE);
        [
            writes(context, image, T, &picture(1, 2000)),
            writes(context, image, 0, &picture(1, 20)),
            writes(context, image, T, &picture(1, 20)),
            writes(context, image, T - 1_000_000, &picture(1, 20)),
            writes(context, image, T - 1_000_001, &picture(1, 20)),
            writes(context, pose, T, &Pose::default()),
            writes(context, pose, T - 5, &Pose::default()),
            writes(context, OtherCameraInterface::PLACE, T, &7),
            context.publish(CameraInterface::IMAGE.data(), T, &picture(1, 20)).unwrap_err().to_string(),
        ]
    });
    let of_camera = "[module.stream.image] of camera.0";
    assert_eq!(
        said,
        [
            &*format!(
                "a value of stream `image` has 2003 bytes, and its records take 1024; raise `record` in {of_camera}"
            ),
            "a value of stream `image` of camera.0 has the time 0; say when it was true, in ns since 1970",
            "record 0",
            "record 1",
            &*format!(
                "a value of stream `image` is of 1.000001ms before the newest one, and 1ms are allowed; write in \
                 order, or raise `late` in {of_camera}"
            ),
            "record 0",
            "a value of stream `place` is of 5ns before the newest one, and 0ns are allowed; write in order, or raise \
             `late` in [module.stream.place] of camera.0",
            "data `place` of an interface of class `camera` cannot be published as `camera.0`: its program does not \
             serve that interface there, so nobody could subscribe to it; add it to the module's `Interfaces`",
            "`image` is a stream: write it with `write` or `begin`, which publish it, too",
        ]
    );
    // The writer counts what came too late.
    let refused = |number| place.node.inspect_stream(StreamId { name: CAMERA, number }).unwrap().unwrap().refused;
    assert_eq!((refused(1), refused(2)), (1, 1));
}

#[test]
fn a_second_writer_is_refused_by_the_name_and_process_of_the_first() {
    let place = Place::with("");
    let holder = Participant::join(&place.node, VIEWER).unwrap();
    let id = StreamId { name: CAMERA, number: CameraInterface::PLACE.number };
    let held = holder.stream_writer(id, StreamShape::default()).unwrap();
    let error = place.begin::<Eye>(CAMERA).ended().unwrap_err();
    assert!(matches!(error, StartError::Stream(_)) && error.exit_code() == 1, "it may be gone soon");
    let pid = std::process::id();
    let expected = format!("stream `place` of camera.0 is written by viewer.0, process {pid}; ");
    assert!(error.to_string().starts_with(&expected), "{error}");
    drop(held);
    place.start::<Eye>(CAMERA);
}

#[test]
fn a_section_of_a_stream_that_the_program_does_not_have_is_an_error_at_the_start() {
    let place = Place::with("[module.stream.picture]\nkeep = 2\n");
    let error = place.begin::<Eye>(CAMERA).ended().unwrap_err();
    assert_eq!(error.exit_code(), StartError::CONFIGURATION);
    let file = place.installation.path.display();
    let text = std::fs::read_to_string(&place.installation.path).unwrap();
    let line = 1 + text.lines().position(|line| line == "[module.stream.picture]").unwrap();
    assert_eq!(
        error.to_string(),
        format!(
            "{file}:{line}: `camera.0` has a section [module.stream.picture], but none of its interfaces has such a \
             stream: it has `image`, `place`; remove the section, or write the name that follows `fn` in the interface"
        )
    );
}

#[test]
fn a_stream_is_read_on_its_own_node_and_while_it_has_seats() {
    let place = Place::with("[module.stream.image]\nreaders = 1\n");
    let (_camera, viewer) = (place.start::<Eye>(CAMERA), place.start::<Watcher>(VIEWER));
    let said = viewer.does(|_, context| {
        let first = context.stream(CameraInterface::IMAGE, "camera.0").unwrap();
        let errors = ["camera.1", "viewer.0", "camera.0"]
            .map(|module| context.stream(CameraInterface::IMAGE, module).err().unwrap().to_string());
        drop(first);
        assert!(context.stream(CameraInterface::IMAGE, "camera.0").is_ok(), "a seat is free again");
        errors
    });
    assert_eq!(
        said,
        [
            "stream `image` of camera.1 is on node `far`, and this node has no [[replica]] of it; add one, or \
             subscribe to its values with `subscribe(PORT.data(), …)`",
            "`viewer.0` is of class `viewer`, but this speaks to class `camera`",
            "stream `image` of camera.0 has 1 readers already; end one, or raise its `readers` in \
             [module.stream.image] of camera.0",
        ]
    );
}

#[test]
fn records_of_another_interface_are_not_taken_for_ours() {
    let place = Place::with("");
    let (other, viewer) = (place.start::<OtherEye>(CAMERA), place.start::<Watcher>(VIEWER));
    other.does(|_, context| assert_eq!(writes(context, OtherCameraInterface::IMAGE, T, &7), "record 0"));
    let (theirs, ours) = (OtherCameraInterface::hash(), CameraInterface::hash());
    let said = viewer.does(|_, context| {
        let mut images = context.stream(CameraInterface::IMAGE, "camera.0").unwrap();
        images.newest().err().unwrap().to_string()
    });
    let expected = format!(
        "stream `image` of camera.0: interface differs: the module has {theirs:#010x}, this program {ours:#010x}; "
    );
    assert!(said.starts_with(&expected), "{said}");

    // A program with another interface begins anew: what the one before wrote is of other types.
    other.crashes();
    let camera = place.start::<Eye>(CAMERA);
    let newest = viewer.does(|_, context| {
        let mut images = context.stream(CameraInterface::IMAGE, "camera.0").unwrap();
        images.newest().unwrap().is_none()
    });
    assert!(newest, "nothing of the one before is there");
    camera.does(|_, context| assert_eq!(writes(context, CameraInterface::IMAGE, T - 9, &picture(1, 1)), "record 0"));
}

#[test]
fn a_stream_of_a_program_without_description_is_read_and_what_it_holds_is_checked() {
    let place = Place::with("");
    let tool = Participant::join(&place.node, Name::new(1, 16, 3, 0)).unwrap();
    let id = StreamId { name: CAMERA, number: CameraInterface::IMAGE.number };
    let mut writer = tool.stream_writer(id, StreamShape::default()).unwrap();
    let viewer = place.start::<Watcher>(VIEWER);
    writer.write(rohrpost_mailbox::Stamp { epoch: 1, ns: T }, &[0xff; 3]).unwrap();
    let said = viewer.does(|_, context| {
        let mut images = context.stream(CameraInterface::IMAGE, "camera.0").unwrap();
        let newest = images.newest().unwrap().unwrap();
        newest.read().unwrap_err().to_string()
    });
    assert!(said.starts_with("data 1 of 1.150.0.0 cannot be read: "), "{said}");
}
