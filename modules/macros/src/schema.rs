//! From a struct or enum to its description.

use crate::said::{Said, renamed, serde_words};
use crate::text::text_of;
use proc_macro2::TokenStream;
use quote::{ToTokens, quote};
use syn::spanned::Spanned;
use syn::{Attribute, Error, Fields, GenericParam, Generics, Ident, Item, LitStr, Path, Result, Type, parse_quote};

/// Of serde's attributes, those that change bytes in a way that no description says.
const UNSAID: [&str; 11] = [
    "skip",
    "skip_serializing",
    "skip_serializing_if",
    "flatten",
    "tag",
    "untagged",
    "with",
    "serialize_with",
    "into",
    "from",
    "try_from",
];

/// `crate = path, name = "rohrpost.Pose"` before the item.
struct SchemaOptions {
    schema: TokenStream,
    name: Option<LitStr>,
}

impl SchemaOptions {
    fn of(attributes: &[Attribute]) -> Result<Self> {
        let mut options = Self { schema: quote!(::rohrpost_schema), name: None };
        for attribute in attributes.iter().filter(|attribute| attribute.path().is_ident("schema")) {
            attribute.parse_nested_meta(|meta| {
                if meta.path.is_ident("crate") {
                    options.schema = meta.value()?.parse::<Path>()?.into_token_stream();
                } else if meta.path.is_ident("name") {
                    let name: LitStr = meta.value()?.parse()?;
                    if name.value().trim().is_empty() {
                        return Err(Error::new(name.span(), "an empty name is none"));
                    }
                    options.name = Some(name);
                } else {
                    return Err(meta.error("unknown key; a type has `name`, its fields `unit`, `min` and `max`"));
                }
                Ok(())
            })?;
        }
        Ok(options)
    }
}

/// What is written for one item.
struct Writer {
    schema: TokenStream,
    /// Types of all fields.
    types: Vec<Type>,
    proofs: Vec<TokenStream>,
}

pub(crate) fn expand(item: TokenStream) -> Result<TokenStream> {
    let (attributes, ident, generics, mut body) = match syn::parse2(item)? {
        Item::Struct(item) => (item.attrs, item.ident, item.generics, Body::Struct(item.fields)),
        Item::Enum(item) => (item.attrs, item.ident, item.generics, Body::Enum(item.variants.into_iter().collect())),
        other => return Err(Error::new(other.span(), "structs and enums have a description")),
    };
    let SchemaOptions { schema, name } = SchemaOptions::of(&attributes)?;
    let name = name.as_ref().map(LitStr::value).map_or_else(|| name_of(&ident, &attributes), Ok)?;
    let text = text_of(&attributes);
    let mut writer = Writer { schema, types: Vec::new(), proofs: Vec::new() };
    let ty = match &mut body {
        Body::Struct(fields) => {
            let named = writer.named(&name, &text, fields)?;
            let schema = &writer.schema;
            quote!(#schema::Type::Struct(#named))
        }
        Body::Enum(variants) => {
            let mut all = Vec::new();
            for variant in variants {
                all.push(writer.named(
                    &name_of(&variant.ident, &variant.attrs)?,
                    &text_of(&variant.attrs),
                    &mut variant.fields,
                )?);
            }
            let schema = &writer.schema;
            quote!(#schema::Type::Enum { name: #name.into(), text: #text.into(), variants: ::std::vec![#(#all),*] })
        }
    };
    let Writer { schema, types, proofs } = writer;
    let generics = bounded(generics, &schema);
    let (impl_generics, type_generics, conditions) = generics.split_for_impl();
    Ok(quote! {
        #(#proofs)*

        impl #impl_generics #schema::Schema for #ident #type_generics #conditions {
            const LEVELS: usize = #schema::deeper(&[#(<#types as #schema::Schema>::LEVELS),*]);

            fn schema() -> #schema::Type {
                #ty
            }
        }
    })
}

enum Body {
    Struct(Fields),
    Enum(Vec<syn::Variant>),
}

/// As serde has it, or else Rust.
fn name_of(ident: &Ident, attributes: &[Attribute]) -> Result<String> {
    let words = serde_words(attributes)?;
    if let Some(word) = words.iter().find(|word| UNSAID.iter().any(|unsaid| word.key == unsaid)) {
        let text = format!("a description cannot say what `{}` does to the bytes; leave it out", word.key);
        return Err(Error::new(word.key.span(), text));
    }
    Ok(renamed(&words).unwrap_or_else(|| ident.to_string().trim_start_matches("r#").to_owned()))
}

impl Writer {
    fn named(&mut self, name: &str, text: &str, fields: &mut Fields) -> Result<TokenStream> {
        let schema = self.schema.clone();
        let members = match fields {
            Fields::Unit => quote!(None),
            Fields::Unnamed(fields) => {
                let all = self.fields(fields.unnamed.iter_mut())?;
                match &all[..] {
                    [one] => quote!(One(::std::boxed::Box::new(#one))),
                    _ => quote!(Tuple(::std::vec![#(#all),*])),
                }
            }
            Fields::Named(fields) => {
                let all = self.fields(fields.named.iter_mut())?;
                quote!(Fields(::std::vec![#(#all),*]))
            }
        };
        let said = (!text.is_empty()).then(|| quote!(.said(#text)));
        Ok(quote!(#schema::Named::new(#name, #schema::Members::#members) #said))
    }

    fn fields<'f>(&mut self, fields: impl Iterator<Item = &'f mut syn::Field>) -> Result<Vec<TokenStream>> {
        let mut all = Vec::new();
        for field in fields {
            let said = Said::take(&mut field.attrs, &field.ty)?;
            let unnamed = Ident::new("unnamed", field.span());
            let name = name_of(field.ident.as_ref().unwrap_or(&unnamed), &field.attrs)?;
            self.proofs.push(said.proof(&name, &field.ty));
            let name = if field.ident.is_some() { name.as_str() } else { "" };
            all.push(said.field(&self.schema, name, &text_of(&field.attrs), &field.ty));
            self.types.push(field.ty.clone());
        }
        Ok(all)
    }
}

/// Each type parameter has a description.
fn bounded(mut generics: Generics, schema: &TokenStream) -> Generics {
    for parameter in &mut generics.params {
        if let GenericParam::Type(parameter) = parameter {
            parameter.bounds.push(parse_quote!(#schema::Schema));
        }
    }
    generics
}

#[cfg(test)]
#[path = "schema_tests.rs"]
mod tests;
