//! The types of Rust's own library.

use crate::{Field, Members, Named, Schema, Type, deeper};
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

macro_rules! plain {
    ($($ty:ty => $plain:ident)*) => {$(
        impl Schema for $ty {
            const LEVELS: usize = 1;

            fn schema() -> Type {
                Type::$plain
            }
        }
    )*};
}
plain! {
    () => Unit bool => Bool
    u8 => U8 u16 => U16 u32 => U32 u64 => U64 u128 => U128 usize => U64
    i8 => I8 i16 => I16 i32 => I32 i64 => I64 i128 => I128 isize => I64
    f32 => F32 f64 => F64 char => Char String => Text str => Text
}

/// What has another type inside, and adds a level.
macro_rules! around {
    ($(($($generics:tt)*) $ty:ty, $inner:ident => $schema:expr;)*) => {$(
        impl<$($generics)*> Schema for $ty {
            const LEVELS: usize = deeper(&[$inner::LEVELS]);

            fn schema() -> Type {
                $schema
            }
        }
    )*};
}
around! {
    (T: Schema) Option<T>, T => Type::option(T::schema());
    (T: Schema) Vec<T>, T => Type::list(T::schema());
    (T: Schema) [T], T => Type::list(T::schema());
    (T: Schema) BTreeSet<T>, T => Type::list(T::schema());
    (T: Schema, S) HashSet<T, S>, T => Type::list(T::schema());
    (T: Schema, const N: usize) [T; N], T => Type::Array(N as u32, Box::new(T::schema()));
}

/// What serde does not see.
macro_rules! through {
    ($($ty:ty)*) => {$(
        impl<T: Schema + ?Sized> Schema for $ty {
            const LEVELS: usize = T::LEVELS;

            fn schema() -> Type {
                T::schema()
            }
        }
    )*};
}
through! { &T Box<T> }

macro_rules! maps {
    ($(($($generics:tt)*) $ty:ty;)*) => {$(
        impl<K: Schema, V: Schema, $($generics)*> Schema for $ty {
            const LEVELS: usize = deeper(&[K::LEVELS, V::LEVELS]);

            fn schema() -> Type {
                Type::Map(Box::new(K::schema()), Box::new(V::schema()))
            }
        }
    )*};
}
maps! { () BTreeMap<K, V>; (S) HashMap<K, V, S>; }

/// What a function that can fail returns.
impl<T: Schema, E: Schema> Schema for Result<T, E> {
    const LEVELS: usize = deeper(&[T::LEVELS, E::LEVELS]);

    fn schema() -> Type {
        let variant = |name: &str, ty| Named::new(name, Members::One(Box::new(Field::new("", ty))));
        let variants = vec![variant("Ok", T::schema()), variant("Err", E::schema())];
        Type::Enum { name: "Result".into(), text: String::new(), variants }
    }
}

impl Schema for std::time::Duration {
    const LEVELS: usize = 2;

    fn schema() -> Type {
        let fields = vec![Field::new("secs", Type::U64), Field::new("nanos", Type::U32)];
        Type::Struct(Named::new("Duration", Members::Fields(fields)))
    }
}

macro_rules! tuples {
    ($(($($element:ident)*))*) => {$(
        impl<$($element: Schema),*> Schema for ($($element,)*) {
            const LEVELS: usize = deeper(&[$($element::LEVELS),*]);

            fn schema() -> Type {
                Type::Tuple(vec![$($element::schema()),*])
            }
        }
    )*};
}
tuples! { (A) (A B) (A B C) (A B C D) (A B C D E) (A B C D E F) (A B C D E F G) (A B C D E F G H) }
