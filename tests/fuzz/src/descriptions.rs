//! Modules' own descriptions, and data read by them without a type: as tools use both.

use crate::split::Bytes;
use rohrpost_modules::common::ParameterPage;
use rohrpost_modules::parameter::{from_file, from_word, toml_text, value_text};
use rohrpost_modules::schema::{
    Description, LIST_SHOWN, Type, Value, decode, describe_result, describe_type, encode, is_word, numbers,
    parse_argument,
};

/// The first byte selects: a description, a page of parameters, or a type and a value of it.
pub(crate) fn run(data: &[u8]) {
    let Some((what, bytes)) = data.split_first() else { return };
    match what % 3 {
        0 => described(bytes),
        1 => parameters(bytes),
        _ => typed(bytes),
    }
}

fn described(bytes: &[u8]) {
    let description = match Description::from_bytes(bytes) {
        Ok(description) => description,
        Err(error) => return assert!(!error.to_string().is_empty()),
    };
    assert_eq!(Description::from_bytes(&description.to_bytes()).as_ref(), Ok(&description));
    assert_eq!(description.hash(), description.clone().hash());
    for function in &description.functions {
        function.arguments.iter().for_each(|argument| of(&argument.ty, bytes));
        let _ = describe_result(&function.result);
        of(&function.result, bytes);
        assert!(description.function(&function.name).is_some());
    }
    for item in &description.data {
        of(&item.field.ty, bytes);
        assert!(description.data_item(&item.field.name).is_some());
    }
}

fn parameters(bytes: &[u8]) {
    let Ok(page) = postcard::from_bytes::<ParameterPage>(bytes) else { return };
    for parameter in &page.parameters {
        let range = parameter.field.with_unit(&parameter.range());
        assert!(range.len() >= parameter.field.unit.len());
        if let Ok(value) = parameter.value() {
            let _ = (value_text(&value), toml_text(&parameter.field.ty, &value), parameter.checked());
            let _ = from_file(&parameter.field.ty, &value);
        }
        let _ = from_word(&parameter.field.ty, &parameter.field.text);
    }
}

fn typed(bytes: &[u8]) {
    let mut bytes = Bytes(bytes);
    let length = bytes.half().into();
    let Ok(ty) = Type::from_bytes(bytes.take(length)) else { return };
    of(&ty, bytes.0);
}

/// All that is done with a type and bytes that may be one of its values.
fn of(ty: &Type, bytes: &[u8]) {
    assert!(!describe_type(ty).is_empty());
    let _ = is_word(ty);
    let text = String::from_utf8_lossy(bytes);
    if let Ok(value) = parse_argument(ty, &text) {
        let written = encode(ty, &value).unwrap_or_else(|error| panic!("{text:?} was understood: {error}"));
        assert!(decode(ty, &written).is_ok(), "{text:?}");
    }
    let value = match decode(ty, bytes) {
        Ok(value) => value,
        Err(error) => return assert!(!error.to_string().is_empty()),
    };
    shown(&value);
    let written = encode(ty, &value).unwrap_or_else(|error| panic!("{value:?}: {error}"));
    let again = decode(ty, &written).unwrap_or_else(|error| panic!("{value:?}: {error}"));
    // By text, since a NaN is not itself.
    assert_eq!(format!("{again:?}"), format!("{value:?}"));
    as_json(ty, &value);
}

fn shown(value: &Value) {
    let text = value.to_string();
    assert!(!text.contains(|c: char| c.is_control() && c != '\n'), "{text:?}");
    let _ = value.display(2).to_string();
    let _ = numbers(value, LIST_SHOWN);
}

/// A round trip through JSON keeps the meaning.
fn as_json(ty: &Type, value: &Value) {
    let json = serde_json::to_string(value).unwrap_or_else(|error| panic!("{value:?}: {error}"));
    // The reader of JSON has a bound of its own on nesting.
    let Ok(read) = serde_json::from_str::<Value>(&json) else { return };
    if let Ok(written) = encode(ty, &read) {
        assert!(decode(ty, &written).is_ok(), "{json}");
    }
}
