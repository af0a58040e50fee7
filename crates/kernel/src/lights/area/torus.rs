//! Torus lights: sampled by slices around the axis, and in each by the part of the tube's circle that faces the point.

use std::f64::consts::PI;

use super::disk::perpendicular;
use super::linear::Linear;
use super::meridians::Turn;
use super::sample_point::LightSamplePoint;
use super::{LightHit, ShapeEmitter};
use crate::geometry::RayF64;
use crate::geometry::torus::Torus;
use crate::math::elementary::sin_cos;
use crate::math::{DVec3, Vec3};

/// A torus that emits outwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorusEmitter {
    torus: Torus,
}

/// Number of slices at which the density is evaluated.
const SLICES: usize = 7;

/// Number of places of a slice's circle at which the density is evaluated.
const PLACES: usize = 5;

/// Least closeness; seen from the axis, all slices are alike.
const LEAST_CLOSENESS: f64 = 0.01;

/// A torus relative to a point outside.
///
/// A slice through the axis stands at an angle φ from the point. Its parameter is τ with closeness·φ = sinh τ: near the point,
/// slices are as dense as its distance requires; farther away they are even in the logarithm of their distance. The visible
/// part of a slice's circle is bounded by tangents from the point's foot in the slice's plane. If there were a plane in its
/// place, sines of elevations would be uniform.
struct View {
    point: DVec3,
    /// Unit vectors: towards the point from the axis, along the axis, and across.
    out: DVec3,
    axis: DVec3,
    across: DVec3,
    /// Distance of the point from the axis, and height above the plane of the circle.
    distance: f64,
    height: f64,
    radius: f64,
    tube: f64,
    /// √(distance·radius) in units of the point's distance from the surface.
    closeness: f64,
    /// The greatest τ.
    reach: f64,
}

/// Visible part of a slice: all lengths in its plane, from the foot of the point there.
struct Slice {
    /// Sine and cosine of the angle φ.
    turn: Turn,
    /// Distance from the axis to the foot.
    foot: f64,
    /// Distance from the plane to the point.
    off: f64,
    /// Direction to the circle's middle as (outwards, along the axis).
    to_middle: [f64; 2],
    /// Nearest distance, and the product of both distances along any line through the foot.
    gap: f64,
    power: f64,
    /// The greatest sine of elevation.
    sine: f64,
}

/// Relative difference of distances that are equal within rounding.
const SAME_PLACE: f64 = 1e-3;

/// A point of a slice's circle.
struct Place {
    /// Offset from the foot, outwards and along the axis.
    outwards: f64,
    upwards: f64,
    /// Solid angle per φ and per sine, the sine in units of the greatest one.
    factor: f64,
}

impl ShapeEmitter for TorusEmitter {
    /// Samples a direction whose first hit on the torus faces the point. If a direction hits it twice, both hits count for its
    /// pdf, so that no sample is occluded.
    fn sample(&self, point: Vec3, u: [f32; 2]) -> LightSamplePoint {
        let Some(view) = View::new(&self.torus, point) else { return LightSamplePoint::NOTHING };
        let slices = view.slices();
        let side = 2.0 * f64::from(u[0]) - 1.0;
        let (share, density) = slices.sample(side.abs());
        let tau = share * view.reach;
        let turn = libm::sinh(tau) / view.closeness;
        let Some(slice) = view.slice(Turn::of(turn.copysign(side))) else { return LightSamplePoint::NOTHING };
        let (sine, in_slice) = slice.sines(&view).sample(f64::from(u[1]));
        let place = slice.place(&view, slice.tangent(2.0 * sine - 1.0));
        let own = view.per_turn(density, tau) * 0.5 * in_slice / place.factor;
        if !(own > 0.0) {
            return LightSamplePoint::NOTHING;
        }
        let offset = view.offset(&slice, &place);
        let direction = offset.normalize();
        let (densities, first) = view.densities(&self.torus, &slices, direction);
        // A line that grazes the torus may miss it by rounding.
        let (density, distance) =
            first.map_or((own, offset.length()), |first| (densities.max(0.5 * own), first));
        let direction = direction.as_vec3();
        LightSamplePoint {
            direction,
            target: point + direction * distance as f32,
            factor: (1.0 / density) as f32,
        }
    }

    fn pdf(&self, from: Vec3, met: &LightHit) -> f32 {
        View::new(&self.torus, from).map_or(0.0, |view| {
            let slices = view.slices();
            let (density, first) = view.densities(&self.torus, &slices, met.direction.as_dvec3());
            // A ray that passes the first place straight on finds another one, which no sample does.
            let is_later = first.is_some_and(|first| f64::from(met.distance) > first * (1.0 + SAME_PLACE));
            if is_later { 0.0 } else { density as f32 }
        })
    }

    fn middle(&self) -> DVec3 {
        self.torus.centroid()
    }
}

impl TorusEmitter {
    /// The emitter of a whole torus.
    pub fn new(torus: Torus) -> Self {
        Self { torus }
    }
}

impl View {
    fn new(torus: &Torus, point: Vec3) -> Option<Self> {
        let (center, axis) = (torus.centroid(), torus.axis());
        let (radius, tube) = torus.radii();
        let point = point.as_dvec3();
        let from_center = point - center;
        let height = from_center.dot(axis);
        let flat = from_center - axis * height;
        let distance = flat.length();
        let out = if distance > 0.0 { flat / distance } else { perpendicular(axis) };
        let beside = distance - radius;
        let gap = (beside * beside + height * height).sqrt() - tube;
        if !(gap > 0.0) {
            return None;
        }
        let closeness = ((distance * radius).sqrt() / gap).max(LEAST_CLOSENESS);
        // From between the planes of its top and its bottom, outside of the ring, the ring's far side is invisible, and its
        // near side is visible up to the circles' reach.
        let is_beside = height.abs() < tube && beside > 0.0;
        let widest = if is_beside {
            let half = ((tube - height) * (tube + height)).sqrt();
            2.0 * libm::atan(((beside - half) / (distance + radius + half)).max(0.0).sqrt())
        } else {
            PI
        };
        let reach = libm::asinh(closeness * widest);
        Some(Self {
            point,
            out,
            axis,
            across: axis.cross(out),
            distance,
            height,
            radius,
            tube,
            closeness,
            reach,
        })
    }

    /// Density of the slices to one side by τ, in units of the greatest τ.
    fn slices(&self) -> Linear<SLICES> {
        // sinh and cosh by powers of e^step.
        let step = libm::exp(self.reach / (SLICES - 1) as f64);
        let mut power = 1.0;
        Linear(std::array::from_fn(|_| {
            let (sinh, cosh) = (0.5 * (power - 1.0 / power), 0.5 * (power + 1.0 / power));
            power *= step;
            let (sin, cos) = sin_cos((sinh / self.closeness) as f32);
            let slice = self.slice(Turn { sin: f64::from(sin), cos: f64::from(cos) });
            slice.map_or(0.0, |slice| slice.place(self, slice.tangent(0.0)).factor) * cosh
        }))
    }

    /// Density by φ, over both sides, from one by τ in units of the greatest τ.
    fn per_turn(&self, density: f64, tau: f64) -> f64 {
        0.5 * density * self.closeness / (libm::cosh(tau) * self.reach)
    }

    /// The slice at an angle φ. `None` if none of it is visible.
    fn slice(&self, turn: Turn) -> Option<Slice> {
        let foot = self.distance * turn.cos;
        let off = self.distance * turn.sin;
        let beside = self.radius - foot;
        let distance = (beside * beside + self.height * self.height).sqrt();
        let (gap, power) = (distance - self.tube, (distance - self.tube) * (distance + self.tube));
        let highest = gap * self.tube / power.max(0.0).sqrt();
        let slope = gap * gap + off * off + highest * highest;
        (gap > 0.0).then(|| Slice {
            turn,
            foot,
            off,
            to_middle: [beside / distance, -self.height / distance],
            gap,
            power,
            sine: highest / slope.sqrt(),
        })
    }

    /// Offset from the point to a place.
    fn offset(&self, slice: &Slice, place: &Place) -> DVec3 {
        let Turn { sin, cos } = slice.turn;
        let outwards = self.out * cos + self.across * sin;
        let along = self.across * cos - self.out * sin;
        outwards * place.outwards + self.axis * place.upwards + along * slice.off
    }

    /// Sum of the densities of all places where a direction enters the torus, in sr⁻¹, and the distance to the first one.
    fn densities(&self, torus: &Torus, slices: &Linear<SLICES>, direction: DVec3) -> (f64, Option<f64>) {
        let ray = RayF64 { origin: self.point, direction, t_max: f64::INFINITY };
        let entries = torus.entries(&ray);
        let sum = entries.iter().flatten().map(|t| self.density(slices, direction * *t)).sum();
        (sum, entries[0])
    }

    /// The density of a place by its offset from the point.
    fn density(&self, slices: &Linear<SLICES>, offset: DVec3) -> f64 {
        let (x, y) = (self.distance + offset.dot(self.out), offset.dot(self.across));
        let ring = (x * x + y * y).sqrt();
        let turn = Turn { sin: y / ring, cos: x / ring };
        let share = libm::asinh(self.closeness * libm::atan2(turn.sin.abs(), turn.cos)) / self.reach;
        let Some(slice) = self.slice(turn).filter(|_| share <= 1.0 + 1e-9) else { return 0.0 };
        let [outwards, upwards] = [ring - slice.foot, offset.dot(self.axis)];
        let [u, v] = slice.to_middle;
        let (ahead, beside) = (outwards * u + upwards * v, upwards * u - outwards * v);
        let tangent = beside / ahead;
        let factor = slice.place(self, tangent).factor;
        if !(ahead > 0.0 && factor > 0.0) {
            return 0.0;
        }
        let in_slice = slice.sines(self).pdf((0.5 + 0.5 * slice.sine_of(tangent)).clamp(0.0, 1.0));
        self.per_turn(slices.pdf(share), share * self.reach) * 0.5 * in_slice / factor
    }
}

impl Slice {
    /// Tangent of the angle to the circle's middle, from a sine in units of the greatest.
    fn tangent(&self, sine: f64) -> f64 {
        let sine = sine * self.sine;
        let distance = (self.gap * self.gap + self.off * self.off).sqrt();
        distance * sine / ((1.0 - sine) * (1.0 + sine)).sqrt() / self.gap
    }

    /// Sine in units of the greatest, from a tangent.
    fn sine_of(&self, tangent: f64) -> f64 {
        let y = self.gap * tangent;
        y / (self.gap * self.gap + self.off * self.off + y * y).sqrt() / self.sine
    }

    /// Density of the sines from the least to the greatest.
    fn sines(&self, view: &View) -> Linear<PLACES> {
        let sine = |i: usize| 2.0 * i as f64 / (PLACES - 1) as f64 - 1.0;
        Linear(std::array::from_fn(|i| self.place(view, self.tangent(sine(i))).factor))
    }

    /// The place of the circle at the tangent of an angle to its middle, on the near side.
    fn place(&self, view: &View, tangent: f64) -> Place {
        let cos = 1.0 / (1.0 + tangent * tangent).sqrt();
        let sin = tangent * cos;
        let middle = self.gap + view.tube;
        let half_chord = ((view.tube - middle * sin) * (view.tube + middle * sin)).max(0.0).sqrt();
        let to_circle = self.power / (middle * cos + half_chord);
        let [u, v] = self.to_middle;
        let (outwards, upwards) = (to_circle * (cos * u - sin * v), to_circle * (cos * v + sin * u));
        // The solid angle of dη·dφ is ring·D²/d³, d² = D² + off². With y = gap·tan η and its sine of elevation s,
        // dη = gap·dy/(gap² + y²) and dy = (gap² + off² + y²)^(3/2)/(gap² + off²) ds.
        let (g2, off2) = (self.gap * self.gap, self.off * self.off);
        let (y2, d2) = (g2 * tangent * tangent, to_circle * to_circle);
        let ratio = (g2 + off2 + y2) / (d2 + off2);
        let ring = self.foot + outwards;
        let factor = ring * d2 / (g2 + y2) * (ratio * ratio.sqrt()) * self.gap * self.sine / (g2 + off2);
        Place { outwards, upwards, factor }
    }
}
