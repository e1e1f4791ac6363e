//! What `proto.rs` has, described to readers as protobuf does it: a set of files with all that a message needs.

use super::kind::Kind;
use prost::Message;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{
    DescriptorProto, EnumDescriptorProto, EnumValueDescriptorProto, FieldDescriptorProto, FileDescriptorProto,
    FileDescriptorSet,
};

/// How such types are described in MCAP.
pub(crate) const SCHEMA_ENCODING: &str = "protobuf";
/// How such messages are encoded.
pub(crate) const MESSAGE_ENCODING: &str = "protobuf";

const PACKAGE: &str = "foxglove";
const TIMESTAMP: &str = "google.protobuf.Timestamp";
const TIMESTAMP_FILE: &str = "google/protobuf/timestamp.proto";

/// What a field is.
#[derive(Clone, Copy)]
enum FieldKind {
    Double,
    Fixed32,
    Text,
    Bytes,
    /// A message of this full name.
    One(&'static str),
    /// Any number of them.
    Many(&'static str),
    /// A number of an enum of this full name.
    Choice(&'static str),
}

type FieldTable = &'static [(&'static str, i32, FieldKind)];

const STAMP: (&str, i32, FieldKind) = ("timestamp", 1, FieldKind::One(TIMESTAMP));

const VECTOR3: FieldTable = &[("x", 1, FieldKind::Double), ("y", 2, FieldKind::Double), ("z", 3, FieldKind::Double)];
const QUATERNION: FieldTable = &[
    ("x", 1, FieldKind::Double),
    ("y", 2, FieldKind::Double),
    ("z", 3, FieldKind::Double),
    ("w", 4, FieldKind::Double),
];
const POSE: FieldTable =
    &[("position", 1, FieldKind::One("foxglove.Vector3")), ("orientation", 2, FieldKind::One("foxglove.Quaternion"))];
const PACKED_ELEMENT_FIELD: FieldTable = &[
    ("name", 1, FieldKind::Text),
    ("offset", 2, FieldKind::Fixed32),
    ("type", 3, FieldKind::Choice("foxglove.PackedElementField.NumericType")),
];
const NUMERIC_TYPES: &[&str] =
    &["UNKNOWN", "UINT8", "INT8", "UINT16", "INT16", "UINT32", "INT32", "FLOAT32", "FLOAT64"];
const LEVELS: &[&str] = &["UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL"];

impl Kind {
    const fn fields(self) -> FieldTable {
        match self {
            Self::Transform => &[
                STAMP,
                ("parent_frame_id", 2, FieldKind::Text),
                ("child_frame_id", 3, FieldKind::Text),
                ("translation", 4, FieldKind::One("foxglove.Vector3")),
                ("rotation", 5, FieldKind::One("foxglove.Quaternion")),
            ],
            Self::Pose => &[STAMP, ("frame_id", 2, FieldKind::Text), ("pose", 3, FieldKind::One("foxglove.Pose"))],
            Self::Poses => &[STAMP, ("frame_id", 2, FieldKind::Text), ("poses", 3, FieldKind::Many("foxglove.Pose"))],
            Self::Points => &[
                STAMP,
                ("frame_id", 2, FieldKind::Text),
                ("pose", 3, FieldKind::One("foxglove.Pose")),
                ("point_stride", 4, FieldKind::Fixed32),
                ("fields", 5, FieldKind::Many("foxglove.PackedElementField")),
                ("data", 6, FieldKind::Bytes),
            ],
            Self::Image => &[
                STAMP,
                ("frame_id", 7, FieldKind::Text),
                ("width", 2, FieldKind::Fixed32),
                ("height", 3, FieldKind::Fixed32),
                ("encoding", 4, FieldKind::Text),
                ("step", 5, FieldKind::Fixed32),
                ("data", 6, FieldKind::Bytes),
            ],
            Self::Compressed => &[
                STAMP,
                ("frame_id", 4, FieldKind::Text),
                ("data", 2, FieldKind::Bytes),
                ("format", 3, FieldKind::Text),
            ],
            Self::Log => &[
                STAMP,
                ("level", 2, FieldKind::Choice("foxglove.Log.Level")),
                ("message", 3, FieldKind::Text),
                ("name", 4, FieldKind::Text),
            ],
        }
    }
}

/// One set for all kinds: what a channel does not need costs it a kilobyte once.
pub(crate) fn descriptor_set() -> Vec<u8> {
    let parts: [(&str, FieldTable); 4] = [
        ("Vector3", VECTOR3),
        ("Quaternion", QUATERNION),
        ("Pose", POSE),
        ("PackedElementField", PACKED_ELEMENT_FIELD),
    ];
    let mut messages: Vec<DescriptorProto> = parts.iter().map(|(name, fields)| message(name, fields)).collect();
    messages.extend(Kind::ALL.iter().map(|kind| message(kind.message_name(), kind.fields())));
    for message in &mut messages {
        match message.name() {
            "PackedElementField" => message.enum_type.push(choices("NumericType", NUMERIC_TYPES)),
            "Log" => message.enum_type.push(choices("Level", LEVELS)),
            _ => {}
        }
    }
    let drawn =
        FileDescriptorProto { dependency: vec![TIMESTAMP_FILE.into()], ..file("foxglove.proto", PACKAGE, messages) };
    FileDescriptorSet { file: vec![timestamp(), drawn] }.encode_to_vec()
}

fn file(name: &str, package: &str, message_type: Vec<DescriptorProto>) -> FileDescriptorProto {
    FileDescriptorProto {
        name: Some(name.into()),
        package: Some(package.into()),
        message_type,
        syntax: Some("proto3".into()),
        ..FileDescriptorProto::default()
    }
}

/// What protobuf has itself.
fn timestamp() -> FileDescriptorProto {
    let integer = |name: &str, number, ty| FieldDescriptorProto {
        name: Some(name.into()),
        number: Some(number),
        label: Some(Label::Optional.into()),
        r#type: Some(i32::from(ty)),
        json_name: Some(name.into()),
        ..FieldDescriptorProto::default()
    };
    let field = vec![integer("seconds", 1, Type::Int64), integer("nanos", 2, Type::Int32)];
    let message = DescriptorProto { name: Some("Timestamp".into()), field, ..DescriptorProto::default() };
    file(TIMESTAMP_FILE, "google.protobuf", vec![message])
}

fn message(name: &str, fields: FieldTable) -> DescriptorProto {
    let field = fields.iter().map(|(name, number, of)| field(name, *number, *of)).collect();
    DescriptorProto { name: Some(name.into()), field, ..DescriptorProto::default() }
}

fn field(name: &str, number: i32, of: FieldKind) -> FieldDescriptorProto {
    let (ty, type_name) = match of {
        FieldKind::Double => (Type::Double, None),
        FieldKind::Fixed32 => (Type::Fixed32, None),
        FieldKind::Text => (Type::String, None),
        FieldKind::Bytes => (Type::Bytes, None),
        FieldKind::One(name) | FieldKind::Many(name) => (Type::Message, Some(name)),
        FieldKind::Choice(name) => (Type::Enum, Some(name)),
    };
    let label = if matches!(of, FieldKind::Many(_)) { Label::Repeated } else { Label::Optional };
    FieldDescriptorProto {
        name: Some(name.into()),
        number: Some(number),
        label: Some(label.into()),
        r#type: Some(ty.into()),
        type_name: type_name.map(|name| format!(".{name}")),
        ..FieldDescriptorProto::default()
    }
}

fn choices(name: &str, names: &[&str]) -> EnumDescriptorProto {
    let value = |(number, name): (i32, &&str)| EnumValueDescriptorProto {
        name: Some((*name).into()),
        number: Some(number),
        ..EnumValueDescriptorProto::default()
    };
    let value = (0..).zip(names).map(value).collect();
    EnumDescriptorProto { name: Some(name.into()), value, ..EnumDescriptorProto::default() }
}
