//! Causes that describe themselves: each is written once, with its word and its text.

/// Declares an enumeration of causes with `ALL`, `word` (for people and programs) and `text` (the doc comment).
///
/// ```
/// rohrpost_mailbox::causes! {
///     /// Why a parcel came back.
///     pub enum Return {
///         /// Nobody opened.
///         Away = "away",
///         /// The address
///         /// does not exist.
///         NoAddress = "no-address",
///     }
/// }
/// assert_eq!(Return::ALL.map(Return::word), ["away", "no-address"]);
/// assert_eq!(Return::NoAddress.text(), "The address does not exist.");
/// ```
#[macro_export]
macro_rules! causes {
    ($(#[doc = $about:literal])+ pub enum $name:ident {
        $($(#[doc = $text:literal])+ $cause:ident = $word:literal,)+
    }) => {
        $(#[doc = $about])+
        #[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
        #[repr(usize)]
        pub enum $name {
            $($(#[doc = $text])+ $cause,)+
        }

        impl $name {
            /// All, in the order of their counters.
            pub const ALL: [Self; [$($word),+].len()] = [$(Self::$cause),+];

            /// One word for people and programs.
            pub const fn word(self) -> &'static str {
                match self {
                    $(Self::$cause => $word,)+
                }
            }

            /// What it means.
            pub const fn text(self) -> &'static str {
                match self {
                    $(Self::$cause => ::core::concat!($($text),+).trim_ascii(),)+
                }
            }
        }
    };
}
