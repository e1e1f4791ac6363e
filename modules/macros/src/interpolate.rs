//! From a struct to its values in between.

use proc_macro2::TokenStream;
use quote::{ToTokens, quote, quote_spanned};
use syn::spanned::Spanned;
use syn::{Attribute, Error, Field, GenericParam, Ident, Index, Item, ItemStruct, Path, Result, parse_quote};

/// Where the value of a field comes from.
#[derive(Clone, Copy)]
enum Way {
    Between,
    Heading,
    Earlier,
    Nearer,
}

pub(crate) fn expand(item: TokenStream) -> Result<TokenStream> {
    let ItemStruct { attrs, ident, mut generics, fields, .. } = match syn::parse2(item)? {
        Item::Struct(item) => item,
        other => {
            let text = "only structs have values in between; write `#[interpolate(earlier)]` or \
                        `#[interpolate(nearer)]` before each field of this type";
            return Err(Error::new(other.span(), text));
        }
    };
    let fusion = fusion_crate(&attrs)?;
    let fields = fields.iter().enumerate().map(|(index, field)| value(&fusion, index, field));
    let fields = fields.collect::<Result<Vec<_>>>()?;
    for parameter in &mut generics.params {
        if let GenericParam::Type(parameter) = parameter {
            parameter.bounds.push(parse_quote!(#fusion::Interpolate));
        }
    }
    let (impl_generics, type_generics, conditions) = generics.split_for_impl();
    Ok(quote! {
        impl #impl_generics #fusion::Interpolate for #ident #type_generics #conditions {
            fn interpolate(from: &Self, to: &Self, share: #fusion::Share) -> Self {
                Self { #(#fields),* }
            }
        }
    })
}

/// One field of the result.
fn value(fusion: &TokenStream, index: usize, field: &Field) -> Result<TokenStream> {
    let member = match &field.ident {
        Some(ident) => quote!(#ident),
        None => {
            let index = Index::from(index);
            quote!(#index)
        }
    };
    // A type without such values is marked in the field, not in the derive.
    let (ty, span) = (&field.ty, field.ty.span());
    let both = quote!(&from.#member, &to.#member, share);
    let clone = quote_spanned!(span=> <#ty as ::core::clone::Clone>::clone);
    let (function, arguments) = match way(&field.attrs)? {
        Way::Between => (quote_spanned!(span=> <#ty as #fusion::Interpolate>::interpolate), both),
        Way::Heading => (quote_spanned!(span=> <#ty as #fusion::Heading>::turn), both),
        Way::Earlier => (clone, quote!(&from.#member)),
        Way::Nearer => (clone, quote!(share.nearer(&from.#member, &to.#member))),
    };
    Ok(quote!(#member: #function(#arguments)))
}

/// `heading`, `earlier` or `nearer` before a field.
fn way(attributes: &[Attribute]) -> Result<Way> {
    let mut way = None;
    for attribute in attributes.iter().filter(|attribute| attribute.path().is_ident("interpolate")) {
        let key: Ident = attribute.parse_args().map_err(|error| Error::new(error.span(), KEYS))?;
        let said = match key.to_string().as_str() {
            "heading" => Way::Heading,
            "earlier" => Way::Earlier,
            "nearer" => Way::Nearer,
            _ => return Err(Error::new(key.span(), KEYS)),
        };
        if way.replace(said).is_some() {
            return Err(Error::new(key.span(), "a field has one of `heading`, `earlier` and `nearer`"));
        }
    }
    Ok(way.unwrap_or(Way::Between))
}

const KEYS: &str = "a field has `heading`, `earlier` or `nearer`; without, its type must have values in between";

/// `crate = path` before the item.
fn fusion_crate(attributes: &[Attribute]) -> Result<TokenStream> {
    let mut fusion = quote!(::rohrpost::fusion);
    for attribute in attributes.iter().filter(|attribute| attribute.path().is_ident("interpolate")) {
        attribute.parse_nested_meta(|meta| {
            if !meta.path.is_ident("crate") {
                return Err(meta.error("a struct has `crate = path`; keys of fields stand before fields"));
            }
            fusion = meta.value()?.parse::<Path>()?.into_token_stream();
            Ok(())
        })?;
    }
    Ok(fusion)
}

#[cfg(test)]
#[path = "interpolate_tests.rs"]
mod tests;
