//! Modules as a recording describes them: replay stands in for them without their programs.

use rohrpost_schema::Description;
use rohrpost_schema::plain::ForeignText;
use std::collections::BTreeMap;

/// A module's name.
const NAME: &str = "name";
/// Its class, for people.
const CLASS: &str = "class";
/// The hash of its interface, for people.
const INTERFACE: &str = "interface";
/// Bytes of the description, two hexadecimal digits each: metadata of MCAP are texts.
const BYTES: &str = "description";

/// A module of which something is recorded, and what it offers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DescribedModule {
    /// As the configuration has it: `laser.0`.
    pub name: ForeignText,
    /// What it says of itself.
    pub description: Description,
}

impl DescribedModule {
    /// As metadata.
    pub(crate) fn texts(&self) -> BTreeMap<String, String> {
        let Self { name, description } = self;
        let texts = [
            (NAME, name.as_str().to_owned()),
            (CLASS, description.class.clone()),
            (INTERFACE, format!("{:08x}", description.hash())),
            (BYTES, description.to_bytes().iter().map(|byte| format!("{byte:02x}")).collect()),
        ];
        texts.into_iter().map(|(key, text)| (key.to_owned(), text)).collect()
    }

    /// Reads metadata; none if it is not readable.
    pub(crate) fn read(texts: &BTreeMap<String, String>) -> Option<Self> {
        let (digits, rest) = texts.get(BYTES)?.as_bytes().as_chunks::<2>();
        let byte = |digits: &[u8; 2]| u8::from_str_radix(std::str::from_utf8(digits).ok()?, 16).ok();
        let bytes: Vec<u8> = digits.iter().map(byte).collect::<Option<_>>().filter(|_| rest.is_empty())?;
        Some(Self { name: texts.get(NAME)?.as_str().into(), description: Description::from_bytes(&bytes).ok()? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rohrpost_schema::{DataItem, DataKind, Field, Type};

    #[test]
    fn descriptions_come_back_from_texts_and_what_is_broken_does_not() {
        let field = Field::new("heading", Type::F64).said("From east.", "rad");
        let description = Description {
            name: "Compass".into(),
            class: "compass".into(),
            text: "Where north is, ±1°.".into(),
            functions: Vec::new(),
            data: vec![DataItem { number: 1, kind: DataKind::Stream, field }],
        };
        let module = DescribedModule { name: "compass.0".into(), description };
        let texts = module.texts();
        assert_eq!(DescribedModule::read(&texts), Some(module));
        let bytes = texts[BYTES].clone();
        for broken in ["", "0", "zz", "+1", "é0", &bytes[1..], &bytes[2..]] {
            let texts = BTreeMap::from([(NAME.to_owned(), "a.0".to_owned()), (BYTES.to_owned(), broken.to_owned())]);
            assert_eq!(DescribedModule::read(&texts), None, "{broken}");
        }
    }
}
