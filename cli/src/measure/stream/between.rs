//! The value between two others of a type that is known by its description alone.
//!
//! It is what `#[derive(Interpolate)]` gives where the description tells as much. Numbers with a fraction go in a
//! straight line; where their unit is `rad` they are headings and go the short way round. Structs go field by field,
//! arrays and tuples element by element. All else has no values in between, and comes from the record that is nearer in
//! time, the earlier one in the middle: whole numbers, flags, texts, enums, optional values, lists, maps, bytes. A
//! type's own `earlier` and `nearer` are not in its description.

use rohrpost::fusion::{Heading, Interpolate, Share};
use rohrpost::schema::{Field, Members, Type, Value};

const HEADING_UNIT: &str = "rad";

/// The value of this field so much of the way from one to the other, both of its type.
pub(super) fn between(field: &Field, from: &Value, to: &Value, share: Share) -> Value {
    of_type(&field.ty, &field.unit, from, to, share)
}

fn of_type(ty: &Type, unit: &str, from: &Value, to: &Value, share: Share) -> Value {
    match (ty, from, to) {
        (Type::F64, Value::F(from), Value::F(to)) => Value::F(number(unit, from, to, share)),
        // Values have the shortest decimal of such a number.
        (Type::F32, Value::F(from), Value::F(to)) => {
            let single = number(unit, &(*from as f32), &(*to as f32), share);
            Value::F(single.to_string().parse().unwrap_or(f64::from(single)))
        }
        (Type::Array(_, element), Value::List(from), Value::List(to)) => {
            list(from, to, std::iter::repeat(element.as_ref()), |ty, from, to| of_type(ty, unit, from, to, share))
        }
        (Type::Tuple(elements), Value::List(from), Value::List(to)) => {
            list(from, to, elements.iter(), |ty, from, to| of_type(ty, unit, from, to, share))
        }
        (Type::Struct(named), ..) => of_members(&named.members, unit, from, to, share),
        _ => share.nearer(from, to).clone(),
    }
}

fn of_members(members: &Members, unit: &str, from: &Value, to: &Value, share: Share) -> Value {
    match (members, from, to) {
        // What wraps one value has the unit of its place, unless it says another.
        (Members::One(field), ..) => {
            let unit = if field.unit.is_empty() { unit } else { &field.unit };
            of_type(&field.ty, unit, from, to, share)
        }
        (Members::Tuple(fields), Value::List(from), Value::List(to)) => {
            list(from, to, fields.iter(), |field, from, to| between(field, from, to, share))
        }
        (Members::Fields(fields), Value::Map(from), Value::Map(to)) => {
            let pairs = fields.iter().zip(from.iter().zip(to));
            let entries = pairs.map(|(field, (from, to))| (from.0.clone(), between(field, &from.1, &to.1, share)));
            Value::Map(entries.collect())
        }
        _ => share.nearer(from, to).clone(),
    }
}

fn list<'t, T: 't>(
    from: &[Value],
    to: &[Value],
    types: impl Iterator<Item = &'t T>,
    between: impl Fn(&T, &Value, &Value) -> Value,
) -> Value {
    Value::List(types.zip(from.iter().zip(to)).map(|(ty, (from, to))| between(ty, from, to)).collect())
}

fn number<F: Interpolate + Heading>(unit: &str, from: &F, to: &F, share: Share) -> F {
    if unit == HEADING_UNIT { F::turn(from, to, share) } else { F::interpolate(from, to, share) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost::schema::{Data, Schema, decode};
    use rohrpost::types::{Odometry, Pose, Twist};
    use rohrpost::wire::append;

    #[rohrpost::data]
    #[derive(Clone, Copy, Debug, PartialEq, Interpolate)]
    struct Wrist(#[interpolate(heading)] f64);

    #[rohrpost::data]
    #[derive(Clone, Debug, PartialEq)]
    enum Grip {
        Open,
        Holds(String),
    }

    #[rohrpost::data]
    #[derive(Clone, Debug, PartialEq, Interpolate)]
    struct Arm {
        reach_m: f32,
        #[schema(unit = "rad")]
        #[interpolate(heading)]
        heading_rad: f32,
        joints: [f64; 3],
        pose: Pose,
        #[interpolate(nearer)]
        grip: Grip,
        #[interpolate(nearer)]
        count: u64,
        #[interpolate(nearer)]
        steps: i16,
        #[interpolate(nearer)]
        is_on: bool,
        #[interpolate(nearer)]
        load_kg: Option<f64>,
        #[interpolate(nearer)]
        ranges_m: Vec<f64>,
        #[interpolate(nearer)]
        picture: Vec<u8>,
    }

    fn value<T: Data>(of: &T) -> Value {
        let mut bytes = Vec::new();
        append(&mut bytes, of).unwrap();
        decode(&T::schema(), &bytes).unwrap()
    }

    #[track_caller]
    fn check<T: Data + Interpolate>(from: &T, to: &T) {
        let field = Field::new("value", T::schema());
        for at_ns in 0..=8 {
            let share = Share::between(0, at_ns, 8).unwrap();
            let typed = value(&T::interpolate(from, to, share));
            assert_eq!(between(&field, &value(from), &value(to), share), typed, "{at_ns} of 8");
        }
    }

    fn pose(x_m: f64, y_m: f64, heading_rad: f64) -> Pose {
        Pose { x_m, y_m, heading_rad }
    }

    #[test]
    fn odometry_is_what_its_own_type_gives() {
        for (from_rad, to_rad) in [(3.0, -3.0), (-3.0, 3.0), (0.1, 0.4), (0.0, std::f64::consts::PI), (1.0, 8.0)] {
            let from = Odometry { pose: pose(1.0, -2.0, from_rad), twist: Twist::default() };
            let twist = Twist { speed_m_s: 0.7, turn_rate_rad_s: -0.3 };
            check(&from, &Odometry { pose: pose(1.1, -2.7, to_rad), twist });
        }
    }

    #[test]
    fn a_type_that_says_nearer_where_there_is_nothing_in_between_gives_the_same() {
        let from = Arm {
            reach_m: 1.2,
            heading_rad: 3.1,
            joints: [0.0, 1.0, -1.0],
            pose: pose(0.0, 0.0, 3.0),
            grip: Grip::Open,
            count: 7,
            steps: -4,
            is_on: false,
            load_kg: None,
            ranges_m: vec![1.0, 2.0],
            picture: vec![0, 9],
        };
        let to = Arm {
            reach_m: 1.7,
            heading_rad: -3.1,
            joints: [0.3, 1.0, 2.0],
            pose: pose(0.1, 0.2, -3.0),
            grip: Grip::Holds("cup".into()),
            count: 17,
            steps: 4,
            is_on: true,
            load_kg: Some(0.3),
            ranges_m: vec![2.0, 4.0],
            picture: vec![1],
        };
        check(&from, &to);
        check(&to, &from);
    }

    #[test]
    fn a_unit_outside_holds_for_what_is_inside() {
        let half = Share::between(0, 1, 2).unwrap();
        let turn = |field: &Field| between(field, &Value::F(3.0), &Value::F(-3.0), half);
        let Value::F(straight) = turn(&Field::new("wrist", Wrist::schema())) else { panic!("a number") };
        assert_eq!(straight, 0.0);
        let heading = Field::new("wrist", Wrist::schema()).said("", "rad");
        assert_eq!(turn(&heading), value(&Wrist::interpolate(&Wrist(3.0), &Wrist(-3.0), half)));
        assert_eq!(turn(&Field::new("rate", Type::F64).said("", "rad/s")), Value::F(0.0));
    }

    #[test]
    fn tuples_go_element_by_element() {
        let field = Field::new("pair", <(f64, u8)>::schema());
        let late = Share::between(0, 3, 4).unwrap();
        assert_eq!(between(&field, &value(&(0.0, 1_u8)), &value(&(1.0, 2_u8)), late), value(&(0.75, 2_u8)));
    }
}
