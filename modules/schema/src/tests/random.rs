//! Random types with random values and with random bytes.

use super::{check_cuts, check_value};
use crate::bytes::PLAIN;
use crate::{
    Description, Field, Members, Named, SchemaError, Type, Value, decode, describe_type, encode, is_word,
    parse_argument, scalar, show, words,
};
use proptest::{collection::vec, prelude::*};
use rand::{Rng, SeedableRng, seq::IndexedRandom};
use rand_chacha::ChaCha8Rng;

fn types() -> impl Strategy<Value = Type> {
    prop::sample::select(PLAIN.to_vec()).prop_recursive(5, 40, 5, |inner| {
        let boxed = || inner.clone().prop_map(Box::new);
        let some = || vec(inner.clone(), 0..5);
        let variants = vec(members(inner.clone()), 1..5);
        prop_oneof![
            boxed().prop_map(Type::Option),
            boxed().prop_map(Type::List),
            (0u32..4, boxed()).prop_map(|(length, element)| Type::Array(length, element)),
            (boxed(), boxed()).prop_map(|(key, value)| Type::Map(key, value)),
            some().prop_map(Type::Tuple),
            members(inner.clone()).prop_map(|members| Type::Struct(Named::new("S", members).said("a struct"))),
            variants.prop_map(choice),
            (1usize..5).prop_map(|n| choice(vec![Members::None; n])),
        ]
    })
}

fn members(ty: impl Strategy<Value = Type> + Clone) -> impl Strategy<Value = Members> {
    let several = || vec(field(ty.clone()), 0..5);
    prop_oneof![
        Just(Members::None),
        field(ty.clone()).prop_map(|field| Members::One(Box::new(field))),
        several().prop_map(Members::Tuple),
        several().prop_map(|fields| {
            let numbered = |(n, field): (usize, Field)| Field { name: format!("n{n}"), ..field };
            Members::Fields(fields.into_iter().enumerate().map(numbered).collect())
        }),
    ]
}

fn field(ty: impl Strategy<Value = Type>) -> impl Strategy<Value = Field> {
    let bound = || prop::option::of(vec(any::<u8>(), 0..4));
    (ty, "[a-z]{0,2}", "(m/s)?", bound(), bound())
        .prop_map(|(ty, text, unit, least, most)| Field::new("", ty).said(text, unit).bounded(least, most))
}

fn choice(variants: Vec<Members>) -> Type {
    let named = |(n, members)| Named::new(format!("n{n}"), members);
    Type::Enum {
        name: "E".into(),
        text: String::new(),
        variants: variants.into_iter().enumerate().map(named).collect(),
    }
}

/// A random value in the form that decoding gives.
fn sample(ty: &Type, rng: &mut ChaCha8Rng) -> Value {
    let ty = words::unwrapped(ty);
    if let Some(integer) = scalar::Integer::of(ty) {
        let bits = rng.random_range(1..=integer.bits);
        let raw = rng.random::<u128>() >> (128 - bits);
        let signed = (raw << (128 - integer.bits)) as i128 >> (128 - integer.bits);
        return if integer.signed { Value::I(signed) } else { Value::U(raw) };
    }
    let length = rng.random_range(0..4);
    match ty {
        Type::Bool => Value::Bool(rng.random()),
        Type::F32 => Value::F(scalar::shortest(f32::from_bits(rng.random()))),
        Type::F64 => Value::F(f64::from_bits(rng.random())),
        Type::Char => Value::Char(rng.random()),
        Type::Text => Value::Text((0..length).map(|_| rng.random::<char>()).collect()),
        Type::Bytes => Value::Bytes((0..length).map(|_| rng.random()).collect()),
        Type::List(inner) if words::is_byte(inner) => Value::Bytes((0..length).map(|_| rng.random()).collect()),
        Type::List(inner) => Value::List((0..length).map(|_| sample(inner, rng)).collect()),
        Type::Array(length, inner) => Value::List((0..*length).map(|_| sample(inner, rng)).collect()),
        Type::Option(_) if rng.random() => Value::Null,
        Type::Option(inner) if words::is_nullable(inner) => Value::Variant("Some".into(), Box::new(sample(inner, rng))),
        Type::Option(inner) => sample(inner, rng),
        Type::Tuple(inner) => Value::List(inner.iter().map(|ty| sample(ty, rng)).collect()),
        Type::Map(key, val) if is_word(key) => {
            let mut entry = || (show::word(&sample(key, rng)), sample(val, rng));
            Value::Map((0..length).map(|_| entry()).collect())
        }
        Type::Map(key, val) => {
            Value::List((0..length).map(|_| Value::List(vec![sample(key, rng), sample(val, rng)])).collect())
        }
        Type::Struct(named) => sample_members(&named.members, rng),
        Type::Enum { variants, .. } => {
            let variant = variants.choose(rng).unwrap();
            Value::Variant(variant.name.as_str().into(), Box::new(sample_members(&variant.members, rng)))
        }
        _ => Value::Null,
    }
}

fn sample_members(members: &Members, rng: &mut ChaCha8Rng) -> Value {
    match members {
        Members::None => Value::Null,
        Members::One(field) => sample(&field.ty, rng),
        Members::Tuple(fields) => Value::List(fields.iter().map(|field| sample(&field.ty, rng)).collect()),
        Members::Fields(fields) => {
            Value::Map(fields.iter().map(|field| (field.name.as_str().into(), sample(&field.ty, rng))).collect())
        }
    }
}

proptest! {
    #[test]
    fn types_survive_bytes(ty in types()) {
        let bytes = ty.to_bytes();
        prop_assert_eq!(Type::from_bytes(&bytes), Ok(ty.clone()));
        for end in 0..bytes.len() {
            prop_assert_eq!(Type::from_bytes(&bytes[..end]), Err(SchemaError::Short));
        }
        prop_assert_eq!(Type::from_bytes(&[&bytes[..], &[0]].concat()), Err(SchemaError::Long(1)));
        prop_assert!(serde_json::to_string(&ty).is_ok());
    }

    #[test]
    fn whatever_the_bytes_are_they_are_a_type_or_an_error(
        ty in types(), place: prop::sample::Index, byte: u8, bytes in vec(prop_oneof![0u8..30, any::<u8>()], 0..200),
    ) {
        let mut spoilt = ty.to_bytes();
        let place = place.index(spoilt.len());
        spoilt[place] = byte;
        for bytes in [spoilt, [&[1], &bytes[..]].concat()] {
            if let Ok(ty) = Type::from_bytes(&bytes) {
                prop_assert_eq!(Type::from_bytes(&ty.to_bytes()), Ok(ty));
            }
            if let Ok(description) = Description::from_bytes(&bytes) {
                prop_assert_eq!(Description::from_bytes(&description.to_bytes()), Ok(description));
            }
        }
    }

    #[test]
    fn values_survive_bytes_and_json(ty in types(), seed: u64) {
        let value = sample(&ty, &mut ChaCha8Rng::seed_from_u64(seed));
        let bytes = check_value(&ty, &value);
        check_cuts(&ty, &bytes);
    }

    #[test]
    fn random_bytes_never_panic(
        ty in types(),
        bytes in vec(prop_oneof![Just(0), Just(1), Just(255), any::<u8>()], 0..200),
    ) {
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
