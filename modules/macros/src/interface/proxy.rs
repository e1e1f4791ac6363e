//! The proxy of an interface: its functions look like local calls.

use super::{Command, Data, DataKind, Number};
use proc_macro2::TokenStream;
use quote::{format_ident, quote};
use syn::{GenericArgument, Ident, ItemTrait, PathArguments, Type};

/// `Result<T, E>` as it is written in a signature.
fn result_of(ty: &Type) -> Option<(&Type, &Type)> {
    let Type::Path(path) = ty else { return None };
    let last = path.path.segments.last().filter(|segment| segment.ident == "Result")?;
    let PathArguments::AngleBracketed(arguments) = &last.arguments else { return None };
    let mut types = arguments.args.iter().filter_map(|argument| match argument {
        GenericArgument::Type(ty) => Some(ty),
        _ => None,
    });
    Some((types.next()?, types.next()?))
}

pub(super) fn proxy(item: &ItemTrait, krate: &TokenStream, commands: &[Command], data: &[Data]) -> TokenStream {
    let (vis, name) = (&item.vis, &item.ident);
    let (interface, proxy) = (format_ident!("{name}Interface"), format_ident!("{name}Proxy"));
    let doc = format!("Calls the functions of [`{name}`] in another module.");
    let calls = commands.iter().map(|command| {
        let Command { number: Number { number, .. }, name, text, names, types, result, .. } = command;
        let begin = format_ident!("begin_{}", super::plain_name(name));
        let begin_text = format!("Begins [`Self::{name}`] and returns at once; wait for its result later.");
        let (returns, wait) = match result_of(result) {
            Some((value, error)) => {
                (quote!(::std::result::Result<#value, #krate::CallError<#error>>), quote!(wait_result()))
            }
            None => (quote!(::std::result::Result<#result, #krate::CallError>), quote!(wait())),
        };
        let widen = result_of(result).map(|_| quote!(.map_err(#krate::CallError::widen)));
        quote! {
            #[doc = #text]
            pub fn #name(&self, #(#names: #types),*) -> #returns {
                self.#begin(#(#names),*) #widen ?.#wait
            }

            #[doc = #begin_text]
            pub fn #begin(
                &self, #(#names: #types),*
            ) -> ::std::result::Result<#krate::Pending<#result>, #krate::CallError> {
                self.core.begin(#number, #interface::hash(), &(#(#names,)*))
            }
        }
    });
    let gets = data.iter().map(|Data { kind, name, ty, .. }| {
        let constant = Ident::new(&super::plain_name(name).to_uppercase(), name.span());
        let newest = (*kind == DataKind::Stream).then(|| quote!(.data()));
        let text = format!("Asks for the newest `{name}`: its system time (ns since 1970) and itself.");
        quote! {
            #[doc = #text]
            pub fn #name(&self) -> ::std::result::Result<(u64, #ty), #krate::CallError> {
                self.core.get(#interface::#constant #newest)
            }
        }
    });
    quote! {
        #[doc = #doc]
        #vis struct #proxy {
            core: #krate::ProxyCore,
        }

        impl #krate::Proxy for #proxy {
            const CLASS: &'static str = <#interface as #krate::Interface>::CLASS;

            fn new(link: &#krate::Caller, module: #krate::Name) -> Self {
                Self { core: #krate::ProxyCore::new(link, module, <#interface as #krate::Interface>::description) }
            }
        }

        impl #proxy {
            /// The same, with another time in which an answer must come.
            #[must_use]
            pub fn with_timeout(mut self, timeout: ::std::time::Duration) -> Self {
                self.core.timeout = timeout;
                self
            }

            #(#calls)*
            #(#gets)*
        }
    }
}
