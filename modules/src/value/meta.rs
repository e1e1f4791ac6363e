//! The description of descriptions: a module that describes itself sends one, and tools print it like any other data. And what
//! descriptions are put together of.

use postcard_schema::schema::owned::{
    OwnedDataModelType as Ty, OwnedDataModelVariant as VariantTy, OwnedNamedType, OwnedNamedValue, OwnedNamedVariant,
};
use std::sync::LazyLock;

/// What `Schema` stands for. A description contains descriptions, so it names itself by `Schema` inside.
pub(super) static DESCRIPTION: LazyLock<OwnedNamedType> =
    LazyLock::new(|| structure("OwnedNamedType", vec![field("name", text()), field("ty", data_model_type())]));

/// As [`Ty`], in its order, which gives the numbers of the variants.
fn data_model_type() -> OwnedNamedType {
    let mut variants = units(&[
        "Bool",
        "I8",
        "U8",
        "I16",
        "I32",
        "I64",
        "I128",
        "U16",
        "U32",
        "U64",
        "U128",
        "Usize",
        "Isize",
        "F32",
        "F64",
        "Char",
        "String",
        "ByteArray",
    ]);
    variants.push(newtype("Option", itself()));
    variants.extend(units(&["Unit", "UnitStruct"]));
    variants.push(newtype("NewtypeStruct", itself()));
    variants.push(newtype("Seq", itself()));
    variants.push(newtype("Tuple", list(itself())));
    variants.push(newtype("TupleStruct", list(itself())));
    variants.push(OwnedNamedVariant {
        name: "Map".into(),
        ty: VariantTy::StructVariant(vec![field("key", itself()), field("val", itself())]),
    });
    variants.push(newtype("Struct", list(named_value())));
    variants.push(newtype("Enum", list(named_variant())));
    variants.extend(units(&["Schema"]));
    OwnedNamedType { name: "OwnedDataModelType".into(), ty: Ty::Enum(variants) }
}

fn named_value() -> OwnedNamedType {
    structure("OwnedNamedValue", vec![field("name", text()), field("ty", itself())])
}

fn named_variant() -> OwnedNamedType {
    let mut variants = units(&["UnitVariant"]);
    variants.push(newtype("NewtypeVariant", itself()));
    variants.push(newtype("TupleVariant", list(itself())));
    variants.push(newtype("StructVariant", list(named_value())));
    let kind = OwnedNamedType { name: "OwnedDataModelVariant".into(), ty: Ty::Enum(variants) };
    structure("OwnedNamedVariant", vec![field("name", text()), field("ty", kind)])
}

/// A description inside of something else.
pub(crate) fn itself() -> OwnedNamedType {
    OwnedNamedType { name: "OwnedNamedType".into(), ty: Ty::Schema }
}

pub(crate) fn text() -> OwnedNamedType {
    OwnedNamedType { name: "String".into(), ty: Ty::String }
}

pub(crate) fn list(element: OwnedNamedType) -> OwnedNamedType {
    OwnedNamedType { name: "Vec<T>".into(), ty: Ty::Seq(Box::new(element)) }
}

pub(crate) fn structure(name: &str, fields: Vec<OwnedNamedValue>) -> OwnedNamedType {
    OwnedNamedType { name: name.into(), ty: Ty::Struct(fields) }
}

pub(crate) fn field(name: &str, ty: OwnedNamedType) -> OwnedNamedValue {
    OwnedNamedValue { name: name.into(), ty }
}

fn newtype(name: &str, inner: OwnedNamedType) -> OwnedNamedVariant {
    OwnedNamedVariant { name: name.into(), ty: VariantTy::NewtypeVariant(Box::new(inner)) }
}

fn units(names: &[&str]) -> Vec<OwnedNamedVariant> {
    names.iter().map(|name| OwnedNamedVariant { name: (*name).into(), ty: VariantTy::UnitVariant }).collect()
}
