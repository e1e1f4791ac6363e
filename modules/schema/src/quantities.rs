//! Quantities: numbers of a struct, each with the name, the unit and the text of its field.

use crate::{Field, Members, Schema, Type, Value, decode};
use serde::Serialize;

/// Units of times, which are quantities and no counters.
const TIMES: [&str; 2] = ["ns", "ms"];

/// The quantities of a type: its fields that have a unit and are a `u32`, a `u64` or an optional `u64`.
///
/// ```
/// use rohrpost_schema::{Schema, counters, quantities, quantity_fields};
///
/// #[derive(serde::Serialize, Schema)]
/// struct Wire {
///     name: String,
///     /// Datagrams that never came.
///     #[schema(unit = "datagrams")]
///     lost: u64,
///     /// The slowest datagram.
///     #[schema(unit = "ns")]
///     worst_ns: Option<u64>,
/// }
/// let wire = Wire { name: "eth0".into(), lost: 7, worst_ns: None };
/// assert_eq!(quantity_fields::<Wire>()[0].text, "Datagrams that never came.");
/// let found = quantities(&wire);
/// assert_eq!(found.iter().map(|(field, value)| (&*field.name, *value)).collect::<Vec<_>>(), [
///     ("lost", Some(7)),
///     ("worst_ns", None),
/// ]);
/// assert_eq!(counters(&wire).len(), 1);
/// ```
pub fn quantity_fields<T: Schema>() -> Vec<Field> {
    let Type::Struct(named) = T::schema() else { return Vec::new() };
    let Members::Fields(fields) = named.members else { return Vec::new() };
    fields.into_iter().filter(|field| !field.unit.is_empty() && is_number(&field.ty)).collect()
}

/// The quantities of a value, in the order of [`quantity_fields`]; none where an optional one has no value.
pub fn quantities<T: Schema + Serialize>(value: &T) -> Vec<(Field, Option<u64>)> {
    let bytes = postcard::to_stdvec(value).unwrap_or_default();
    let Ok(Value::Map(values)) = decode(&T::schema(), &bytes) else { return Vec::new() };
    let number = |name: &str| match values.iter().find(|(known, _)| *known == *name)?.1 {
        Value::U(number) => u64::try_from(number).ok(),
        _ => None,
    };
    quantity_fields::<T>()
        .into_iter()
        .map(|field| {
            let value = number(&field.name);
            (field, value)
        })
        .collect()
}

/// Those quantities of a value that count: `u64`, and no times.
pub fn counters<T: Schema + Serialize>(value: &T) -> Vec<(Field, u64)> {
    let counts = |field: &Field| field.ty == Type::U64 && !TIMES.contains(&field.unit.as_str());
    let all = quantities(value).into_iter().filter(|(field, _)| counts(field));
    all.filter_map(|(field, count)| Some((field, count?))).collect()
}

fn is_number(ty: &Type) -> bool {
    match ty {
        Type::Option(inner) => **inner == Type::U64,
        ty => [Type::U32, Type::U64].contains(ty),
    }
}
