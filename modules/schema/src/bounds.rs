//! The bounds of a field, which stand in its description as bytes.

use crate::{Field, Value, decode, is_word};

impl Field {
    /// Least and greatest value, as far as there are such that can be read. Only words have bounds: what is written of
    /// a list or a struct may be as long as its author likes.
    ///
    /// ```
    /// use rohrpost_schema::{Field, Type, Value};
    ///
    /// let percent = Field::new("level", Type::U8).bounded(None, Some(vec![100]));
    /// assert_eq!(percent.bounds(), (None, Some(Value::U(100))));
    /// assert_eq!(Field { ty: Type::list(Type::Unit), ..percent }.bounds(), (None, None));
    /// ```
    pub fn bounds(&self) -> (Option<Value>, Option<Value>) {
        let has_bounds = is_word(&self.ty);
        let bound = |bytes: &Option<Vec<u8>>| decode(&self.ty, bytes.as_ref().filter(|_| has_bounds)?).ok();
        (bound(&self.least), bound(&self.most))
    }

    /// What values it may have, in words, without the unit: `0..=1.5`, `at least 1`; none when nothing bounds it.
    pub fn range(&self) -> Option<String> {
        match self.bounds() {
            (Some(least), Some(most)) => Some(format!("{least}..={most}")),
            (Some(least), None) => Some(format!("at least {least}")),
            (None, Some(most)) => Some(format!("at most {most}")),
            (None, None) => None,
        }
    }
}
