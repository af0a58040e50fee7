//! Enums with named values, used by scene files, the command line and reports.

/// A fixed set of named values. Use [`choice!`](crate::choice!) to implement it.
pub trait Choice: Copy + PartialEq + Send + Sync + 'static {
    /// All values, in display order.
    const ALL: &'static [Self];

    /// Names that exist only in other versions. They are rejected with a dedicated error message.
    const UNAVAILABLE: &'static [&'static str];

    /// The value's name.
    fn name(self) -> &'static str;

    /// A short description of this value.
    fn meaning(self) -> &'static str;

    /// Finds the value called `name`.
    fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|one| one.name() == name)
    }
}

/// Serializes a choice as its name.
///
/// # Errors
/// Returns the serializer's errors.
pub fn serialize<C: Choice, S: serde::Serializer>(choice: &C, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(choice.name())
}

/// Defines an enum with named values and implements `Choice`. Each variant's doc comment is also its
/// description in the help text.
///
/// ```
/// glimt_base::choice! {
///     /// Directions.
///     pub enum Turn {
///         /// Counterclockwise.
///         Left = "left",
///         /// Clockwise.
///         Right = "right",
///     }
///     unavailable "back"
/// }
/// use glimt_base::choice::Choice;
/// assert_eq!(Turn::named("right"), Some(Turn::Right));
/// assert_eq!(Turn::Left.meaning(), "Counterclockwise");
/// ```
#[macro_export]
macro_rules! choice {
    (
        $(#[doc = $doc:literal])+
        $visibility:vis enum $name:ident {
            $($(#[doc = $meaning:literal])+ $value:ident = $word:literal,)+
        }
        $(unavailable $($unavailable:literal),+)?
    ) => {
        $(#[doc = $doc])+
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        $visibility enum $name {
            $($(#[doc = $meaning])+ $value,)+
        }

        impl $crate::choice::Choice for $name {
            const ALL: &'static [Self] = &[$(Self::$value),+];
            const UNAVAILABLE: &'static [&'static str] = &[$($($unavailable),+)?];

            fn name(self) -> &'static str {
                match self {
                    $(Self::$value => $word,)+
                }
            }

            fn meaning(self) -> &'static str {
                let lines = match self {
                    $(Self::$value => concat!($($meaning),+),)+
                };
                lines.trim().trim_end_matches('.')
            }
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    choice! {
        /// Numbers.
        enum Number {
            /// The first number, described on two lines.
            One = "one",
            /// Two.
            Two = "2",
        }
        unavailable "three"
    }

    #[test]
    fn values_are_found_by_exact_name() {
        for &number in Number::ALL {
            assert_eq!(Number::named(number.name()), Some(number));
        }
        assert_eq!(Number::ALL, [Number::One, Number::Two]);
        assert_eq!((Number::named("One"), Number::named("three")), (None, None));
        assert_eq!(Number::UNAVAILABLE, ["three"]);
        assert_eq!(Number::One.meaning(), "The first number, described on two lines");
    }
}
