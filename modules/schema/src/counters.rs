//! Counters: numbers of a struct, each with the name, the unit and the text of its field.

use crate::{Field, Members, Schema, Type, Value, decode};
use serde::Serialize;

/// The counters of a type: its fields of type `u64` that have a unit.
///
/// ```
/// use rohrpost_schema::{Schema, counter_fields, counters};
///
/// #[derive(serde::Serialize, Schema)]
/// struct Wire {
///     name: String,
///     /// Datagrams that never came.
///     #[schema(unit = "datagrams")]
///     lost: u64,
/// }
/// assert_eq!(counter_fields::<Wire>()[0].text, "Datagrams that never came.");
/// let counted = counters(&Wire { name: "eth0".into(), lost: 7 });
/// assert_eq!(counted.iter().map(|(field, count)| (&*field.name, *count)).collect::<Vec<_>>(), [("lost", 7)]);
/// ```
pub fn counter_fields<T: Schema>() -> Vec<Field> {
    let Type::Struct(named) = T::schema() else { return Vec::new() };
    let Members::Fields(fields) = named.members else { return Vec::new() };
    fields.into_iter().filter(is_counter).collect()
}

/// The counters of a value, in the order of [`counter_fields`]: fields and counts.
pub fn counters<T: Schema + Serialize>(value: &T) -> Vec<(Field, u64)> {
    let bytes = postcard::to_stdvec(value).unwrap_or_default();
    let Ok(Value::Map(values)) = decode(&T::schema(), &bytes) else { return Vec::new() };
    let count = |field: Field| {
        let (_, value) = values.iter().find(|(name, _)| *name == field.name)?;
        let Value::U(count) = value else { return None };
        Some((field, u64::try_from(*count).ok()?))
    };
    counter_fields::<T>().into_iter().filter_map(count).collect()
}

fn is_counter(field: &Field) -> bool {
    field.ty == Type::U64 && !field.unit.is_empty()
}
