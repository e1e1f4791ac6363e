//! From a trait to an interface, a dispatcher, a description and a proxy.

mod proxy;

use crate::said::Said;
use crate::text::text_of;
use proc_macro2::{Span, TokenStream};
use quote::{ToTokens, format_ident, quote};
use syn::ext::IdentExt;
use syn::parse::{Parse, ParseStream, Parser};
use syn::spanned::Spanned;
use syn::{
    Error, FnArg, Ident, ItemTrait, LitInt, LitStr, Pat, Path, Result, ReturnType, Signature, Token, TraitItem,
    TraitItemFn, Type,
};

const ARGUMENTS_MAX: usize = 8;

/// `class = "motor"`, and for our own crates `crate = crate`.
struct InterfaceOptions {
    class: LitStr,
    krate: TokenStream,
}

impl InterfaceOptions {
    fn of(attributes: TokenStream) -> Result<Self> {
        let (mut class, mut krate) = (None, quote!(::rohrpost::macro_support));
        let read = syn::meta::parser(|meta| {
            if meta.path.is_ident("crate") {
                krate = meta.value()?.parse::<Path>()?.into_token_stream();
            } else if meta.path.is_ident("class") {
                class = Some(meta.value()?.parse()?);
            } else {
                return Err(meta.error("unknown key; write `class = \"motor\"`"));
            }
            Ok(())
        });
        read.parse2(attributes)?;
        let text = "which class? write `#[interface(class = \"motor\")]`";
        let class = class.ok_or_else(|| Error::new(Span::call_site(), text))?;
        Ok(Self { class, krate })
    }
}

/// `16` or `16, idempotent`.
struct Number {
    number: LitInt,
    idempotent: bool,
}

impl Parse for Number {
    fn parse(input: ParseStream<'_>) -> Result<Self> {
        let number = input.parse()?;
        let mut idempotent = false;
        if input.parse::<Option<Token![,]>>()?.is_some() && !input.is_empty() {
            let word: Ident = input.parse()?;
            if word != "idempotent" {
                return Err(Error::new(word.span(), "unknown word; `idempotent` is the only one"));
            }
            idempotent = true;
        }
        Ok(Self { number, idempotent })
    }
}

struct Command {
    number: Number,
    name: Ident,
    text: String,
    names: Vec<Ident>,
    types: Vec<Type>,
    /// Of each argument.
    said: Vec<Said>,
    result: Type,
}

struct Data {
    kind: DataKind,
    number: LitInt,
    name: Ident,
    text: String,
    ty: Type,
    said: Said,
}

/// Which attribute declares it.
#[derive(Clone, Copy, PartialEq)]
enum DataKind {
    Data,
    Stream,
}

impl DataKind {
    /// The variant of the schema's `DataKind`.
    fn variant(self, schema: &TokenStream) -> TokenStream {
        match self {
            Self::Data => quote!(#schema::DataKind::Data),
            Self::Stream => quote!(#schema::DataKind::Stream),
        }
    }
}

pub(crate) fn expand(attributes: TokenStream, item: TokenStream) -> Result<TokenStream> {
    let InterfaceOptions { class, krate } = InterfaceOptions::of(attributes)?;
    let mut item: ItemTrait = syn::parse2(item)?;
    let (mut commands, mut data) = (Vec::new(), Vec::new());
    let mut kept = Vec::new();
    for member in std::mem::take(&mut item.items) {
        let TraitItem::Fn(mut function) = member else {
            let text = "an interface has functions only: #[command(n)], #[data(n)] and #[stream(n)]";
            return Err(Error::new(member.span(), text));
        };
        if let Some(number) = take_attribute(&mut function, "command") {
            commands.push(command(number?, &mut function)?);
            kept.push(TraitItem::Fn(function));
        } else if let Some(number) = take_attribute(&mut function, "data") {
            data.push(data_item(DataKind::Data, number?, &mut function)?);
        } else if let Some(number) = take_attribute(&mut function, "stream") {
            data.push(data_item(DataKind::Stream, number?, &mut function)?);
        } else {
            return Err(Error::new(function.span(), "write #[command(16)], #[data(1)] or #[stream(1)] before it"));
        }
    }
    item.items = kept;
    // A description has them by number, however they are written here.
    commands.sort_by_key(|command| command.number.number.base10_parse::<u16>().unwrap_or_default());
    data.sort_by_key(|item| item.number.base10_parse::<u16>().unwrap_or_default());
    distinct(commands.iter().map(|command| &command.number.number))?;
    distinct(data.iter().map(|item| &item.number))?;
    distinct_names(commands.iter().map(|command| &command.name).chain(data.iter().map(|item| &item.name)))?;
    let interface = interface(&item, &class, &krate, &commands, &data)?;
    let proxy = proxy::proxy(&item, &krate, &commands, &data);
    Ok(quote! { #item #interface #proxy })
}

/// Takes `#[command(…)]`, `#[data(…)]` or `#[stream(…)]` off a function.
fn take_attribute(function: &mut TraitItemFn, name: &str) -> Option<Result<Number>> {
    let at = function.attrs.iter().position(|attribute| attribute.path().is_ident(name))?;
    Some(function.attrs.remove(at).parse_args())
}

fn command(number: Number, function: &mut TraitItemFn) -> Result<Command> {
    let value: u16 = number.number.base10_parse()?;
    if !(16..=16383).contains(&value) {
        return Err(Error::new(number.number.span(), "own functions have numbers from 16 to 16383"));
    }
    if let Some(body) = &function.default {
        return Err(Error::new(body.span(), "functions of an interface have no body here; the module gives it"));
    }
    plain(&function.sig)?;
    let span = function.sig.span();
    let mut arguments = function.sig.inputs.iter_mut();
    match arguments.next() {
        Some(FnArg::Receiver(receiver)) if receiver.mutability.is_some() && receiver.reference.is_some() => {}
        _ => return Err(Error::new(span, "functions take `&mut self` first")),
    }
    let (mut names, mut types, mut said) = (Vec::new(), Vec::new(), Vec::new());
    for argument in arguments {
        let FnArg::Typed(argument) = argument else { continue };
        let Pat::Ident(name) = &*argument.pat else {
            return Err(Error::new(argument.pat.span(), "write a plain name"));
        };
        owned(&argument.ty, "arguments travel to another process; take an owned value")?;
        names.push(name.ident.clone());
        types.push((*argument.ty).clone());
        said.push(Said::take(&mut argument.attrs, &argument.ty)?);
    }
    if names.len() > ARGUMENTS_MAX {
        return Err(Error::new(span, "at most eight arguments; put them into a struct"));
    }
    let result = match &function.sig.output {
        ReturnType::Default => syn::parse_quote!(()),
        ReturnType::Type(_, ty) => (**ty).clone(),
    };
    owned(&result, "results travel to another process; return an owned value")?;
    let text = text_of(&function.attrs);
    Ok(Command { number, name: function.sig.ident.clone(), text, names, types, said, result })
}

/// As it is told to others: without the `r#` of a name that is a keyword here.
fn plain_name(name: &Ident) -> String {
    name.unraw().to_string()
}

/// Nothing that another process could not see or wait for.
fn plain(signature: &Signature) -> Result<()> {
    let generics = &signature.generics;
    if !generics.params.is_empty() || generics.where_clause.is_some() {
        return Err(Error::new(signature.ident.span(), "functions of an interface have no generics; write the types"));
    }
    match &signature.asyncness {
        Some(word) => Err(Error::new(word.span(), "functions are not async; callers wait, or begin and wait later")),
        None => Ok(()),
    }
}

fn owned(ty: &Type, text: &str) -> Result<()> {
    match ty {
        Type::Reference(reference) => Err(Error::new(reference.span(), text)),
        _ => Ok(()),
    }
}

fn data_item(kind: DataKind, number: Number, function: &mut TraitItemFn) -> Result<Data> {
    let value: u16 = number.number.base10_parse()?;
    if number.idempotent {
        return Err(Error::new(number.number.span(), "data and streams are not run; `idempotent` is for commands"));
    }
    if value == 0 || value > 16384 {
        return Err(Error::new(number.number.span(), "data and streams have numbers from 1 to 16384"));
    }
    let (true, ReturnType::Type(_, ty)) = (function.sig.inputs.is_empty(), &function.sig.output) else {
        return Err(Error::new(function.sig.span(), "data and streams are declared as `fn name() -> Type;`"));
    };
    owned(ty, "data travel to other processes; name an owned type")?;
    let text = text_of(&function.attrs);
    let said = Said::take(&mut function.attrs, ty)?;
    Ok(Data { kind, number: number.number, name: function.sig.ident.clone(), text, ty: (**ty).clone(), said })
}

fn distinct<'a>(numbers: impl Iterator<Item = &'a LitInt>) -> Result<()> {
    let mut seen = Vec::new();
    for number in numbers {
        let value: u16 = number.base10_parse()?;
        if seen.contains(&value) {
            return Err(Error::new(number.span(), "this number is taken"));
        }
        seen.push(value);
    }
    Ok(())
}

/// A proxy has functions of all these names, and some of its own.
fn distinct_names<'a>(names: impl Iterator<Item = &'a Ident>) -> Result<()> {
    let mut seen = Vec::new();
    for name in names {
        let text = plain_name(name);
        if ["new", "with_timeout"].contains(&text.as_str()) {
            return Err(Error::new(name.span(), format!("`{text}` is a function of every proxy; choose another name")));
        }
        if seen.contains(&text) {
            return Err(Error::new(name.span(), "this name is taken: functions, data and streams share one proxy"));
        }
        seen.push(text);
    }
    Ok(())
}

fn interface(
    item: &ItemTrait,
    class: &LitStr,
    krate: &TokenStream,
    commands: &[Command],
    data: &[Data],
) -> Result<TokenStream> {
    let (vis, name) = (&item.vis, &item.ident);
    let interface = format_ident!("{name}Interface");
    let (trait_name, trait_text) = (name.unraw().to_string(), text_of(&item.attrs));
    let doc = format!(
        "The interface [`{name}`]: what a module names as its own. Its constants are the data and streams it publishes."
    );
    let schema = &quote!(#krate::schema);
    let functions = commands.iter().map(|command| {
        let Command { number: Number { number, idempotent }, name, text, names, types, said, result } = command;
        let (name, names) = (plain_name(name), names.iter().map(plain_name));
        let arguments = names.zip(types).zip(said).map(|((name, ty), said)| said.field(schema, &name, "", ty));
        quote! {
            #schema::Function {
                number: #number, name: #name.into(), text: #text.into(), idempotent: #idempotent,
                arguments: vec![#(#arguments),*],
                result: <#result as #schema::Schema>::schema(),
            }
        }
    });
    let items = data.iter().map(|Data { kind, number, name, text, ty, said }| {
        let (kind, field) = (kind.variant(schema), said.field(schema, &plain_name(name), text, ty));
        quote!(#schema::DataItem { number: #number, kind: #kind, field: #field })
    });
    let of_arguments = commands.iter().flat_map(|command| command.names.iter().zip(&command.types).zip(&command.said));
    let proofs = of_arguments.map(|((name, ty), said)| said.proof(&name.to_string(), ty));
    let proofs = proofs.chain(data.iter().map(|item| item.said.proof(&item.name.to_string(), &item.ty)));
    let ports = data.iter().map(|Data { kind, number, name, text, ty, .. }| {
        let name_text = plain_name(name);
        let constant = Ident::new(&name_text.to_uppercase(), name.span());
        let port = match kind {
            DataKind::Data => quote!(#krate::DataPort),
            DataKind::Stream => quote!(#krate::StreamPort),
        };
        quote! {
            #[doc = #text]
            pub const #constant: #port<#ty> = #port::new(#class, #number, #name_text, Self::hash);
        }
    });
    let arms = commands.iter().map(|command| {
        let Command { number: Number { number, .. }, name, types, .. } = command;
        // Not their own names: an argument may be called `reply`.
        let values: Vec<Ident> = (0..types.len()).map(|n| format_ident!("__value{n}")).collect();
        quote! {
            #number => {
                let (#(#values,)*): (#(#types,)*) = #krate::read_arguments(arguments)?;
                #krate::write_result(reply, &module.#name(#(#values),*))
            }
        }
    });
    Ok(quote! {
        #(#proofs)*

        #[doc = #doc]
        #vis struct #interface;

        impl #interface {
            #(#ports)*

            /// Tells this interface from others.
            pub fn hash() -> u32 {
                static HASH: ::std::sync::OnceLock<u32> = ::std::sync::OnceLock::new();
                *HASH.get_or_init(|| <Self as #krate::Interface>::description().hash())
            }
        }

        impl #krate::Interface for #interface {
            const CLASS: &'static str = #class;

            fn description() -> #schema::Description {
                #schema::Description {
                    name: #trait_name.into(), class: #class.into(), text: #trait_text.into(),
                    functions: vec![#(#functions),*],
                    data: vec![#(#items),*],
                }
            }
        }

        impl<M: #name> #krate::Serve<M> for #interface {
            #[allow(unused_variables)]
            fn serve(
                module: &mut M, function: u16, arguments: &[u8], reply: &mut ::std::vec::Vec<u8>,
            ) -> ::std::result::Result<(), #krate::Fault> {
                match function {
                    #(#arms)*
                    other => ::std::result::Result::Err(#krate::Fault::Unknown(other)),
                }
            }
        }
    })
}

#[cfg(test)]
#[path = "interface_tests.rs"]
mod tests;
