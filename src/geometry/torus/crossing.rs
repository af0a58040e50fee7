//! Where a line first crosses a torus.
//!
//! Not by the coefficients of the quartic, whose roots lose half of their digits where it grazes and more where the
//! tube is slim. With q(s) the line's distance from the axis and the circle's radius as unit,
//!
//! ```text
//! g(s) = (q − 1)² + z² − tube² = |p|² + 1 − tube² − 2q
//! ```
//!
//! has the sign of the distance from the surface and is computed from that distance. Its second derivative is
//! 2(1 − w/q³), where w is a constant of the line: there are at most two points of inflection, known in closed form,
//! and on each piece between them g is convex or concave. On such a piece Newton's method from the right end goes to
//! the nearest root without ever passing it, and tells where there is none.

use crate::math::DVec3;

/// More than halving takes from the whole line to its last digit.
const MOST_STEPS: u32 = 200;

/// A line near a torus about z whose circle has radius 1.
pub(super) struct UnitLine {
    /// The line's point nearest to the centre.
    pub(super) foot: DVec3,
    /// Unit direction.
    pub(super) direction: DVec3,
    /// Radius of the tube.
    pub(super) tube: f64,
}

/// g and its derivative at a place of the line.
#[derive(Clone, Copy)]
struct Sample {
    s: f64,
    value: f64,
    slope: f64,
}

impl UnitLine {
    /// The stretch of the line in the ball and between the planes around the torus, both with some room in units of the
    /// tube.
    pub(super) fn surroundings(&self, room: f64) -> Option<(f64, f64)> {
        let height = self.tube * (1.0 + room);
        let ball = 1.0 + height;
        let half = ((ball - self.foot.length()) * (ball + self.foot.length())).sqrt();
        let (z, dz) = (self.foot.z, self.direction.z);
        let (mut enter, mut leave) = (-half, half);
        if dz != 0.0 {
            let (low, high) = ((-height - z) / dz, (height - z) / dz);
            enter = enter.max(low.min(high));
            leave = leave.min(low.max(high));
        } else if !(z.abs() <= height) {
            return None;
        }
        (half > 0.0 && enter < leave).then_some((enter, leave))
    }

    /// The first place from `from` to `to` at which the line goes in or out.
    pub(super) fn first_crossing(&self, from: f64, to: f64) -> Option<f64> {
        if !(from < to) {
            return None;
        }
        let within = |s: f64| s.max(from).min(to);
        let inflections = self.inflections().map_or([to; 2], |cuts| cuts.map(within));
        let mut low = self.at(from);
        let is_inside = low.value < 0.0 || low.value == 0.0 && low.slope < 0.0;
        for (end, is_convex) in [(inflections[0], true), (inflections[1], false), (to, true)] {
            if end > low.s {
                let high = self.at(end);
                let crossing = self.crossing_of_piece(low, high, is_inside, is_convex);
                if crossing.is_some() {
                    return crossing;
                }
                low = high;
            }
        }
        None
    }

    fn at(&self, s: f64) -> Sample {
        let p = self.foot + self.direction * s;
        let ring = p.truncate().length();
        let (across, z) = (ring - 1.0, p.z);
        let distance = (across * across + z * z).sqrt();
        let outwards = if ring > 0.0 { p.truncate().dot(self.direction.truncate()) / ring } else { 0.0 };
        Sample {
            s,
            value: (distance - self.tube) * (distance + self.tube),
            slope: 2.0 * (across * outwards + z * self.direction.z),
        }
    }

    /// The ends of the piece on which g is concave, where q³ < w; on the axis they are one place, of a kink.
    fn inflections(&self) -> Option<[f64; 2]> {
        let (p, d) = (self.foot.truncate(), self.direction.truncate());
        let a = d.length_squared();
        let w = p.perp_dot(d).powi(2);
        let ring = w.cbrt();
        let half = ((ring * ring - w / a) / a).sqrt();
        let middle = -p.dot(d) / a;
        (half >= 0.0).then_some([middle - half, middle + half])
    }

    /// The first crossing on a piece that starts on a known side.
    fn crossing_of_piece(&self, low: Sample, high: Sample, is_inside: bool, is_convex: bool) -> Option<f64> {
        if (high.value <= 0.0) != is_inside {
            let start = if is_inside == is_convex { high } else { low };
            return Some(self.between(low.s, high.s, start, is_inside));
        }
        // Both ends are on one side: a convex piece may dip in between, a concave one may rise out.
        (is_inside != is_convex).then(|| self.dip(low, high, if is_inside { -1.0 } else { 1.0 })).flatten()
    }

    /// The only crossing between two places, by Newton's method where it stays between them.
    fn between(&self, mut low: f64, mut high: f64, start: Sample, is_inside: bool) -> f64 {
        let mut x = start;
        for _ in 0..MOST_STEPS {
            let newton = x.s - x.value / x.slope;
            if newton == x.s {
                break;
            }
            let next = if low < newton && newton < high { newton } else { 0.5 * (low + high) };
            if !(low < next && next < high) {
                break;
            }
            x = self.at(next);
            if (x.value <= 0.0) == is_inside { low = next } else { high = next }
        }
        x.s
    }

    /// The first root from `low` on of a piece on which sign·g is convex and, at both ends, positive. The root of a
    /// tangent is never beyond that of a convex function: where the tangents lead to the rise beyond the least
    /// value there is none.
    fn dip(&self, low: Sample, high: Sample, sign: f64) -> Option<f64> {
        if !(high.slope * sign > 0.0) {
            return None;
        }
        let mut x = low;
        for _ in 0..MOST_STEPS {
            if !(x.slope * sign < 0.0) {
                return None;
            }
            let next = x.s - x.value / x.slope;
            if x.value * sign <= 0.0 || !(next > x.s) {
                break;
            }
            if !(next < high.s) {
                return None;
            }
            x = self.at(next);
        }
        Some(x.s)
    }
}
