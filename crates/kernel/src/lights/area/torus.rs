//! Torus lights. First samples a slice around the axis, then a point on the part of the slice's circle that
//! faces the shading point.

use std::f64::consts::PI;

use super::disk::perpendicular;
use super::meridians::SinCos;
use super::piecewise_linear::PiecewiseLinear;
use super::sample_point::SampledLightPoint;
use super::{LightHitPoint, ShapeEmitter};
use crate::geometry::RayF64;
use crate::geometry::torus::Torus;
use crate::math::elementary::sin_cos;
use crate::math::{DVec3, Vec3};

/// A torus that emits outward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorusEmitter {
    torus: Torus,
}

/// Number of slices at which the density is evaluated.
const SLICES: usize = 7;

/// Number of points on a slice's circle at which the density is evaluated.
const SLICE_POINTS: usize = 5;

/// Minimum closeness. Without it, closeness would be 0 on the axis, where all slices look the same.
const MIN_CLOSENESS: f64 = 0.01;

/// A torus seen from a point outside it.
///
/// A slice is a half plane through the axis at an angle φ from the point. Its parameter τ satisfies
/// closeness·φ = sinh τ. Near the point, the density of slices is adapted to the point's distance; farther
/// away, slices are uniform in the logarithm of their distance. The foot is the point's projection onto the
/// slice's plane. The tangents from the foot bound the visible part of the slice's circle. If the circle were
/// replaced by a plane, the sine of the elevation would be uniformly distributed.
struct TorusView {
    point: DVec3,
    /// Unit vectors from the axis toward the point, along the axis, and perpendicular to both.
    out: DVec3,
    axis: DVec3,
    across: DVec3,
    /// Distance of the point from the axis, and its height above the plane of the tube's center circle.
    distance: f64,
    height: f64,
    radius: f64,
    tube: f64,
    /// √(distance·radius) relative to the point's distance from the surface.
    closeness: f64,
    /// Largest τ of a visible slice.
    reach: f64,
}

/// The visible part of a slice. Lengths are measured from the foot in the slice's plane.
struct TorusCrossSection {
    /// Sine and cosine of φ.
    turn: SinCos,
    /// Distance from the axis to the foot.
    foot: f64,
    /// Distance from the point to the plane of the slice.
    off: f64,
    /// Direction from the foot to the circle's center, as (outward, along the axis).
    to_middle: [f64; 2],
    /// Smallest distance from the foot to the circle, and the power of the foot with respect to the circle
    /// (the product of the two distances along any line through the foot).
    gap: f64,
    power: f64,
    /// Maximum sine of the elevation.
    sine: f64,
}

/// Relative difference below which two distances are considered equal.
const SAME_DISTANCE: f64 = 1e-3;

/// A point on a slice's circle.
struct SlicePoint {
    /// Offset from the foot, outward and along the axis.
    outwards: f64,
    upwards: f64,
    /// Solid angle per unit of φ and per unit of the relative sine (the sine divided by its maximum).
    factor: f64,
}

impl ShapeEmitter for TorusEmitter {
    /// Samples a direction toward the front of the torus. If a ray in this direction enters the torus twice,
    /// the pdf includes both hits. The sample is the nearer hit, so the torus never occludes it.
    fn sample(&self, point: Vec3, u: [f32; 2]) -> SampledLightPoint {
        let Some(view) = TorusView::new(&self.torus, point) else { return SampledLightPoint::NOTHING };
        let slices = view.slice_distribution();
        let side = 2.0 * f64::from(u[0]) - 1.0;
        let (share, density) = slices.sample(side.abs());
        let tau = share * view.reach;
        let turn = libm::sinh(tau) / view.closeness;
        let Some(slice) = view.slice(SinCos::from_radians(turn.copysign(side))) else {
            return SampledLightPoint::NOTHING;
        };
        let (sine, in_slice) = slice.elevation_distribution(&view).sample(f64::from(u[1]));
        let place = slice.near_intersection(&view, slice.slice_tan_from_elevation_sin(2.0 * sine - 1.0));
        let own = view.tau_to_angle_density(density, tau) * 0.5 * in_slice / place.factor;
        if !(own > 0.0) {
            return SampledLightPoint::NOTHING;
        }
        let offset = view.offset_to_slice_point(&slice, &place);
        let direction = offset.normalize();
        let (densities, first) = view.sum_entry_pdfs(&self.torus, &slices, direction);
        // A grazing ray may miss the torus because of rounding.
        let (density, distance) =
            first.map_or((own, offset.length()), |first| (densities.max(0.5 * own), first));
        let direction = direction.as_vec3();
        SampledLightPoint {
            direction,
            target: point + direction * distance as f32,
            factor: (1.0 / density) as f32,
        }
    }

    fn pdf(&self, from: Vec3, hit: &LightHitPoint) -> f32 {
        TorusView::new(&self.torus, from).map_or(0.0, |view| {
            let slices = view.slice_distribution();
            let (density, first) = view.sum_entry_pdfs(&self.torus, &slices, hit.direction.as_dvec3());
            // A ray may continue through the first surface and hit another one, which is never sampled.
            let is_later = first.is_some_and(|first| f64::from(hit.distance) > first * (1.0 + SAME_DISTANCE));
            if is_later { 0.0 } else { density as f32 }
        })
    }

    fn area_centroid(&self) -> DVec3 {
        self.torus.centroid()
    }
}

impl TorusEmitter {
    /// Creates an emitter for an entire torus.
    pub fn new(torus: Torus) -> Self {
        Self { torus }
    }
}

impl TorusView {
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
        let closeness = ((distance * radius).sqrt() / gap).max(MIN_CLOSENESS);
        // From points outside the ring and between its top and bottom planes, only the near side of the ring
        // is visible, up to the angle `widest`.
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

    /// Density over τ of the slices on one side, relative to its maximum.
    fn slice_distribution(&self) -> PiecewiseLinear<SLICES> {
        // Compute sinh and cosh from powers of e^step.
        let step = libm::exp(self.reach / (SLICES - 1) as f64);
        let mut power = 1.0;
        PiecewiseLinear(std::array::from_fn(|_| {
            let (sinh, cosh) = (0.5 * (power - 1.0 / power), 0.5 * (power + 1.0 / power));
            power *= step;
            let (sin, cos) = sin_cos((sinh / self.closeness) as f32);
            let slice = self.slice(SinCos { sin: f64::from(sin), cos: f64::from(cos) });
            slice.map_or(0.0, |slice| {
                slice.near_intersection(self, slice.slice_tan_from_elevation_sin(0.0)).factor
            }) * cosh
        }))
    }

    /// Converts a density over τ/τ_max on one side to a density over φ on both sides.
    fn tau_to_angle_density(&self, density: f64, tau: f64) -> f64 {
        0.5 * density * self.closeness / (libm::cosh(tau) * self.reach)
    }

    /// The slice at an angle φ, or `None` if the slice is not visible.
    fn slice(&self, turn: SinCos) -> Option<TorusCrossSection> {
        let foot = self.distance * turn.cos;
        let off = self.distance * turn.sin;
        let beside = self.radius - foot;
        let distance = (beside * beside + self.height * self.height).sqrt();
        let (gap, power) = (distance - self.tube, (distance - self.tube) * (distance + self.tube));
        let highest = gap * self.tube / power.max(0.0).sqrt();
        let slope = gap * gap + off * off + highest * highest;
        (gap > 0.0).then(|| TorusCrossSection {
            turn,
            foot,
            off,
            to_middle: [beside / distance, -self.height / distance],
            gap,
            power,
            sine: highest / slope.sqrt(),
        })
    }

    /// Offset from the view point to a point on a slice.
    fn offset_to_slice_point(&self, slice: &TorusCrossSection, place: &SlicePoint) -> DVec3 {
        let SinCos { sin, cos } = slice.turn;
        let outwards = self.out * cos + self.across * sin;
        let along = self.across * cos - self.out * sin;
        outwards * place.outwards + self.axis * place.upwards + along * slice.off
    }

    /// Sum of the pdfs in sr⁻¹ at all points where the ray enters the torus, and the distance to the first
    /// one.
    fn sum_entry_pdfs(
        &self,
        torus: &Torus,
        slices: &PiecewiseLinear<SLICES>,
        direction: DVec3,
    ) -> (f64, Option<f64>) {
        let ray = RayF64 { origin: self.point, direction, t_max: f64::INFINITY };
        let entries = torus.entry_parameters(&ray);
        let sum = entries.iter().flatten().map(|t| self.pdf_at_point_offset(slices, direction * *t)).sum();
        (sum, entries[0])
    }

    /// Pdf at a point, given its offset from the view point.
    fn pdf_at_point_offset(&self, slices: &PiecewiseLinear<SLICES>, offset: DVec3) -> f64 {
        let (x, y) = (self.distance + offset.dot(self.out), offset.dot(self.across));
        let ring = (x * x + y * y).sqrt();
        let turn = SinCos { sin: y / ring, cos: x / ring };
        let share = libm::asinh(self.closeness * libm::atan2(turn.sin.abs(), turn.cos)) / self.reach;
        let Some(slice) = self.slice(turn).filter(|_| share <= 1.0 + 1e-9) else { return 0.0 };
        let [outwards, upwards] = [ring - slice.foot, offset.dot(self.axis)];
        let [u, v] = slice.to_middle;
        let (ahead, beside) = (outwards * u + upwards * v, upwards * u - outwards * v);
        let tangent = beside / ahead;
        let factor = slice.near_intersection(self, tangent).factor;
        if !(ahead > 0.0 && factor > 0.0) {
            return 0.0;
        }
        let in_slice = slice
            .elevation_distribution(self)
            .pdf((0.5 + 0.5 * slice.elevation_sin_from_slice_tan(tangent)).clamp(0.0, 1.0));
        self.tau_to_angle_density(slices.pdf(share), share * self.reach) * 0.5 * in_slice / factor
    }
}

impl TorusCrossSection {
    /// Converts the relative sine of the elevation (the sine divided by its maximum) to the tangent of the
    /// angle to the circle's center.
    fn slice_tan_from_elevation_sin(&self, sine: f64) -> f64 {
        let sine = sine * self.sine;
        let distance = (self.gap * self.gap + self.off * self.off).sqrt();
        distance * sine / ((1.0 - sine) * (1.0 + sine)).sqrt() / self.gap
    }

    /// Converts the tangent of the angle to the circle's center to the relative sine of the elevation.
    fn elevation_sin_from_slice_tan(&self, tangent: f64) -> f64 {
        let y = self.gap * tangent;
        y / (self.gap * self.gap + self.off * self.off + y * y).sqrt() / self.sine
    }

    /// Distribution of the relative sine of the elevation, mapped from [−1, 1] to [0, 1].
    fn elevation_distribution(&self, view: &TorusView) -> PiecewiseLinear<SLICE_POINTS> {
        let sine = |i: usize| 2.0 * i as f64 / (SLICE_POINTS - 1) as f64 - 1.0;
        PiecewiseLinear(std::array::from_fn(|i| {
            self.near_intersection(view, self.slice_tan_from_elevation_sin(sine(i))).factor
        }))
    }

    /// Finds the near point on the circle from the tangent of the angle to the circle's center.
    fn near_intersection(&self, view: &TorusView, tangent: f64) -> SlicePoint {
        let cos = 1.0 / (1.0 + tangent * tangent).sqrt();
        let sin = tangent * cos;
        let middle = self.gap + view.tube;
        let half_chord = ((view.tube - middle * sin) * (view.tube + middle * sin)).max(0.0).sqrt();
        let to_circle = self.power / (middle * cos + half_chord);
        let [u, v] = self.to_middle;
        let (outwards, upwards) = (to_circle * (cos * u - sin * v), to_circle * (cos * v + sin * u));
        // The solid angle of dη·dφ is ring·D²/d³ with d² = D² + off². Let y = gap·tan η and let s be the sine
        // of its elevation. Then dη = gap·dy/(gap² + y²) and dy = (gap² + off² + y²)^(3/2)/(gap² + off²) ds.
        let (g2, off2) = (self.gap * self.gap, self.off * self.off);
        let (y2, d2) = (g2 * tangent * tangent, to_circle * to_circle);
        let ratio = (g2 + off2 + y2) / (d2 + off2);
        let ring = self.foot + outwards;
        let factor = ring * d2 / (g2 + y2) * (ratio * ratio.sqrt()) * self.gap * self.sine / (g2 + off2);
        SlicePoint { outwards, upwards, factor }
    }
}
