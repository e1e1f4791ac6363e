//! The `interface`, `data`, `parameters` and `choice` attributes. Use them through the crate `rohrpost`.

#![forbid(unsafe_code)]

mod interface;
mod parameters;
mod text;

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

/// Makes a struct a module's settings, of which some may change while it runs: its parameters.
///
/// ```text
/// #[rohrpost::parameters]
/// struct Settings {
///     motor: String,
///     /// Speed when nothing is in the way.
///     #[parameter(unit = "m/s", min = 0.0, max = 1.5, default = 0.5)]
///     cruise_m_s: f64,
/// }
/// ```
///
/// * It derives `Deserialize`; names are in kebab-case, as in the configuration (`cruise-m-s`), and unknown keys are refused.
/// * A field with `#[parameter]` may change. All its keys are optional. Its doc comment is the text that tools show. Its
///   type is `bool`, an integer of at most 64 bits, `f32`, `f64`, `String`, or an enum with `#[rohrpost::choice]`.
/// * `min`, `max` and `default` are checked by the compiler against the type and each other; values in the configuration
///   when they are read. Numbers with a fraction are always finite.
/// * The other fields are settings as ever, with serde's attributes.
#[proc_macro_attribute]
pub fn parameters(attributes: TokenStream, item: TokenStream) -> TokenStream {
    parameters::expand(attributes.into(), item.into()).unwrap_or_else(syn::Error::into_compile_error).into()
}

/// Makes an enum, whose variants carry nothing, a type that a parameter can have. In files and on command lines its variants
/// are words in kebab-case: `TurnLeft` is `turn-left`.
#[proc_macro_attribute]
pub fn choice(attributes: TokenStream, item: TokenStream) -> TokenStream {
    parameters::expand_choice(attributes.into(), item.into()).unwrap_or_else(syn::Error::into_compile_error).into()
}
