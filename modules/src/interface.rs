//! What the `interface` attribute makes of a trait: an interface that a module serves and proxies call.

use crate::call::{CallError, Caller, Fault, Pending};
use rohrpost_config::CALL_TIMEOUT;
use rohrpost_mailbox::Name;
use rohrpost_schema::{Data, Description};
use std::marker::PhantomData;
use std::time::Duration;

/// A set of functions and data that modules of a class offer. Implemented by the `interface` attribute.
pub trait Interface {
    /// The class, by its name in the configuration.
    const CLASS: &'static str;

    /// Whether a module serves it only if it has a name of the class.
    const OPTIONAL: bool = false;

    /// Functions and data.
    fn description() -> Description;
}

/// An interface that a module of type `M` serves. Implemented by the `interface` attribute for all that implement the
/// trait.
pub trait Serve<M>: Interface {
    /// Runs a function: arguments and result are postcard; the result is appended to `reply`.
    ///
    /// # Errors
    /// [`Fault::Unknown`] and [`Fault::Arguments`].
    fn serve(module: &mut M, function: u16, arguments: &[u8], reply: &mut Vec<u8>) -> Result<(), Fault>;
}

/// A name under which a module stands in for another one, of which it has the description and no types: a player of
/// recordings, say. See [`crate::Module::stand_ins`].
#[derive(Clone, Debug)]
pub struct StandIn {
    /// The module's own name, or one of its aliases.
    pub name: Name,
    /// What the other one serves there. Callers and subscribers take the one for the other, since the hash is the same.
    pub description: Description,
}

/// A command to a name under which a module stands in for another one.
#[derive(Clone, Copy, Debug)]
pub struct StandInCommand<'a> {
    /// The name.
    pub to: Name,
    /// The function's number; it is one of the description.
    pub number: u16,
    /// Postcard of all arguments.
    pub arguments: &'a [u8],
}

/// One kind of data of an interface.
pub struct DataPort<T> {
    /// The interface's class.
    pub class: &'static str,
    /// Number in the interface.
    pub number: u16,
    /// Its name.
    pub name: &'static str,
    /// The interface's hash, computed when first needed.
    pub hash: fn() -> u32,
    data: PhantomData<fn() -> T>,
}

impl<T> DataPort<T> {
    /// For the `interface` attribute.
    #[doc(hidden)]
    pub const fn new(class: &'static str, number: u16, name: &'static str, hash: fn() -> u32) -> Self {
        Self { class, number, name, hash, data: PhantomData }
    }
}

impl<T> Clone for DataPort<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for DataPort<T> {}

/// One stream of an interface.
///
/// ```
/// use rohrpost_modules::interface;
///
/// /// Measures.
/// #[interface(class = "scale", crate = rohrpost_modules::macro_support)]
/// pub trait Scale {
///     /// What lies on it.
///     #[stream(1)]
///     #[schema(unit = "kg")]
///     fn mass() -> f64;
/// }
///
/// let port = ScaleInterface::MASS;
/// assert_eq!((port.class, port.number, port.name), ("scale", 1, "mass"));
/// assert_eq!(port.data().number, 1); // its newest value, as data
/// ```
pub struct StreamPort<T> {
    /// The interface's class.
    pub class: &'static str,
    /// Number in the interface.
    pub number: u16,
    /// Its name.
    pub name: &'static str,
    /// The interface's hash, computed when first needed.
    pub hash: fn() -> u32,
    data: PhantomData<fn() -> T>,
}

impl<T> StreamPort<T> {
    /// For the `interface` attribute.
    #[doc(hidden)]
    pub const fn new(class: &'static str, number: u16, name: &'static str, hash: fn() -> u32) -> Self {
        Self { class, number, name, hash, data: PhantomData }
    }

    /// Its newest value, as data: to ask for, or to subscribe to from another node.
    pub const fn data(self) -> DataPort<T> {
        DataPort::new(self.class, self.number, self.name, self.hash)
    }
}

impl<T> Clone for StreamPort<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for StreamPort<T> {}

/// A typed client of another module's interface. Implemented by the `interface` attribute.
pub trait Proxy {
    /// The class it speaks to.
    const CLASS: &'static str;

    /// A proxy of this module.
    fn new(link: &Caller, module: Name) -> Self;
}

/// What every proxy is made of.
#[doc(hidden)]
pub struct ProxyCore {
    pub link: Caller,
    pub module: Name,
    pub timeout: Duration,
    description: fn() -> Description,
}

impl ProxyCore {
    pub fn new(link: &Caller, module: Name, description: fn() -> Description) -> Self {
        Self { link: link.clone(), module: module.module(), timeout: CALL_TIMEOUT, description }
    }

    /// Begins a call; the arguments are a tuple.
    pub fn begin<A: serde::Serialize, T: serde::de::DeserializeOwned>(
        &self,
        function: u16,
        hash: u32,
        arguments: &A,
    ) -> Result<Pending<T>, CallError> {
        let interface = (hash, self.description);
        let sequence = self.link.begin(self.module, function, interface, self.timeout, arguments)?;
        Ok(Pending::new(self.link.clone(), sequence, self.module))
    }

    /// Asks for the newest data of a kind: its system time (ns since 1970) and itself.
    pub fn get<T: Data>(&self, port: DataPort<T>) -> Result<(u64, T), CallError> {
        let hash = (port.hash)();
        self.begin::<_, (u64, T)>(crate::common::GET_DATA, hash, &(port.number,))?.wait()
    }
}

/// An interface that a module serves if the configuration gives it a name of the class, and else goes without.
impl<I: Interface> Interface for Option<I> {
    const CLASS: &'static str = I::CLASS;
    const OPTIONAL: bool = true;

    fn description() -> Description {
        I::description()
    }
}

impl<M, I: Serve<M>> Serve<M> for Option<I> {
    fn serve(module: &mut M, function: u16, arguments: &[u8], reply: &mut Vec<u8>) -> Result<(), Fault> {
        I::serve(module, function, arguments, reply)
    }
}

/// The interfaces of a module: one, or a tuple of them, one an alias. Each must have a name of its class, but for those
/// in an `Option`.
pub trait Interfaces<M> {
    /// A line for each.
    fn table() -> Vec<Served<M>>;
}

/// One interface of a module.
pub struct Served<M> {
    /// Class of the alias that has it.
    pub class: &'static str,
    /// Whether there may be no such alias.
    pub is_optional: bool,
    /// Functions and data.
    pub description: Description,
    /// Runs a function.
    pub serve: ServeFunction<M>,
}

/// See [`Serve::serve`].
pub type ServeFunction<M> = fn(&mut M, u16, &[u8], &mut Vec<u8>) -> Result<(), Fault>;

impl<M, I: Serve<M>> Interfaces<M> for I {
    fn table() -> Vec<Served<M>> {
        vec![Served { class: I::CLASS, is_optional: I::OPTIONAL, description: I::description(), serve: I::serve }]
    }
}

macro_rules! interfaces_of_tuples {
    ($(($($interface:ident),*))*) => {$(
        impl<M, $($interface: Serve<M>),*> Interfaces<M> for ($($interface,)*) {
            fn table() -> Vec<Served<M>> {
                vec![$(Served {
                    class: $interface::CLASS,
                    is_optional: $interface::OPTIONAL,
                    description: $interface::description(),
                    serve: $interface::serve,
                }),*]
            }
        }
    )*};
}
interfaces_of_tuples! { () (A) (A, B) (A, B, C) (A, B, C, D) (A, B, C, D, E) }
