//! Numbers as they are written in a document.

/// A number, as text or as a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Number<'d> {
    /// Digits with a sign, but without underscores or a radix prefix.
    Integer { digits: &'d str, radix: u32 },
    /// Text accepted by `f64::from_str`.
    Float(&'d str),
    /// The value of a number that is not in the source.
    Exact(f64),
}

impl Number<'_> {
    /// Converts the number to a double, clamping text to the range of doubles. Returns `None` for text that is
    /// not a number.
    pub(crate) fn to_f64(self) -> Option<f64> {
        match self {
            // Round to the nearest double, as if the number were written as a float.
            Self::Integer { .. } => Some(self.to_integer().map_or(f64::MAX, |number| number as f64)),
            Self::Float(text) => {
                let number: f64 = text.parse().ok()?;
                let is_digits = number.is_infinite() && !text.contains("inf");
                Some(if is_digits { f64::MAX } else { number })
            }
            Self::Exact(number) => Some(number),
        }
    }

    /// Whether this is an integer. Text with a decimal point or an exponent is not an integer.
    pub(crate) fn is_integer(self) -> bool {
        match self {
            Self::Integer { .. } => true,
            Self::Float(_) => false,
            Self::Exact(number) => number.fract() == 0.0,
        }
    }

    /// Converts an integer, or returns `None` if it overflows or is not an integer.
    pub(crate) fn to_integer(self) -> Option<i128> {
        match self {
            Self::Integer { digits, radix } => i128::from_str_radix(digits, radix).ok(),
            Self::Float(_) => None,
            Self::Exact(number) => Some(number as i128).filter(|_| self.is_integer()),
        }
    }
}
