//! Parameters of a module, by their descriptions.

use rohrpost_modules::parameter::{Parameter, ParameterSet, Refusal, from_file, value_text};
use rohrpost_schema::{Field, Value, decode};
use std::cmp::Ordering;

/// A setting that may change while the module runs.
#[derive(Clone, Debug)]
pub struct NativeParameter {
    /// Its name as the configuration has it, text, unit, type and range.
    pub field: Field,
    /// Postcard of the value that it has if the configuration says none.
    pub default: Vec<u8>,
}

/// All of a module, with their present values.
pub(crate) struct Parameters(Vec<Parameter>);

impl Parameters {
    pub(crate) fn new(declared: Vec<NativeParameter>) -> Self {
        Self(declared.into_iter().map(|NativeParameter { field, default: value }| Parameter { field, value }).collect())
    }

    /// Whether there is one of this name.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.0.iter().any(|parameter| parameter.field.name == name)
    }

    /// The value that the configuration says.
    pub(crate) fn configure(&mut self, name: &str, value: &Value) -> Result<(), Refusal> {
        let Some(index) = self.index(name) else { return Ok(()) };
        let refused = |text| Refusal::Type { name: name.to_owned(), text };
        let bytes = from_file(&self.0[index].field.ty, value).map_err(refused)?;
        self.0[index].value = self.accept(index, &bytes)?;
        Ok(())
    }

    /// The present value, in postcard.
    pub(crate) fn value(&self, name: &str) -> Option<&[u8]> {
        Some(&self.0[self.index(name)?].value)
    }

    /// The module itself sets one.
    pub(crate) fn set(&mut self, name: &str, value: &[u8]) -> Result<(), Refusal> {
        let unknown = || Refusal::Unknown { name: name.to_owned(), known: self.names().join(", ") };
        let index = self.index(name).ok_or_else(unknown)?;
        self.0[index].value = self.accept(index, value)?;
        Ok(())
    }

    fn index(&self, name: &str) -> Option<usize> {
        self.0.iter().position(|parameter| parameter.field.name == name)
    }
}

impl ParameterSet for Parameters {
    fn names(&self) -> Vec<&str> {
        self.0.iter().map(|parameter| parameter.field.name.as_str()).collect()
    }

    fn get(&self, index: usize) -> Option<Parameter> {
        self.0.get(index).cloned()
    }

    fn accept(&self, index: usize, value: &[u8]) -> Result<Vec<u8>, Refusal> {
        let Parameter { field, .. } = self.0.get(index).ok_or(Refusal::NoParameters)?;
        let refused = |text: String| Refusal::Type { name: field.name.clone(), text };
        let decoded = decode(&field.ty, value).map_err(|error| refused(error.to_string()))?;
        if is_within(field, &decoded) {
            return Ok(value.to_vec());
        }
        let parameter = Parameter { field: field.clone(), value: value.to_vec() };
        Err(Refusal::Range {
            name: field.name.clone(),
            value: field.with_unit(&value_text(&decoded)),
            range: field.with_unit(&parameter.range()),
        })
    }

    fn put(&mut self, index: usize, value: &[u8]) {
        if let Some(parameter) = self.0.get_mut(index) {
            parameter.value = value.to_vec();
        }
    }
}

/// Whether a value lies in the field's range; a number that is not finite lies in none.
fn is_within(field: &Field, value: &Value) -> bool {
    if let Value::F(number) = value
        && !number.is_finite()
    {
        return false;
    }
    let (lower, upper) = field.bounds();
    let is_least = |least: &Value| matches!(compare(value, least), Some(Ordering::Equal | Ordering::Greater));
    let is_most = |most: &Value| matches!(compare(value, most), Some(Ordering::Equal | Ordering::Less));
    lower.as_ref().is_none_or(is_least) && upper.as_ref().is_none_or(is_most)
}

fn compare(value: &Value, bound: &Value) -> Option<Ordering> {
    match (value, bound) {
        (Value::I(value), Value::I(bound)) => Some(value.cmp(bound)),
        (Value::U(value), Value::U(bound)) => Some(value.cmp(bound)),
        (Value::F(value), Value::F(bound)) => value.partial_cmp(bound),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost_schema::{Type, encode};

    fn speed() -> Parameters {
        let bytes = |number: f64| number.to_le_bytes().to_vec();
        let field = Field::new("speed-m-s", Type::F64).said("", "m/s").bounded(Some(bytes(0.0)), Some(bytes(0.2)));
        Parameters::new(vec![NativeParameter { field, default: bytes(0.05) }])
    }

    #[test]
    fn values_are_taken_in_their_range_and_refused_with_the_words_of_others_outside() {
        let parameters = speed();
        for (value, expected) in [
            (0.0, None),
            (0.2, None),
            (0.3, Some("`speed-m-s` is 0.3 m/s, out of range: 0..=0.2 m/s")),
            (-0.1, Some("`speed-m-s` is -0.1 m/s, out of range: 0..=0.2 m/s")),
            (f64::NAN, Some("`speed-m-s` is NaN m/s, out of range: 0..=0.2 m/s")),
        ] {
            let bytes = encode(&Type::F64, &Value::F(value)).unwrap();
            let told = parameters.accept(0, &bytes).map_err(|refusal| refusal.to_string());
            assert_eq!(told.err().as_deref(), expected, "{value}");
        }
        let field = Field::new("any", Type::F64);
        let any = Parameters::new(vec![NativeParameter { field, default: vec![0; 8] }]);
        for number in [f64::NAN, f64::INFINITY] {
            assert!(matches!(any.accept(0, &number.to_le_bytes()), Err(Refusal::Range { .. })), "{number}");
        }
        assert!(any.accept(0, &1e300_f64.to_le_bytes()).is_ok());
        assert!(matches!(parameters.accept(0, &[1]), Err(Refusal::Type { .. })));
        assert!(matches!(parameters.accept(1, &[1]), Err(Refusal::NoParameters)));
    }

    #[test]
    fn the_configuration_says_values_and_what_is_wrong_with_them() {
        let mut parameters = speed();
        parameters.configure("speed-m-s", &Value::F(0.1)).unwrap();
        assert_eq!(parameters.value("speed-m-s"), Some(&0.1_f64.to_le_bytes()[..]));
        let text = parameters.configure("speed-m-s", &Value::Text("0.1".into())).unwrap_err().to_string();
        assert!(text.contains("without quotes"), "{text}");
        assert!(parameters.configure("speed-m-s", &Value::F(1.0)).unwrap_err().to_string().contains("out of range"));
    }
}
