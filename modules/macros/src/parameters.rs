//! From a settings struct to settings of which some may change at run time.

use crate::text::text_of;
use proc_macro2::TokenStream;
use quote::{ToTokens, format_ident, quote};
use syn::parse::{Parse, ParseStream};
use syn::punctuated::Punctuated;
use syn::spanned::Spanned;
use syn::{
    Attribute, Error, Expr, Field, Fields, Ident, ItemEnum, ItemStruct, LitStr, Meta, Path, Result, Token, Type,
    parse_quote,
};

/// Types that have a least and a most.
const WHOLE: [&str; 8] = ["u8", "u16", "u32", "u64", "i8", "i16", "i32", "i64"];
const FRACTIONAL: [&str; 2] = ["f32", "f64"];
/// What the attribute writes itself, of serde's attributes of a struct.
const WRITTEN: [&str; 3] = ["crate", "deny_unknown_fields", "rename_all"];

/// `crate = crate::macro_support`, for our own crates alone.
struct Options {
    krate: TokenStream,
}

impl Parse for Options {
    fn parse(input: ParseStream<'_>) -> Result<Self> {
        if input.is_empty() {
            return Ok(Self { krate: quote!(::rohrpost::macro_support) });
        }
        if !input.peek(Token![crate]) {
            return Err(
                input.error("nothing stands here; `unit`, `min` and `max` belong to #[parameter(…)] of a field")
            );
        }
        input.parse::<Token![crate]>()?;
        input.parse::<Token![=]>()?;
        let path: Path = input.parse()?;
        Ok(Self { krate: quote!(#path) })
    }
}

/// `unit = "m/s", min = 0.0, max = 1.5, default = 0.5`.
#[derive(Default)]
struct Said {
    unit: Option<LitStr>,
    min: Option<Expr>,
    max: Option<Expr>,
    default: Option<Expr>,
}

impl Parse for Said {
    fn parse(input: ParseStream<'_>) -> Result<Self> {
        let mut said = Self::default();
        while !input.is_empty() {
            let key: Ident = input.parse()?;
            input.parse::<Token![=]>()?;
            let place = match key.to_string().as_str() {
                "unit" => {
                    let unit: LitStr = input.parse()?;
                    if unit.value().trim().is_empty() {
                        return Err(Error::new(unit.span(), "an empty unit is none; leave `unit` out"));
                    }
                    said.unit.replace(unit).map(drop)
                }
                "min" => said.min.replace(input.parse()?).map(drop),
                "max" => said.max.replace(input.parse()?).map(drop),
                "default" => said.default.replace(input.parse()?).map(drop),
                _ => return Err(Error::new(key.span(), "unknown key; there are `unit`, `min`, `max` and `default`")),
            };
            if place.is_some() {
                return Err(Error::new(key.span(), format!("`{key}` is given twice")));
            }
            if !input.is_empty() {
                input.parse::<Token![,]>()?;
            }
        }
        Ok(said)
    }
}

struct Parameter {
    field: Ident,
    ty: Type,
    /// As in the configuration.
    name: String,
    text: String,
    said: Said,
}

impl Parameter {
    fn function(&self, what: &str) -> Ident {
        format_ident!("__{what}_{}", self.field)
    }

    fn kind(&self) -> Option<String> {
        let Type::Path(path) = &self.ty else { return None };
        path.path.get_ident().map(Ident::to_string)
    }

    fn is(&self, kinds: &[&str]) -> bool {
        self.kind().is_some_and(|kind| kinds.contains(&kind.as_str()))
    }

    /// Takes `#[parameter(…)]` off a field; none if it is a setting like others.
    fn take(owner: &Ident, field: &mut Field) -> Result<Option<Self>> {
        let Some(at) = field.attrs.iter().position(|attribute| attribute.path().is_ident("parameter")) else {
            return Ok(None);
        };
        let attribute = field.attrs.remove(at);
        let said: Said = match &attribute.meta {
            Meta::Path(_) => Said::default(),
            _ => attribute.parse_args()?,
        };
        let name = field.ident.clone().ok_or_else(|| Error::new(field.span(), "a parameter's field has a name"))?;
        let text = text_of(&field.attrs);
        if text.is_empty() {
            return Err(Error::new(name.span(), "what is it for? write a doc comment before it; tools show it"));
        }
        let own_words = serde_words(&field.attrs)?;
        if let Some(word) = own_words.iter().find(|word| *word != "default" || said.default.is_some()) {
            let text = match word.to_string().as_str() {
                "default" => "its default is given twice; drop the one of serde",
                "rename" => "a parameter is called as its field; rename the field",
                _ => "serde attributes of a parameter are written by #[parameter(…)], but for `default`",
            };
            return Err(Error::new(word.span(), text));
        }
        let kebab = name.to_string().trim_start_matches("r#").trim_matches('_').replace('_', "-");
        let parameter = Self { field: name, ty: field.ty.clone(), name: kebab, text, said };
        parameter.check()?;
        let read = format!("{owner}::{}", parameter.function("read"));
        field.attrs.push(parse_quote!(#[serde(deserialize_with = #read)]));
        if parameter.said.default.is_some() {
            let default = format!("{owner}::{}", parameter.function("default"));
            field.attrs.push(parse_quote!(#[serde(default = #default)]));
        }
        Ok(Some(parameter))
    }

    fn check(&self) -> Result<()> {
        let bound = self.said.min.as_ref().or(self.said.max.as_ref());
        match bound {
            Some(bound) if !self.is(&WHOLE) && !self.is(&FRACTIONAL) => {
                let types = [&WHOLE[..], &FRACTIONAL[..]].concat().join(", ");
                Err(Error::new(bound.span(), format!("only numbers have a range: {types}")))
            }
            _ => Ok(()),
        }
    }

    /// What the compiler checks of the bounds and the default: that they are of the field's type, and in order.
    fn proof(&self) -> TokenStream {
        let Self { ty, name, said: Said { min, max, default, .. }, .. } = self;
        if !self.is(&WHOLE) && !self.is(&FRACTIONAL) {
            return TokenStream::new();
        }
        let mut proofs = Vec::new();
        let mut prove = |condition: TokenStream, wrong: String| proofs.push(quote!(assert!(#condition, #wrong);));
        for (word, value) in [("min", min), ("max", max), ("default", default)] {
            if let (Some(value), true) = (value, self.is(&FRACTIONAL)) {
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
                prove(condition, format!("parameter `{name}`: {wrong}"));
            }
        }
        quote!(const _: () = { #(#proofs)* };)
    }

    /// Its declaration, its default, and how it is read from the configuration.
    fn functions(&self, krate: &TokenStream) -> TokenStream {
        let Self { ty, name, text, said, .. } = self;
        let (declared, read) = (self.function("declared"), self.function("read"));
        let unit = said.unit.as_ref().map_or(String::new(), LitStr::value);
        let bound = |value: &Option<Expr>| match value {
            Some(value) => quote!(::std::option::Option::Some(#value)),
            None => quote!(::std::option::Option::None),
        };
        let (least, most) = (bound(&said.min), bound(&said.max));
        let default = said.default.as_ref().map(|value| {
            let function = self.function("default");
            let value = if self.is(&["String"]) { quote!(::std::convert::From::from(#value)) } else { quote!(#value) };
            quote!(fn #function() -> #ty { #value })
        });
        quote! {
            fn #declared() -> #krate::Declared<#ty> {
                #krate::Declared { name: #name, text: #text, unit: #unit, least: #least, most: #most }
            }

            fn #read<'de, D: #krate::serde::Deserializer<'de>>(
                deserializer: D,
            ) -> ::std::result::Result<#ty, D::Error> {
                Self::#declared().read(deserializer)
            }

            #default
        }
    }
}

/// The keys of a struct's or field's serde attributes.
fn serde_words(attributes: &[Attribute]) -> Result<Vec<Ident>> {
    let mut words = Vec::new();
    for attribute in attributes.iter().filter(|attribute| attribute.path().is_ident("serde")) {
        let metas = attribute
            .parse_args_with(|input: ParseStream<'_>| Punctuated::<Word, Token![,]>::parse_terminated(input))?;
        words.extend(metas.into_iter().map(|word| word.0));
    }
    Ok(words)
}

/// One key of a serde attribute, its value left aside; `crate` is a key too, though no identifier.
struct Word(Ident);

impl Parse for Word {
    fn parse(input: ParseStream<'_>) -> Result<Self> {
        use syn::ext::IdentExt;
        let word = Ident::parse_any(input)?;
        if input.parse::<Option<Token![=]>>()?.is_some() {
            input.parse::<Expr>()?;
        } else if input.peek(syn::token::Paren) {
            input.parse::<proc_macro2::TokenTree>()?;
        }
        Ok(Self(word))
    }
}

/// Neither serde's derive nor words of it that are written here.
fn nothing_twice(attributes: &[Attribute], ours: &[&str]) -> Result<()> {
    for attribute in attributes.iter().filter(|attribute| attribute.path().is_ident("derive")) {
        let paths = attribute.parse_args_with(Punctuated::<Path, Token![,]>::parse_terminated)?;
        for path in &paths {
            let last = path.segments.last().map(|segment| segment.ident.to_string()).unwrap_or_default();
            if ours.contains(&last.as_str()) {
                return Err(Error::new(path.span(), format!("the attribute derives `{last}` itself; drop this one")));
            }
        }
    }
    match serde_words(attributes)?.iter().find(|word| WRITTEN.iter().any(|written| *word == written)) {
        Some(word) => Err(Error::new(word.span(), format!("the attribute writes `{word}` itself; drop this one"))),
        None => Ok(()),
    }
}

pub(crate) fn expand(attributes: TokenStream, item: TokenStream) -> Result<TokenStream> {
    let Options { krate } = syn::parse2(attributes)?;
    let mut item: ItemStruct = syn::parse2(item)
        .map_err(|error| Error::new(error.span(), "parameters are fields of a struct: the module's settings"))?;
    if !item.generics.params.is_empty() {
        return Err(Error::new(item.generics.span(), "settings have no generics; write the types"));
    }
    nothing_twice(&item.attrs, &["Deserialize"])?;
    let Fields::Named(fields) = &mut item.fields else {
        return Err(Error::new(item.ident.span(), "settings are a struct with named fields"));
    };
    let mut parameters = Vec::new();
    for field in &mut fields.named {
        parameters.extend(Parameter::take(&item.ident, field)?);
    }
    if parameters.is_empty() {
        let text = "no field is a parameter; write #[parameter(unit = \"m/s\", min = 0.0, max = 1.5)] before one";
        return Err(Error::new(item.ident.span(), text));
    }
    let serde = format!("{}::serde", krate.to_token_stream().to_string().replace(' ', ""));
    let set = parameter_set(&item.ident, &krate, &parameters);
    Ok(quote! {
        #[derive(#krate::serde::Deserialize)]
        #[serde(crate = #serde, deny_unknown_fields, rename_all = "kebab-case")]
        #item
        #set
    })
}

fn parameter_set(owner: &Ident, krate: &TokenStream, parameters: &[Parameter]) -> TokenStream {
    let proofs = parameters.iter().map(Parameter::proof);
    let functions = parameters.iter().map(|parameter| parameter.functions(krate));
    let names = parameters.iter().map(|parameter| &parameter.name);
    let indices: Vec<usize> = (0..parameters.len()).collect();
    let fields: Vec<&Ident> = parameters.iter().map(|parameter| &parameter.field).collect();
    let declared: Vec<Ident> = parameters.iter().map(|parameter| parameter.function("declared")).collect();
    quote! {
        #(#proofs)*

        impl #owner {
            #(#functions)*
        }

        impl #krate::ParameterSet for #owner {
            fn names(&self) -> &'static [&'static str] {
                &[#(#names),*]
            }

            fn get(&self, index: usize) -> ::std::option::Option<#krate::Parameter> {
                match index {
                    #(#indices => ::std::option::Option::Some(Self::#declared().describe(&self.#fields)),)*
                    _ => ::std::option::Option::None,
                }
            }

            fn accept(
                &self, index: usize, value: &[u8],
            ) -> ::std::result::Result<::std::vec::Vec<u8>, #krate::Refusal> {
                match index {
                    #(#indices => Self::#declared().check_bytes(value),)*
                    _ => ::std::result::Result::Err(#krate::Refusal::NoParameters),
                }
            }

            fn put(&mut self, index: usize, value: &[u8]) {
                match index {
                    #(#indices => #krate::put_parameter(&mut self.#fields, value),)*
                    _ => {}
                }
            }
        }
    }
}

pub(crate) fn expand_choice(attributes: TokenStream, item: TokenStream) -> Result<TokenStream> {
    let Options { krate } = syn::parse2(attributes)?;
    let item: ItemEnum = syn::parse2(item)
        .map_err(|error| Error::new(error.span(), "a choice is an enum whose variants carry nothing"))?;
    if !item.generics.params.is_empty() {
        return Err(Error::new(item.generics.span(), "a choice has no generics"));
    }
    nothing_twice(&item.attrs, &["Deserialize", "Serialize", "Schema"])?;
    if item.variants.is_empty() {
        return Err(Error::new(item.ident.span(), "a choice has at least one variant"));
    }
    if let Some(variant) = item.variants.iter().find(|variant| !matches!(variant.fields, Fields::Unit)) {
        return Err(Error::new(variant.span(), "variants of a choice carry nothing"));
    }
    let name = &item.ident;
    let serde = format!("{}::serde", krate.to_token_stream().to_string().replace(' ', ""));
    Ok(quote! {
        #[derive(#krate::serde::Serialize, #krate::serde::Deserialize, #krate::postcard_schema::Schema)]
        #[serde(crate = #serde)]
        #[postcard(crate = #krate::postcard_schema)]
        #item

        impl #krate::ParameterType for #name {
            fn within(
                self, _: ::std::option::Option<&Self>, _: ::std::option::Option<&Self>,
            ) -> ::std::option::Option<Self> {
                ::std::option::Option::Some(self)
            }
        }
    })
}

#[cfg(test)]
#[path = "parameters_tests.rs"]
mod tests;
