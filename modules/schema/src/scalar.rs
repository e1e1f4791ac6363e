//! Numbers of all widths: their range, their bytes' width, and how they read as text.

use crate::{Type, Value, WalkProblem};

/// A type of whole numbers.
#[derive(Clone, Copy)]
pub(crate) struct Integer {
    pub(crate) name: &'static str,
    pub(crate) signed: bool,
    pub(crate) bits: u32,
}

impl Integer {
    /// The integer type that `ty` is, if it is one.
    pub(crate) fn of(ty: &Type) -> Option<Self> {
        let (name, signed, bits) = match ty {
            Type::I8 => ("i8", true, 8),
            Type::I16 => ("i16", true, 16),
            Type::I32 => ("i32", true, 32),
            Type::I64 => ("i64", true, 64),
            Type::I128 => ("i128", true, 128),
            Type::U8 => ("u8", false, 8),
            Type::U16 => ("u16", false, 16),
            Type::U32 => ("u32", false, 32),
            Type::U64 => ("u64", false, 64),
            Type::U128 => ("u128", false, 128),
            _ => return None,
        };
        Some(Self { name, signed, bits })
    }

    fn unsigned_max(self) -> u128 {
        u128::MAX >> (128 - self.bits)
    }

    fn signed_max(self) -> i128 {
        i128::MAX >> (128 - self.bits)
    }

    /// `value` as `U` or `I` within the range, whatever number it came as.
    pub(crate) fn number(self, value: &Value) -> Result<Value, WalkProblem> {
        let fitting = match (self.signed, value) {
            (false, Value::U(n)) => Some(*n).filter(|n| *n <= self.unsigned_max()).map(Value::U),
            (true, Value::I(n)) => {
                Some(*n).filter(|n| (-self.signed_max() - 1..=self.signed_max()).contains(n)).map(Value::I)
            }
            (false, Value::I(n)) => return self.or_out_of_range(u128::try_from(*n).ok().map(Value::U), value),
            (true, Value::U(n)) => return self.or_out_of_range(i128::try_from(*n).ok().map(Value::I), value),
            // JSON writes 1e3 as a float. Beyond 2^53 a float no longer names one whole number.
            (_, Value::F(x)) if x.fract() == 0.0 && x.abs() <= 9_007_199_254_740_992.0 => {
                return self.number(&Value::I(*x as i128));
            }
            (_, Value::Text(text)) => return self.parse(text),
            _ => return Err(self.expected(&value.display(4).to_string())),
        };
        fitting.ok_or_else(|| self.out_of_range(&value.to_string()))
    }

    fn or_out_of_range(self, converted: Option<Value>, value: &Value) -> Result<Value, WalkProblem> {
        self.number(&converted.ok_or_else(|| self.out_of_range(&value.to_string()))?)
    }

    /// Reads `12`, `-3`, `0x1f` and `1e3`.
    pub(crate) fn parse(self, text: &str) -> Result<Value, WalkProblem> {
        let whole = text.parse().map(Value::I).or_else(|_| text.parse().map(Value::U)).ok().or_else(|| hex(text));
        let number = match whole {
            Some(number) => number,
            None => Value::F(text.parse().map_err(|_| self.expected(text))?),
        };
        self.number(&number)
    }

    fn expected(self, got: &str) -> WalkProblem {
        WalkProblem::Expected { expected: self.expectation(), got: shortened(got) }
    }

    pub(crate) fn expectation(self) -> String {
        format!("a whole number ({})", self.name)
    }

    fn out_of_range(self, got: &str) -> WalkProblem {
        let max = self.signed_max();
        let range =
            if self.signed { format!("{} to {max}", -max - 1) } else { format!("0 to {}", self.unsigned_max()) };
        WalkProblem::OutOfRange { expected: format!("{} is {range}", self.name), got: shortened(got) }
    }
}

/// `0x1f` and `-0x1f`.
fn hex(text: &str) -> Option<Value> {
    let (negative, digits) = text.strip_prefix('-').map_or((false, text), |digits| (true, digits));
    let digits = digits.strip_prefix("0x").or_else(|| digits.strip_prefix("0X"))?;
    if digits.starts_with(['+', '-']) {
        return None;
    }
    let magnitude = u128::from_str_radix(digits, 16).ok()?;
    if negative { i128::try_from(magnitude).ok().map(|n| Value::I(-n)) } else { Some(Value::U(magnitude)) }
}

/// `value` as a number with a fraction. `name` is that of the type, `f32` or `f64`.
pub(crate) fn float(name: &'static str, value: &Value) -> Result<f64, WalkProblem> {
    let number = match value {
        Value::F(x) => *x,
        Value::I(n) => *n as f64,
        Value::U(n) => *n as f64,
        Value::Text(text) => return parse_float(name, text),
        _ => return Err(expected_float(name, &value.display(4).to_string())),
    };
    if name == "f32" && number.is_finite() && (number as f32).is_infinite() {
        return Err(float_out_of_range(name, &value.to_string()));
    }
    Ok(number)
}

/// Reads what integers take, and `-0.5`, `1e-3`, `NaN`, `inf`, `-inf`.
pub(crate) fn parse_float(name: &'static str, text: &str) -> Result<f64, WalkProblem> {
    if let Some(number) = hex(text) {
        return float(name, &number);
    }
    let number: f64 = text.parse().map_err(|_| expected_float(name, text))?;
    if number.is_infinite() && text.contains(|c: char| c.is_ascii_digit()) {
        return Err(float_out_of_range(name, text));
    }
    float(name, &Value::F(number))
}

fn expected_float(name: &str, got: &str) -> WalkProblem {
    WalkProblem::Expected { expected: format!("a number ({name})"), got: shortened(got) }
}

fn float_out_of_range(name: &'static str, got: &str) -> WalkProblem {
    let max = if name == "f32" { f64::from(f32::MAX) } else { f64::MAX };
    WalkProblem::OutOfRange { expected: format!("{name} ends at {max:e}"), got: shortened(got) }
}

/// Powers of ten, all of them exact.
const POWERS: [f64; 15] = [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14];

/// The `f64` of the shortest decimal that is this `f32` and no other: people read and type 1.2, not 1.2000000476837158.
pub(crate) fn shortest(number: f32) -> f64 {
    let exact = f64::from(number);
    // Six digits of a decimal survive in an `f32`, nine tell all `f32`s apart. Numbers of usual size go this way, as
    // the way by text below takes several times as long and scans have many numbers.
    if (1e-6..1e6).contains(&exact.abs()) {
        let from_six_digits = POWERS.iter().skip_while(|power| exact.abs() * **power < 1e5).take(4);
        let mut decimals = from_six_digits.map(|power| (exact * power).round() / power);
        if let Some(decimal) = decimals.find(|decimal| *decimal as f32 == number) {
            return decimal;
        }
    }
    let decimal = format!("{number:e}").parse().unwrap_or(exact);
    // Rounding twice, decimal to f64 to f32, may miss by one; a number that is exact but long is the way out.
    if decimal as f32 == number { decimal } else { exact }
}

/// What came instead, fit for one line of a terminal.
pub(crate) fn shortened(text: &str) -> String {
    const SHOWN: usize = 40;
    let short: String = text.chars().take(SHOWN).flat_map(char::escape_debug).collect();
    if text.chars().nth(SHOWN).is_some() { short + "…" } else { short }
}
