//! Random types with random values and with random bytes.

use super::{check_cuts, check_value, named};
use crate::value::{Value, decode, describe_type, encode, is_word, parse_argument, scalar, types};
use postcard_schema::schema::owned::{
    OwnedDataModelType as Ty, OwnedDataModelVariant as VariantTy, OwnedNamedType, OwnedNamedValue, OwnedNamedVariant,
};
use proptest::{collection::vec, prelude::*};
use rand::{Rng, SeedableRng, seq::IndexedRandom};
use rand_chacha::ChaCha8Rng;

const LEAVES: [Ty; 21] = [
    Ty::Bool,
    Ty::I8,
    Ty::I16,
    Ty::I32,
    Ty::I64,
    Ty::I128,
    Ty::Isize,
    Ty::U8,
    Ty::U16,
    Ty::U32,
    Ty::U64,
    Ty::U128,
    Ty::Usize,
    Ty::F32,
    Ty::F64,
    Ty::Char,
    Ty::String,
    Ty::ByteArray,
    Ty::Unit,
    Ty::UnitStruct,
    Ty::Schema,
];

fn types() -> impl Strategy<Value = OwnedNamedType> {
    let leaf = prop::sample::select(LEAVES.to_vec()).prop_map(named);
    leaf.prop_recursive(5, 40, 5, |inner| {
        let boxed = || inner.clone().prop_map(Box::new);
        let some = || vec(inner.clone(), 0..5);
        let fields = || some().prop_map(|types| numbered(types, |name, ty| OwnedNamedValue { name, ty }));
        let variant = prop_oneof![
            Just(VariantTy::UnitVariant),
            boxed().prop_map(VariantTy::NewtypeVariant),
            some().prop_map(VariantTy::TupleVariant),
            fields().prop_map(VariantTy::StructVariant),
        ];
        let enums = vec(variant, 1..5);
        prop_oneof![
            boxed().prop_map(Ty::Option),
            boxed().prop_map(Ty::NewtypeStruct),
            boxed().prop_map(Ty::Seq),
            some().prop_map(Ty::Tuple),
            some().prop_map(Ty::TupleStruct),
            (boxed(), boxed()).prop_map(|(key, val)| Ty::Map { key, val }),
            fields().prop_map(Ty::Struct),
            enums.prop_map(|types| Ty::Enum(numbered(types, |name, ty| OwnedNamedVariant { name, ty }))),
            (1u8..5).prop_map(|n| Ty::Enum(numbered(vec![VariantTy::UnitVariant; n.into()], |name, ty| {
                OwnedNamedVariant { name, ty }
            }))),
        ]
        .prop_map(named)
    })
}

fn numbered<T, N>(types: Vec<T>, make: impl Fn(String, T) -> N) -> Vec<N> {
    types.into_iter().enumerate().map(|(index, ty)| make(format!("n{index}"), ty)).collect()
}

/// A random value in the form that decoding gives.
fn sample(ty: &OwnedNamedType, rng: &mut ChaCha8Rng) -> Value {
    let ty = types::unwrapped(ty);
    if let Some(integer) = scalar::Integer::of(&ty.ty) {
        let bits = rng.random_range(1..=integer.bits);
        let raw = rng.random::<u128>() >> (128 - bits);
        let signed = (raw << (128 - integer.bits)) as i128 >> (128 - integer.bits);
        return if integer.signed { Value::I(signed) } else { Value::U(raw) };
    }
    let length = rng.random_range(0..4);
    match &ty.ty {
        Ty::Bool => Value::Bool(rng.random()),
        Ty::F32 => Value::F(scalar::shortest(f32::from_bits(rng.random()))),
        Ty::F64 => Value::F(f64::from_bits(rng.random())),
        Ty::Char => Value::Char(rng.random()),
        Ty::String => Value::Text((0..length).map(|_| rng.random::<char>()).collect()),
        Ty::ByteArray => Value::Bytes((0..length).map(|_| rng.random()).collect()),
        Ty::Seq(inner) if types::is_byte(inner) => Value::Bytes((0..length).map(|_| rng.random()).collect()),
        Ty::Seq(inner) => Value::List((0..length).map(|_| sample(inner, rng)).collect()),
        Ty::Option(_) if rng.random() => Value::Null,
        Ty::Option(inner) if types::is_nullable(inner) => Value::Variant("Some".into(), Box::new(sample(inner, rng))),
        Ty::Option(inner) => sample(inner, rng),
        Ty::Tuple(inner) | Ty::TupleStruct(inner) => Value::List(inner.iter().map(|ty| sample(ty, rng)).collect()),
        Ty::Map { key, val } if is_word(key) => {
            let mut entry = || (crate::value::show::word(&sample(key, rng)), sample(val, rng));
            Value::Map((0..length).map(|_| entry()).collect())
        }
        Ty::Map { key, val } => {
            Value::List((0..length).map(|_| Value::List(vec![sample(key, rng), sample(val, rng)])).collect())
        }
        Ty::Struct(fields) => sample_fields(fields, rng),
        Ty::Enum(variants) => {
            let variant = variants.choose(rng).unwrap();
            let payload = match &variant.ty {
                VariantTy::UnitVariant => Value::Null,
                VariantTy::NewtypeVariant(inner) => sample(inner, rng),
                VariantTy::TupleVariant(inner) if inner.len() == 1 => sample(&inner[0], rng),
                VariantTy::TupleVariant(inner) => Value::List(inner.iter().map(|ty| sample(ty, rng)).collect()),
                VariantTy::StructVariant(fields) => sample_fields(fields, rng),
            };
            Value::Variant(variant.name.clone(), Box::new(payload))
        }
        Ty::Schema => {
            let ty = named(Ty::Seq(Box::new(named(LEAVES.choose(rng).unwrap().clone()))));
            decode(&named(Ty::Schema), &postcard::to_stdvec(&ty).unwrap()).unwrap()
        }
        _ => Value::Null,
    }
}

fn sample_fields(fields: &[OwnedNamedValue], rng: &mut ChaCha8Rng) -> Value {
    Value::Map(fields.iter().map(|field| (field.name.clone(), sample(&field.ty, rng))).collect())
}

proptest! {
    #[test]
    fn values_survive_bytes_and_json(ty in types(), seed: u64) {
        let value = sample(&ty, &mut ChaCha8Rng::seed_from_u64(seed));
        let bytes = check_value(&ty, &value);
        check_cuts(&ty, &bytes);
    }

    #[test]
    fn random_bytes_never_panic(ty in types(), bytes in vec(prop_oneof![Just(0), Just(1), Just(255), any::<u8>()], 0..200)) {
        for start in 0..bytes.len().min(4) {
            if let Ok(value) = decode(&ty, &bytes[start..]) {
                check_value(&ty, &value);
            }
        }
    }

    #[test]
    fn spoilt_bytes_never_panic(ty in types(), seed: u64, place: prop::sample::Index, byte: u8) {
        let mut bytes = encode(&ty, &sample(&ty, &mut ChaCha8Rng::seed_from_u64(seed))).unwrap();
        if !bytes.is_empty() {
            let place = place.index(bytes.len());
            bytes[place] = byte;
            if let Ok(value) = decode(&ty, &bytes) {
                check_value(&ty, &value);
            }
        }
    }

    #[test]
    fn values_of_other_types_never_panic(ty in types(), other in types(), seed: u64, text: String) {
        let value = sample(&other, &mut ChaCha8Rng::seed_from_u64(seed));
        if let Ok(bytes) = encode(&ty, &value) {
            decode(&ty, &bytes).unwrap();
        }
        if let Ok(value) = parse_argument(&ty, &text) {
            check_value(&ty, &value);
        }
        prop_assert!(!describe_type(&ty).is_empty());
    }

    #[test]
    fn every_f32_comes_back(bits: u32) {
        let number = f32::from_bits(bits);
        let back = scalar::shortest(number) as f32;
        prop_assert!(back.to_bits() == bits || number.is_nan() && back.is_nan());
    }

    #[test]
    fn short_decimals_stay_short(digits in -999_999..=999_999, power in 0..=9i32) {
        let typed = format!("{digits}e-{power}");
        prop_assert_eq!(scalar::shortest(typed.parse().unwrap()), typed.parse::<f64>().unwrap());
    }
}
