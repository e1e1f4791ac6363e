//! Parameters of a module, by their descriptions.

use rohrpost_modules::parameter::{Parameter, ParameterSet, Refusal, from_file};
use rohrpost_schema::{Field, Value, encode};

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
    /// The declared ones with their defaults; a refusal of the first that a file could not give back.
    pub(crate) fn new(declared: Vec<NativeParameter>) -> Result<Self, Refusal> {
        let of = |NativeParameter { field, default: value }| checked(Parameter { field, value });
        declared.into_iter().map(of).collect::<Result<_, _>>().map(Self)
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
        checked(Parameter { field: field.clone(), value: value.to_vec() }).map(|parameter| parameter.value)
    }

    fn put(&mut self, index: usize, value: &[u8]) {
        if let Some(parameter) = self.0.get_mut(index) {
            parameter.value = value.to_vec();
        }
    }
}

/// The parameter with its value as it is stored, if it may have that.
fn checked(parameter: Parameter) -> Result<Parameter, Refusal> {
    let value = parameter.checked()?;
    let refused = |text: String| Refusal::Type { name: parameter.field.name.clone(), text };
    let value = encode(&parameter.field.ty, &value).map_err(|error| refused(error.to_string()))?;
    Ok(Parameter { value, ..parameter })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost_schema::Type;

    fn speed() -> Parameters {
        let bytes = |number: f64| number.to_le_bytes().to_vec();
        let field = Field::new("speed-m-s", Type::F64).said("", "m/s").bounded(Some(bytes(0.0)), Some(bytes(0.2)));
        Parameters::new(vec![NativeParameter { field, default: bytes(0.05) }]).unwrap()
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
        let any = Parameters::new(vec![NativeParameter { field, default: vec![0; 8] }]).unwrap();
        for number in [f64::NAN, f64::INFINITY] {
            assert!(matches!(any.accept(0, &number.to_le_bytes()), Err(Refusal::Range { .. })), "{number}");
        }
        assert!(any.accept(0, &1e300_f64.to_le_bytes()).is_ok());
        assert_eq!(any.accept(0, &(-0.0_f64).to_le_bytes()), Ok(vec![0; 8]), "as in Rust");
        assert!(matches!(parameters.accept(0, &[1]), Err(Refusal::Type { .. })));
        assert!(matches!(parameters.accept(1, &[1]), Err(Refusal::NoParameters)));
    }

    #[test]
    fn a_parameter_that_no_file_gives_back_is_refused_at_the_start() {
        let list = (Type::list(Type::F64), vec![0]);
        for ((ty, default), expected) in [
            (list, "`any`: a parameter is bool, an integer of at most 64 bits, f32, f64, text, or"),
            ((Type::F64, f64::NAN.to_le_bytes().to_vec()), "`any` is NaN, out of range: f64"),
            ((Type::U16, vec![0xff]), "`any`: "),
        ] {
            let told = Parameters::new(vec![NativeParameter { field: Field::new("any", ty), default }]).err();
            let told = told.map(|refusal| refusal.to_string()).unwrap_or_default();
            assert!(told.starts_with(expected), "{told}");
        }
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
