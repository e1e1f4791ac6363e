//! What an author says of a value besides its type: unit, range, default. Of fields, arguments, data and parameters
//! alike.

use proc_macro2::{TokenStream, TokenTree};
use quote::quote;
use syn::spanned::Spanned;
use syn::token::Paren;
use syn::{Attribute, Error, Expr, ExprLit, Ident, Lit, LitStr, Result, Token, Type};

/// Types that have a least and a most.
const WHOLE: [&str; 12] = ["u8", "u16", "u32", "u64", "u128", "usize", "i8", "i16", "i32", "i64", "i128", "isize"];
const FRACTIONAL: [&str; 2] = ["f32", "f64"];

/// `unit = "m/s", min = 0.0, max = 1.5, default = 0.5`.
#[derive(Default)]
pub(crate) struct Said {
    pub(crate) unit: Option<LitStr>,
    pub(crate) min: Option<Expr>,
    pub(crate) max: Option<Expr>,
    pub(crate) default: Option<Expr>,
}

impl Said {
    /// What an attribute with arguments says.
    pub(crate) fn of(attribute: &Attribute) -> Result<Self> {
        let mut said = Self::default();
        attribute.parse_nested_meta(|meta| {
            let key = meta.path.require_ident()?;
            let place = match key.to_string().as_str() {
                "unit" => {
                    let unit: LitStr = meta.value()?.parse()?;
                    if unit.value().trim().is_empty() {
                        return Err(Error::new(unit.span(), "an empty unit is none; leave `unit` out"));
                    }
                    said.unit.replace(unit).map(drop)
                }
                "min" => said.min.replace(meta.value()?.parse()?).map(drop),
                "max" => said.max.replace(meta.value()?.parse()?).map(drop),
                "default" => said.default.replace(meta.value()?.parse()?).map(drop),
                _ => return Err(meta.error("unknown key; there are `unit`, `min`, `max` and `default`")),
            };
            place.map_or(Ok(()), |()| Err(meta.error(format!("`{key}` is given twice"))))
        })?;
        Ok(said)
    }

    /// Takes `#[schema(…)]` off what travels.
    pub(crate) fn take(attributes: &mut Vec<Attribute>, ty: &Type) -> Result<Self> {
        let Some(at) = attributes.iter().position(|attribute| attribute.path().is_ident("schema")) else {
            return Ok(Self::default());
        };
        let said = Self::of(&attributes.remove(at))?;
        if let Some(default) = &said.default {
            return Err(Error::new(default.span(), "only parameters have a default"));
        }
        said.check(ty)?;
        Ok(said)
    }

    pub(crate) fn check(&self, ty: &Type) -> Result<()> {
        match self.min.as_ref().or(self.max.as_ref()) {
            Some(bound) if !is_one_of(ty, &WHOLE) && !is_one_of(ty, &FRACTIONAL) => {
                let types = [&WHOLE[..], &FRACTIONAL[..]].concat().join(", ");
                Err(Error::new(bound.span(), format!("only numbers have a range: {types}")))
            }
            _ => Ok(()),
        }
    }

    /// What the compiler checks of the bounds and the default: that they are of the field's type, and in order.
    pub(crate) fn proof(&self, name: &str, ty: &Type) -> TokenStream {
        let Self { min, max, default, .. } = self;
        let is_fractional = is_one_of(ty, &FRACTIONAL);
        if !is_fractional && !is_one_of(ty, &WHOLE) {
            return TokenStream::new();
        }
        let mut proofs = Vec::new();
        let mut prove = |condition: TokenStream, wrong: String| proofs.push(quote!(assert!(#condition, #wrong);));
        for (word, value) in [("min", min), ("max", max), ("default", default)] {
            if let (Some(value), true) = (value, is_fractional) {
                prove(
                    quote!({ const VALUE: #ty = #value; VALUE.is_finite() }),
                    format!("`{word}` of `{name}` is no number"),
                );
            }
        }
        for (low, high, wrong) in [
            (min, max, "`min` is above `max`"),
            (min, default, "`default` is below `min`"),
            (default, max, "`default` is above `max`"),
        ] {
            if let (Some(low), Some(high)) = (low, high) {
                let condition = quote!({ const LOW: #ty = #low; const HIGH: #ty = #high; LOW <= HIGH });
                prove(condition, format!("`{name}`: {wrong}"));
            }
        }
        if proofs.is_empty() { TokenStream::new() } else { quote!(const _: () = { #(#proofs)* };) }
    }

    /// The unit; empty: none.
    pub(crate) fn unit(&self) -> String {
        self.unit.as_ref().map_or(String::new(), LitStr::value)
    }

    /// The description of a field of this type.
    pub(crate) fn field(&self, schema: &TokenStream, name: &str, text: &str, ty: &Type) -> TokenStream {
        let unit = self.unit();
        let said = (!text.is_empty() || !unit.is_empty()).then(|| quote!(.said(#text, #unit)));
        let bound = |bound: &Option<Expr>| match bound {
            Some(bound) => quote!(#schema::bound::<#ty>(&#bound)),
            None => quote!(::std::option::Option::None),
        };
        let bounded = (self.min.is_some() || self.max.is_some()).then(|| {
            let (least, most) = (bound(&self.min), bound(&self.max));
            quote!(.bounded(#least, #most))
        });
        quote!(#schema::Field::new(#name, <#ty as #schema::Schema>::schema()) #said #bounded)
    }
}

/// Whether a type is written as one of these words.
pub(crate) fn is_one_of(ty: &Type, words: &[&str]) -> bool {
    let Type::Path(path) = ty else { return false };
    path.path.get_ident().is_some_and(|ident| words.iter().any(|word| ident == word))
}

/// One key of a serde attribute, and its value; `crate` is a key too, though no identifier.
pub(crate) struct Word {
    pub(crate) key: Ident,
    value: Option<Expr>,
}

/// What a struct's, variant's or field's serde attributes say.
pub(crate) fn serde_words(attributes: &[Attribute]) -> Result<Vec<Word>> {
    let mut words = Vec::new();
    for attribute in attributes.iter().filter(|attribute| attribute.path().is_ident("serde")) {
        attribute.parse_nested_meta(|meta| {
            let key = meta.path.require_ident()?.clone();
            let value = if meta.input.peek(Token![=]) { Some(meta.value()?.parse()?) } else { None };
            if meta.input.peek(Paren) {
                meta.input.parse::<TokenTree>()?;
            }
            words.push(Word { key, value });
            Ok(())
        })?;
    }
    Ok(words)
}

/// The name that serde gives it.
pub(crate) fn renamed(words: &[Word]) -> Option<String> {
    words.iter().find(|word| word.key == "rename").and_then(|word| match &word.value {
        Some(Expr::Lit(ExprLit { lit: Lit::Str(name), .. })) => Some(name.value()),
        _ => None,
    })
}
