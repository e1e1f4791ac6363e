//! From a settings struct to settings of which some may change at run time.

use crate::said::{Said, is_one_of, serde_words};
use crate::text::text_of;
use proc_macro2::TokenStream;
use quote::{ToTokens, format_ident, quote};
use syn::parse::Parser;
use syn::punctuated::Punctuated;
use syn::spanned::Spanned;
use syn::{
    Attribute, Error, Expr, Field, Fields, Ident, ItemEnum, ItemStruct, Meta, Path, Result, Token, Type, parse_quote,
};

/// What the attribute writes itself, of serde's attributes of a struct.
const WRITTEN: [&str; 3] = ["crate", "deny_unknown_fields", "rename_all"];

/// `crate = crate::macro_support`, for our own crates alone.
fn support_crate(attributes: TokenStream) -> Result<TokenStream> {
    let mut krate = quote!(::rohrpost::macro_support);
    let read = syn::meta::parser(|meta| {
        if !meta.path.is_ident("crate") {
            return Err(meta.error("nothing stands here; `unit`, `min` and `max` belong to #[parameter(…)] of a field"));
        }
        krate = meta.value()?.parse::<Path>()?.into_token_stream();
        Ok(())
    });
    read.parse2(attributes)?;
    Ok(krate)
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

    /// Takes `#[parameter(…)]` off a field; none if it is a setting like others.
    fn take(owner: &Ident, field: &mut Field) -> Result<Option<Self>> {
        let Some(at) = field.attrs.iter().position(|attribute| attribute.path().is_ident("parameter")) else {
            return Ok(None);
        };
        let attribute = field.attrs.remove(at);
        let said = match &attribute.meta {
            Meta::Path(_) => Said::default(),
            _ => Said::of(&attribute)?,
        };
        let name = field.ident.clone().ok_or_else(|| Error::new(field.span(), "a parameter's field has a name"))?;
        let text = text_of(&field.attrs);
        if text.is_empty() {
            return Err(Error::new(name.span(), "what is it for? write a doc comment before it; tools show it"));
        }
        let own_words = serde_words(&field.attrs)?;
        if let Some(word) = own_words.iter().find(|word| word.key != "default" || said.default.is_some()) {
            let text = match word.key.to_string().as_str() {
                "default" => "its default is given twice; drop the one of serde",
                "rename" => "a parameter is called as its field; rename the field",
                _ => "serde attributes of a parameter are written by #[parameter(…)], but for `default`",
            };
            return Err(Error::new(word.key.span(), text));
        }
        let kebab = name.to_string().trim_start_matches("r#").trim_matches('_').replace('_', "-");
        let parameter = Self { field: name, ty: field.ty.clone(), name: kebab, text, said };
        parameter.said.check(&parameter.ty)?;
        let read = format!("{owner}::{}", parameter.function("read"));
        field.attrs.push(parse_quote!(#[serde(deserialize_with = #read)]));
        if parameter.said.default.is_some() {
            let default = format!("{owner}::{}", parameter.function("default"));
            field.attrs.push(parse_quote!(#[serde(default = #default)]));
        }
        Ok(Some(parameter))
    }

    /// Its declaration, its default, and how it is read from the configuration.
    fn functions(&self, krate: &TokenStream) -> TokenStream {
        let Self { ty, name, text, said, .. } = self;
        let (declared, read) = (self.function("declared"), self.function("read"));
        let unit = said.unit();
        let bound = |value: &Option<Expr>| match value {
            Some(value) => quote!(::std::option::Option::Some(#value)),
            None => quote!(::std::option::Option::None),
        };
        let (least, most) = (bound(&said.min), bound(&said.max));
        let default = said.default.as_ref().map(|value| {
            let function = self.function("default");
            let value =
                if is_one_of(ty, &["String"]) { quote!(::std::convert::From::from(#value)) } else { quote!(#value) };
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
    match serde_words(attributes)?.iter().find(|word| WRITTEN.iter().any(|written| word.key == written)) {
        Some(word) => {
            Err(Error::new(word.key.span(), format!("the attribute writes `{}` itself; drop this one", word.key)))
        }
        None => Ok(()),
    }
}

pub(crate) fn expand(attributes: TokenStream, item: TokenStream) -> Result<TokenStream> {
    let krate = support_crate(attributes)?;
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
    let proofs = parameters.iter().map(|parameter| parameter.said.proof(&parameter.name, &parameter.ty));
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
            fn names(&self) -> ::std::vec::Vec<&str> {
                ::std::vec![#(#names),*]
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
    let krate = support_crate(attributes)?;
    let item: ItemEnum = syn::parse2(item)
        .map_err(|error| Error::new(error.span(), "a choice is an enum with variants that carry nothing"))?;
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
        #[derive(#krate::serde::Serialize, #krate::serde::Deserialize, #krate::schema::Schema)]
        #[serde(crate = #serde)]
        #[schema(crate = #krate::schema)]
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
