//! The `interface`, `data`, `parameters` and `choice` attributes, and the derives `Schema` and `Interpolate`. Use them
//! through the crate `rohrpost`.

#![forbid(unsafe_code)]

mod interface;
mod interpolate;
mod parameters;
mod said;
mod schema;
mod text;

use proc_macro::TokenStream;
use quote::quote;

/// Makes a trait an interface: its functions can be called from other modules, its data asked for and subscribed to.
///
/// `#[interface(class = "motor")]` on `trait Motor` leaves the trait to be implemented, and makes `MotorInterface`
/// (what a module names as its interface; its constants are the data and streams) and `MotorProxy` (its functions look
/// like local calls).
///
/// * `#[command(16)]` before a function gives its number, 16 or more; `#[command(17, idempotent)]` says that running it
///   twice does no harm. Functions take `&mut self` and owned arguments, at most eight.
/// * `#[data(1)] fn scan() -> LaserScan;` declares data. The trait's implementor does not see it; the module publishes
///   it.
/// * `#[stream(2)] fn image() -> Image;` declares a stream: data of which many values are kept with their times, to be
///   read in place, asked by time, and larger than a package. Data and streams share one set of numbers and names.
///
/// Doc comments become the texts that tools show. `#[schema(unit = "m/s", min = 0.0, max = 1.5)]` before an argument,
/// or under `#[data(1)]` or `#[stream(2)]`, says what values mean; all its keys are optional.
///
/// ```text
/// #[rohrpost::interface(class = "compass")]
/// pub trait Compass {
///     /// Takes the present heading for this one.
///     #[command(16)]
///     fn calibrate(&mut self, #[schema(unit = "rad")] heading_rad: f64);
///
///     /// The heading, counter-clockwise from east.
///     #[data(1)]
///     #[schema(unit = "rad")]
///     fn heading() -> f64;
/// }
/// ```
#[proc_macro_attribute]
pub fn interface(attributes: TokenStream, item: TokenStream) -> TokenStream {
    interface::expand(attributes.into(), item.into()).unwrap_or_else(syn::Error::into_compile_error).into()
}

/// Makes a struct or enum fit to travel in packages: derives `Serialize`, `Deserialize` and [`macro@Schema`].
///
/// ```text
/// #[rohrpost::data]
/// struct Heading {
///     /// Counter-clockwise from east.
///     #[schema(unit = "rad")]
///     angle_rad: f64,
/// }
/// ```
#[proc_macro_attribute]
pub fn data(_attributes: TokenStream, item: TokenStream) -> TokenStream {
    let item = proc_macro2::TokenStream::from(item);
    quote! {
        #[derive(
            ::rohrpost::macro_support::serde::Serialize,
            ::rohrpost::macro_support::serde::Deserialize,
            ::rohrpost::macro_support::schema::Schema,
        )]
        #[serde(crate = "::rohrpost::macro_support::serde")]
        #[schema(crate = ::rohrpost::macro_support::schema)]
        #item
    }
    .into()
}

/// Describes a struct or enum, so that tools and other languages can read it.
///
/// * Doc comments become texts. `#[schema(unit = "m/s", min = 0.0, max = 1.5)]` before a field says what its values
///   mean; all its keys are optional. The compiler checks bounds against the type and each other; values are not
///   checked.
/// * `#[schema(name = "rohrpost.Pose")]` before the item gives it a name that stays when the code is moved or renamed;
///   without it the name is Rust's, or that of serde's `rename`. Names and units count in an interface's hash, texts
///   and bounds do not.
#[proc_macro_derive(Schema, attributes(schema))]
pub fn schema(item: TokenStream) -> TokenStream {
    schema::expand(item.into()).unwrap_or_else(syn::Error::into_compile_error).into()
}

/// Gives a struct values in between two others, field by field, so that a stream of it can be asked for any time.
///
/// * A field's type has values in between itself: numbers with a fraction go in a straight line, so do vectors and
///   points; rotations turn the short way; a struct may have this derive.
/// * `#[interpolate(heading)]`: an `f64` or `f32` in radians, which goes the short way round.
/// * `#[interpolate(earlier)]`, `#[interpolate(nearer)]`: a field of any type that is `Clone`, taken from the earlier
///   record, or from the one that is nearer in time. Whole numbers, enums and texts need one of these.
///
/// ```text
/// #[rohrpost::data]
/// #[derive(rohrpost::fusion::Interpolate)]
/// struct Crane {
///     height_m: f64,
///     #[interpolate(heading)]
///     arm_rad: f64,
///     #[interpolate(earlier)]
///     holds: bool,
/// }
/// ```
#[proc_macro_derive(Interpolate, attributes(interpolate))]
pub fn interpolate(item: TokenStream) -> TokenStream {
    interpolate::expand(item.into()).unwrap_or_else(syn::Error::into_compile_error).into()
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
/// * It derives `Deserialize`; names are in kebab-case, as in the configuration (`cruise-m-s`), and unknown keys are
///   refused.
/// * A field with `#[parameter]` may change. All its keys are optional. Its doc comment is the text that tools show.
///   Its type is `bool`, an integer of at most 64 bits, `f32`, `f64`, `String`, or an enum with `#[rohrpost::choice]`.
/// * `min`, `max` and `default` are checked by the compiler against the type and each other; values in the
///   configuration when they are read. Numbers with a fraction are always finite.
/// * The other fields are settings as ever, with serde's attributes.
#[proc_macro_attribute]
pub fn parameters(attributes: TokenStream, item: TokenStream) -> TokenStream {
    parameters::expand(attributes.into(), item.into()).unwrap_or_else(syn::Error::into_compile_error).into()
}

/// Makes an enum with variants that carry nothing a type that a parameter can have. In files and on command lines its
/// variants are words in kebab-case: `TurnLeft` is `turn-left`.
///
/// ```text
/// #[rohrpost::choice]
/// enum Side {
///     Left,
///     TurnRight, // `turn-right` in files
/// }
/// ```
#[proc_macro_attribute]
pub fn choice(attributes: TokenStream, item: TokenStream) -> TokenStream {
    parameters::expand_choice(attributes.into(), item.into()).unwrap_or_else(syn::Error::into_compile_error).into()
}
