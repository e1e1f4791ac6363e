//! The `interface` and `data` attributes. Use them through the crate `rohrpost`.

#![forbid(unsafe_code)]

mod interface;

use proc_macro::TokenStream;
use quote::quote;

/// Makes a trait an interface: its functions can be called from other modules, its data asked for and subscribed to.
///
/// `#[interface(class = "motor")]` on `trait Motor` leaves the trait to be implemented, and makes `MotorInterface` (what a
/// module names as its interface; its constants are the data) and `MotorProxy` (its functions look like local calls).
///
/// * `#[command(16)]` before a function gives its number, 16 or more; `#[command(17, idempotent)]` says that running it twice
///   does no harm. Functions take `&mut self` and owned arguments, at most eight.
/// * `#[data(1)] fn scan() -> LaserScan;` declares data. The trait's implementor does not see it; the module publishes it.
///
/// Doc comments become the texts that tools show.
#[proc_macro_attribute]
pub fn interface(attributes: TokenStream, item: TokenStream) -> TokenStream {
    interface::expand(attributes.into(), item.into()).unwrap_or_else(syn::Error::into_compile_error).into()
}

/// Makes a struct or enum fit to travel in packages: derives `Serialize`, `Deserialize` and `Schema`.
#[proc_macro_attribute]
pub fn data(_attributes: TokenStream, item: TokenStream) -> TokenStream {
    let item = proc_macro2::TokenStream::from(item);
    quote! {
        #[derive(
            ::rohrpost::macro_support::serde::Serialize,
            ::rohrpost::macro_support::serde::Deserialize,
            ::rohrpost::macro_support::postcard_schema::Schema,
        )]
        #[serde(crate = "::rohrpost::macro_support::serde")]
        #[postcard(crate = ::rohrpost::macro_support::postcard_schema)]
        #item
    }
    .into()
}
