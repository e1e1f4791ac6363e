//! Views: what is drawn of a module, chosen by how the module describes itself.

use crate::blueprint::Tab;
use crate::error::DrawError;
use crate::scene::{RATE_HZ, Scene};
use rohrpost::schema::{self, Data, DataItem, Description, Schema, Value, decode};
use rohrpost::{Name, Rate};
use rohrpost_config::Installation;
use std::time::Duration;

/// Draws the data of modules that describe themselves in a certain way: those of a class, or those with a certain type.
///
/// The bridge asks all views, a user's own before those that are built in; the first that wants a datum draws it.
pub trait View {
    /// Whether it draws this datum of a module that describes itself so.
    fn wants(&self, module: &Description, item: &DataItem) -> bool;

    /// Which of the values it wants: the newest, or each.
    fn wish(&self) -> Wish {
        Wish::newest()
    }

    /// Draws one value. The scene's time is the value's.
    ///
    /// # Errors
    /// When the value cannot be true; it is told once in a while, and nothing else happens.
    fn draw(&mut self, scene: &mut Scene, datum: &Datum<'_>) -> Result<(), DrawError>;

    /// Tabs for what it draws, asked for when it has got something to draw.
    fn tabs(&self) -> Vec<Tab> {
        Vec::new()
    }

    /// A tab for one datum that it draws, besides [`View::tabs`]. Of tabs with one name the first is there.
    fn tab_of(&self, _module: &str, _item: &DataItem) -> Option<Tab> {
        None
    }

    /// The number of a function without arguments by which a module sends everything once more: it is called when a
    /// part was lost on the way, if the view wants each.
    fn repair(&self, _module: &Description) -> Option<u16> {
        None
    }
}

/// Whether a datum has the type `T`.
pub(crate) fn is<T: Schema>(item: &DataItem) -> bool {
    item.field.ty.is::<T>()
}

/// Which values of a datum a view wants. A `rate` in the configuration says how often instead of this.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wish {
    pub(crate) rate: Rate,
    pub(crate) each: bool,
}

impl Wish {
    /// The newest, [`RATE_HZ`] times a second: for all that tells how things are now, such as a pose, a scan, a number.
    /// A bridge that stood still for a while goes on with what is true then. A stream of its own node with records that
    /// may be larger than its data mailbox takes, or a replica there, is read where it lies, at most 40 times a second.
    pub fn newest() -> Self {
        Self { rate: Rate::Every(Duration::from_secs_f64(1.0 / RATE_HZ)), each: false }
    }

    /// Each, in order: for what is a part of something larger, such as the patches of a map, and for what happens, such
    /// as lines of text. They wait in the bridge's data mailbox; what finds no room there is lost.
    pub fn each() -> Self {
        Self { rate: Rate::Each, each: true }
    }

    /// The same, so often.
    #[must_use]
    pub fn at(self, rate: Rate) -> Self {
        Self { rate, ..self }
    }
}

/// One value and its sender.
pub struct Datum<'a> {
    /// The module, or alias, that sent it.
    pub from: Name,
    /// Its name as text, such as `laser.0`: the last part of entities.
    pub module: &'a str,
    /// Which of its data.
    pub item: &'a DataItem,
    /// The configuration: other modules' names, and settings.
    pub installation: &'a Installation,
    pub(crate) bytes: &'a [u8],
}

impl Datum<'_> {
    /// The value, as the type that [`View::wants`] has seen in the description.
    ///
    /// # Errors
    /// When the sender does not keep to its description.
    pub fn read<T: Data>(&self) -> Result<T, DrawError> {
        rohrpost::wire::from_bytes(self.bytes).map_err(|error| self.unreadable(&error))
    }

    /// The same with its bytes where they lie, which copies none of them.
    ///
    /// # Errors
    /// When the sender does not keep to its description.
    pub fn view<T: schema::View>(&self) -> Result<T::View<'_>, DrawError> {
        rohrpost::wire::from_bytes(self.bytes).map_err(|error| self.unreadable(&error))
    }

    /// The value, by its description alone.
    ///
    /// # Errors
    /// When the sender does not keep to its description, or sends more than is decoded.
    pub fn value(&self) -> Result<Value, DrawError> {
        decode(&self.item.field.ty, self.bytes).map_err(|error| {
            if error.problem.is_limit() {
                let (module, data) = (self.module.into(), self.item.field.name.clone());
                return DrawError::TooMuch { module, data, cause: error.to_string() };
            }
            self.unreadable(&error)
        })
    }

    fn unreadable(&self, cause: &dyn std::fmt::Display) -> DrawError {
        DrawError::Unreadable {
            module: self.module.into(),
            data: self.item.field.name.clone(),
            cause: cause.to_string(),
        }
    }
}

/// A user's own views: one, or a tuple of them; `()` for none.
pub trait Views {
    /// Makes them.
    fn make() -> Vec<Box<dyn View>>;
}

impl<V: View + Default + 'static> Views for V {
    fn make() -> Vec<Box<dyn View>> {
        vec![Box::new(V::default())]
    }
}

macro_rules! views_of_tuples {
    ($(($($view:ident),*))*) => {$(
        impl<$($view: View + Default + 'static),*> Views for ($($view,)*) {
            fn make() -> Vec<Box<dyn View>> {
                vec![$(Box::new($view::default())),*]
            }
        }
    )*};
}
views_of_tuples! { () (A) (A, B) (A, B, C) (A, B, C, D) }
