//! First intersection of a line and a torus.
//!
//! The quartic's coefficients are not used, because its roots lose half of their digits if the line grazes
//! the torus, and more if the tube is thin. Instead, let q(s) be the line's distance from the axis, with the
//! circle's radius as the unit of length. Then
//!
//! ```text
//! g(s) = (q − 1)² + z² − tube² = |p|² + 1 − tube² − 2q
//! ```
//!
//! is computed from the signed distance to the surface and has the same sign. Its second
//! derivative is 2(1 − w/q³), where w is constant along the line. Therefore, g has at most two inflection
//! points, which have a closed form, and is convex or concave between them. On each of these intervals,
//! Newton's method from the correct end converges to the nearest root without overshooting, or shows that
//! there is no root.

use crate::math::DVec3;

/// Maximum number of Newton and bisection steps. Even bisecting the entire line down to the last digit takes
/// fewer steps.
const MAX_STEPS: u32 = 200;

/// Half-width of the neighborhood around the axis in which the slope of g changes sign.
const KINK: f64 = 1e-9;

/// Rounding error of g near 0, relative to the tube radius. It is twice the error of the distance from the
/// circle.
const ROUNDING: f64 = 32.0 * f64::EPSILON;

/// A line near a torus around the z axis. The torus's circle has radius 1.
pub(super) struct UnitTorusLine {
    /// Point on the line closest to the center.
    pub(super) foot: DVec3,
    /// Unit direction.
    pub(super) direction: DVec3,
    /// Radius of the tube.
    pub(super) tube: f64,
}

/// Value of g and its derivative at a point on the line.
#[derive(Clone, Copy)]
struct LineSample {
    s: f64,
    value: f64,
    slope: f64,
}

impl UnitTorusLine {
    /// Interval of the line inside the torus's bounding ball and between its bounding planes, all of which
    /// are moved outward by `room` times the tube radius.
    pub(super) fn nearby_interval(&self, room: f64) -> Option<(f64, f64)> {
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

    /// First point between `from` and `to` where the line crosses the surface. If the line starts on the
    /// surface, within rounding error, its start is ignored.
    pub(super) fn first_crossing(&self, from: f64, to: f64) -> Option<f64> {
        if !(from < to) {
            return None;
        }
        let within = |s: f64| s.max(from).min(to);
        let inflections = self.inflections().map_or([to; 2], |cuts| cuts.map(within));
        let mut low = self.evaluate(from);
        if low.value.abs() <= ROUNDING * self.tube {
            low.value = 0.0;
        }
        let is_inside = low.value < 0.0 || low.value == 0.0 && low.slope < 0.0;
        if !is_inside && self.moves_away_from_circle(from) {
            return None;
        }
        for (end, is_convex) in [(inflections[0], true), (inflections[1], false), (to, true)] {
            if end > low.s {
                let high = self.evaluate(end);
                let crossing = self.crossing_between_samples(low, high, is_inside, is_convex);
                if crossing.is_some() {
                    return crossing;
                }
                low = high;
            }
        }
        None
    }

    /// Whether the line moves away from the circle on its outer side, so that both components of the distance
    /// increase after `from`.
    fn moves_away_from_circle(&self, from: f64) -> bool {
        let p = self.foot + self.direction * from;
        let (across, d) = (p.truncate(), self.direction.truncate());
        across.length_squared() >= 1.0 && across.dot(d) >= 0.0 && p.z * self.direction.z >= 0.0
    }

    /// Points between `from` and `to` where the line enters the torus. `from` must be outside. There are at
    /// most two such points.
    pub(super) fn surface_entry_parameters(&self, from: f64, to: f64) -> [Option<f64>; 2] {
        /// Step past a crossing, long enough to reach the other side of the surface despite rounding unless
        /// the line grazes the surface.
        const STEP_PAST_CROSSING: f64 = 1e-10;
        let mut found = [None; 2];
        let mut start = from;
        for crossing in 0..4 {
            let Some(s) = self.first_crossing(start, to) else { break };
            if crossing % 2 == 0 {
                found[crossing / 2] = Some(s);
            }
            start = s + STEP_PAST_CROSSING;
        }
        found
    }

    fn evaluate(&self, s: f64) -> LineSample {
        let p = self.foot + self.direction * s;
        let ring = p.truncate().length();
        let (across, z) = (ring - 1.0, p.z);
        let distance = (across * across + z * z).sqrt();
        let outwards = if ring > 0.0 { p.truncate().dot(self.direction.truncate()) / ring } else { 0.0 };
        LineSample {
            s,
            value: (distance - self.tube) * (distance + self.tube),
            slope: 2.0 * (across * outwards + z * self.direction.z),
        }
    }

    /// Ends of the interval where g is concave (q³ < w). If the line passes through the axis, g has a kink
    /// there, so the interval is widened to contain the kink. There are no crossings that close to the axis.
    fn inflections(&self) -> Option<[f64; 2]> {
        let (p, d) = (self.foot.truncate(), self.direction.truncate());
        let a = d.length_squared();
        let moment = p.perp_dot(d);
        let w = moment * moment;
        let ring = libm::cbrt(w);
        let half = ((ring * ring - w / a) / a).sqrt();
        let middle = -p.dot(d) / a;
        (half >= 0.0).then(|| [middle - half.max(KINK), middle + half.max(KINK)])
    }

    /// First crossing in an interval. `is_inside` is true if the interval starts inside the torus.
    fn crossing_between_samples(
        &self,
        low: LineSample,
        high: LineSample,
        is_inside: bool,
        is_convex: bool,
    ) -> Option<f64> {
        if (high.value <= 0.0) != is_inside {
            let start = if is_inside == is_convex { high } else { low };
            return Some(self.refine_crossing(low.s, high.s, start, is_inside));
        }
        // If both ends are on the same side, a convex g may dip below 0 in between, and a concave g may rise
        // above 0.
        (is_inside != is_convex)
            .then(|| self.first_root_of_dip(low, high, if is_inside { -1.0 } else { 1.0 }))
            .flatten()
    }

    /// The only crossing between two points. Uses Newton's method, but bisects when a Newton step would leave
    /// the interval.
    fn refine_crossing(&self, mut low: f64, mut high: f64, start: LineSample, is_inside: bool) -> f64 {
        let mut x = start;
        for _ in 0..MAX_STEPS {
            let newton = x.s - x.value / x.slope;
            if newton == x.s {
                break;
            }
            let next = if low < newton && newton < high { newton } else { 0.5 * (low + high) };
            if !(low < next && next < high) {
                break;
            }
            x = self.evaluate(next);
            if (x.value <= 0.0) == is_inside { low = next } else { high = next }
        }
        x.s
    }

    /// First root after `low` in an interval where sign·g is convex and positive at both ends. A Newton step
    /// on a convex function never overshoots the root. If the steps pass the minimum, there is no root.
    fn first_root_of_dip(&self, low: LineSample, high: LineSample, sign: f64) -> Option<f64> {
        if !(high.slope * sign > 0.0) {
            return None;
        }
        let mut x = low;
        for _ in 0..MAX_STEPS {
            if !(x.slope * sign < 0.0) {
                return None;
            }
            let next = x.s - x.value / x.slope;
            if !(next > x.s) {
                break;
            }
            if !(next < high.s) {
                return None;
            }
            let before = x;
            x = self.evaluate(next);
            if x.value * sign <= 0.0 {
                // The step overshot the root because of rounding.
                return Some(self.refine_crossing(before.s, x.s, before, sign < 0.0));
            }
        }
        Some(x.s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::random::TestRandom;

    /// Lines close to the circle. Some are parallel to the axis, and some pass through it.
    fn lines(tube: f64) -> impl Iterator<Item = UnitTorusLine> {
        let mut random = TestRandom::new(3);
        (0..30_000).map(move |i| {
            let (sin, cos) = (random.signed() * 4.0).sin_cos();
            let near = DVec3::new(cos, sin, 0.0) + random.in_cube() * (1.2 * tube);
            let direction = match i % 4 {
                0 => DVec3::Z,
                1 => near - DVec3::Z * random.signed(),
                _ => random.in_cube(),
            };
            let direction = direction.normalize();
            UnitTorusLine { foot: near - direction * near.dot(direction), direction, tube }
        })
    }

    #[test]
    fn crossings_are_precise_for_thin_tubes() {
        for tube in [1e-6, 1e-3, 0.3, 0.99] {
            let mut found = 0;
            for line in lines(tube) {
                let Some((from, to)) = line.nearby_interval(0.01) else { continue };
                let Some(s) = line.first_crossing(from, to) else { continue };
                found += 1;
                let p = line.foot + line.direction * s;
                let off = ((p.truncate().length() - 1.0).hypot(p.z) - tube).abs();
                assert!(off < 2e-15, "error of {off} at tube {tube}");
            }
            assert!(found > 10_000, "{found}");
        }
    }

    #[test]
    fn slope_is_monotonic_between_inflections() {
        for line in lines(0.4) {
            let Some([first, second]) = line.inflections() else { continue };
            let slope = |s: f64| line.evaluate(s).slope;
            for (low, high, is_convex) in
                [(first - 1.0, first, true), (first, second, false), (second, second + 1.0, true)]
            {
                let steps = (0..=8).map(|i| slope(low + (high - low) * (0.01 + 0.98 * f64::from(i) / 8.0)));
                let steps: Vec<f64> = steps.collect();
                let room = 1e-9;
                let right = steps.windows(2).all(|pair| {
                    let rise = pair[1] - pair[0];
                    if is_convex { rise > -room } else { rise < room }
                });
                assert!(right, "{steps:?} convex {is_convex} from {low} to {high}");
            }
        }
    }
}
