//! What the attribute makes of a trait: the description that tools read, and the hash that tells interfaces apart.

#![allow(clippy::unwrap_used, reason = "these are tests")]

use rohrpost_modules::call::Fault;
use rohrpost_modules::common::HASH;
use rohrpost_modules::interface;
use rohrpost_modules::interface::{DataPort, Interface, Serve, StreamPort};
use rohrpost_modules::interfaces::{CartographerInterface, CollectorInterface, LaserInterface, MotorInterface};
use rohrpost_modules::schema::{DataKind, Description, Schema, describe_field};

/// Opens and closes.
///
/// A gripper at the end of an arm.
#[interface(class = "gripper", crate = rohrpost_modules::macro_support)]
pub trait Gripper {
    /// Closes with a force.
    /// In newtons.
    #[command(16)]
    fn close(
        &mut self,
        #[schema(unit = "N", min = 0.0, max = 40.0)] force_n: f32,
        name: Option<String>,
    ) -> Result<u8, String>;

    /// Opens.
    #[command(17, idempotent)]
    fn open(&mut self);

    /// Arguments with names that the attribute uses itself.
    #[command(18)]
    fn say(&mut self, module: u8, reply: String, arguments: (u8, u8), function: bool) -> String;

    /// What it feels.
    #[data(1)]
    #[schema(unit = "Pa")]
    fn pressure() -> Vec<f32>;
}

struct Tongs;

impl Gripper for Tongs {
    fn close(&mut self, force_n: f32, _: Option<String>) -> Result<u8, String> {
        if force_n < 0.0 { Err("pushes".into()) } else { Ok(force_n as u8) }
    }

    fn open(&mut self) {}

    fn say(&mut self, module: u8, reply: String, arguments: (u8, u8), function: bool) -> String {
        format!("{module} {reply} {arguments:?} {function}")
    }
}

#[test]
fn a_description_says_it_all() {
    let description = GripperInterface::description();
    assert_eq!((description.name.as_str(), description.class.as_str()), ("Gripper", "gripper"));
    assert_eq!(description.text, "Opens and closes.  A gripper at the end of an arm.");
    let close = description.function("close").unwrap();
    assert_eq!((close.number, close.idempotent, close.text.as_str()), (16, false, "Closes with a force. In newtons."));
    let arguments: Vec<_> = close.arguments.iter().map(|argument| (argument.name.as_str(), &argument.ty)).collect();
    assert_eq!(arguments, [("force_n", &f32::schema()), ("name", &Option::<String>::schema())]);
    assert_eq!(describe_field(&close.arguments[0]), "force_n: f32, 0..=40 N");
    assert_eq!(describe_field(&description.data[0].field), "pressure: [f32] Pa");
    assert_eq!(close.result, Result::<u8, String>::schema());
    let open = description.function("open").unwrap();
    assert!(open.idempotent && open.arguments.is_empty() && open.result == <()>::schema());
    let pressure = description.data_item("pressure").unwrap();
    assert_eq!((pressure.number, &pressure.field.ty), (1, &Vec::<f32>::schema()));
    assert_eq!(Description::from_bytes(&description.to_bytes()), Ok(description));
}

/// Weighs, and remembers.
#[interface(class = "scale", crate = rohrpost_modules::macro_support)]
pub trait Scale {
    /// Whether it is level.
    #[data(2)]
    fn level() -> bool;

    /// What lies on it.
    #[stream(1)]
    #[schema(unit = "kg")]
    fn mass() -> f64;
}

#[test]
fn a_stream_is_described_among_data_and_has_a_port_of_its_own() {
    let description = ScaleInterface::description();
    let kinds: Vec<_> = description.data.iter().map(|item| (item.number, item.kind)).collect();
    assert_eq!(kinds, [(1, DataKind::Stream), (2, DataKind::Data)], "by number, however they are written");
    let streams: Vec<_> = description.streams().map(|item| describe_field(&item.field)).collect();
    assert_eq!(streams, ["mass: f64 kg"]);
    assert_eq!(Description::from_bytes(&description.to_bytes()), Ok(description));
    let port: StreamPort<f64> = ScaleInterface::MASS;
    let (level, newest): (DataPort<bool>, DataPort<f64>) = (ScaleInterface::LEVEL, port.data());
    assert_eq!((port.class, port.number, port.name, level.number), ("scale", 1, "mass", 2));
    assert_eq!((newest.class, newest.number, newest.name), ("scale", 1, "mass"));
    assert_eq!(((port.hash)(), (newest.hash)()), (ScaleInterface::hash(), ScaleInterface::hash()));
}

#[test]
fn what_modules_say_comes_back() {
    for description in [
        CartographerInterface::description(),
        CollectorInterface::description(),
        LaserInterface::description(),
        MotorInterface::description(),
    ] {
        assert_eq!(Description::from_bytes(&description.to_bytes()), Ok(description));
    }
}

#[test]
fn an_older_program_is_refused_by_name() {
    let said = |server| Fault::InterfaceDiffers { server }.to_string();
    let ours = HASH;
    let expected = format!(
        "the module has common functions of version 3, this program has {ours}: run programs of the same version"
    );
    assert!(said(3).starts_with(&expected), "{}", said(3));
    assert!(
        said(0x0040_0000).starts_with("interface differs: the module has 0x00400000; build"),
        "{}",
        said(0x0040_0000)
    );
    // How descriptions began before they had a version: with the length of the name.
    let error = Description::from_bytes(b"\x05Motor\x05motor").unwrap_err().to_string();
    assert!(error.starts_with("descriptions of version 5, this program knows 2"), "{error}");
}

#[test]
fn functions_are_found_by_number_and_what_does_not_fit_is_refused() {
    let serve = |function, arguments: &[u8]| {
        let mut reply = Vec::new();
        GripperInterface::serve(&mut Tongs, function, arguments, &mut reply).map(|()| reply)
    };
    let arguments = |force_n: f32| postcard::to_stdvec(&(force_n, None::<String>)).unwrap();
    assert_eq!(serve(16, &arguments(3.0)), Ok(postcard::to_stdvec(&Ok::<u8, String>(3)).unwrap()));
    assert_eq!(serve(16, &arguments(-1.0)), Ok(postcard::to_stdvec(&Err::<u8, _>("pushes")).unwrap()));
    assert_eq!(serve(17, &[]), Ok(vec![]));
    let names = postcard::to_stdvec(&(1u8, "two", (3u8, 4u8), true)).unwrap();
    assert_eq!(serve(18, &names), Ok(postcard::to_stdvec("1 two (3, 4) true").unwrap()));
    assert_eq!(serve(19, &[]), Err(Fault::Unknown(19)));
    assert_eq!(serve(17, &[1]), Err(Fault::Arguments("1 bytes too many".into())));
    assert!(matches!(serve(16, &arguments(1.0)[..3]), Err(Fault::Arguments(_))));
}

#[test]
fn the_hash_is_of_what_matters() {
    let description = GripperInterface::description();
    let hash = GripperInterface::hash();
    assert_eq!(hash, description.hash());
    let changed = |change: fn(&mut Description)| {
        let mut other = description.clone();
        change(&mut other);
        other.hash() != hash
    };
    assert!(!changed(|d| d.text = "else".into()), "texts do not count");
    assert!(!changed(|d| d.functions[0].text.clear()), "texts do not count");
    assert!(!changed(|d| d.data[0].field.text.clear()), "texts do not count");
    assert!(changed(|d| d.functions[0].number = 19), "numbers do");
    assert!(changed(|d| d.functions[0].name = "shut".into()), "names do");
    assert!(changed(|d| d.functions[0].arguments[0].ty = f64::schema()), "types do");
    assert!(changed(|d| d.functions[0].arguments[0].unit = "mN".into()), "units do");
    assert!(!changed(|d| d.functions[0].arguments[0].most = None), "ranges do not");
    assert!(changed(|d| d.functions[0].arguments.reverse()), "their order does");
    assert!(changed(|d| d.functions[1].result = u8::schema()), "results do");
    assert!(changed(|d| d.functions[1].idempotent = false), "what may be repeated does");
    assert!(changed(|d| d.data[0].field.ty = Vec::<f64>::schema()), "data do");
    assert!(changed(|d| d.data[0].kind = DataKind::Stream), "what is a stream does");
    // Recordings and other nodes have it: it does not change with the compiler or from run to run.
    assert_eq!(
        hash, 1_809_337_075,
        "the hash has changed, and with it the wire: raise the layout version if that is meant"
    );
}
