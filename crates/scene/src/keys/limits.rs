//! Ranges of numbers, with descriptions.

use crate::math::limits::{MAX_MAGNITUDE, is_nonzero_but_too_short};

/// A range of accepted numbers. In addition, numbers must be finite and at most [`MAX_MAGNITUDE`] in
/// magnitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limits {
    /// Any number.
    Any,
    /// Any number except 0.
    NotZero,
    /// At least this number.
    AtLeast(f64),
    /// A length or size, which must be positive and large enough that its square does not underflow.
    Length,
    /// A [`Length`](Self::Length) or 0.
    LengthOrZero,
    /// Inclusive bounds.
    Between(f64, f64),
    /// Exclusive bounds.
    Inside(f64, f64),
    /// Greater than the first bound, and at most the second.
    UpTo(f64, f64),
}

impl Limits {
    /// Describes why a number is out of range, such as `must be greater than 0`. Returns `None` if the number
    /// is accepted.
    pub fn violation(self, number: f64) -> Option<String> {
        if number.is_nan() || number.is_infinite() {
            return Some("must be a finite number".to_owned());
        }
        if number.abs() > MAX_MAGNITUDE {
            return Some("must be at most 1e18 in magnitude".to_owned());
        }
        if is_nonzero_but_too_short(number) {
            if matches!(self, Self::LengthOrZero) {
                return Some("must be 0, or at least 1e-18".to_owned());
            }
            if matches!(self, Self::Length | Self::NotZero) {
                return Some("must be more than 1e-18 in magnitude".to_owned());
            }
        }
        (!self.contains(number)).then(|| self.requirement_text())
    }

    fn contains(self, number: f64) -> bool {
        match self {
            Self::Any => true,
            Self::NotZero => number != 0.0,
            Self::AtLeast(least) => number >= least,
            Self::Length => number > 0.0,
            Self::LengthOrZero => number >= 0.0,
            Self::Between(least, most) => (least..=most).contains(&number),
            Self::Inside(low, high) => low < number && number < high,
            Self::UpTo(low, most) => low < number && number <= most,
        }
    }

    /// Returns the range as shown in the documentation.
    pub fn range_text(self) -> String {
        match self {
            Self::Any => "any".to_owned(),
            Self::NotZero => "not 0".to_owned(),
            Self::AtLeast(least) => format!("{least} …"),
            Self::Length => "> 0".to_owned(),
            Self::LengthOrZero => "0 …".to_owned(),
            Self::Between(least, most) => format!("{least} … {most}"),
            Self::Inside(low, high) => format!("> {low}, < {high}"),
            Self::UpTo(low, most) => format!("> {low}, ≤ {most}"),
        }
    }

    fn requirement_text(self) -> String {
        match self {
            Self::Any => "must be a number".to_owned(),
            Self::NotZero => "must not be 0".to_owned(),
            Self::AtLeast(least) => format!("must be at least {least}"),
            Self::Length => "must be greater than 0".to_owned(),
            Self::LengthOrZero => "must be at least 0".to_owned(),
            Self::Between(least, most) => format!("must be between {least} and {most}"),
            Self::Inside(low, high) => format!("must be greater than {low} and less than {high}"),
            Self::UpTo(low, most) => format!("must be greater than {low} and at most {most}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_match_their_descriptions() {
        let ok = |limits: Limits, number| limits.violation(number).is_none();
        assert!(ok(Limits::Any, -0.0) && ok(Limits::AtLeast(0.0), -0.0));
        assert!(!ok(Limits::Length, 0.0) && ok(Limits::Length, 1e-9) && !ok(Limits::Length, 1e-30));
        assert!(!ok(Limits::Inside(0.0, 180.0), 180.0) && ok(Limits::Between(0.0, 1.0), 1.0));
        assert!(ok(Limits::LengthOrZero, 0.0) && !ok(Limits::LengthOrZero, 1e-30));
        assert!(ok(Limits::UpTo(0.0, 360.0), 360.0) && !ok(Limits::UpTo(0.0, 360.0), 0.0));
        assert!(!ok(Limits::NotZero, -0.0) && ok(Limits::NotZero, -2.0));
        for bad in [f64::NAN, f64::INFINITY, 1.1e18, -1e300] {
            assert!(!ok(Limits::Any, bad), "{bad}");
        }
        assert_eq!(
            Limits::Between(-100.0, 100.0).violation(200.0).as_deref(),
            Some("must be between -100 and 100")
        );
    }
}
