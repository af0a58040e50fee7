//! Cones, in double precision.

use std::f64::consts::{PI, TAU};

use super::axial::{self, AxialFrame, Line, Stretch, at_turn, exact_t, radial, turn};
use super::disk::{BORDER, Disk};
use super::{Aabb, RayF64, ShapeHit, SurfacePoint};
use crate::math::{DVec2, DVec3, Vec2};

/// A cone with a round base, or its bare side; the front is outside. Parts: 0 the side, 1 the cap at the base.
///
/// Texture coordinates of the side: u once around, v from 0 at the base to 1 at the tip, so that on a cone that stands
/// on its base pictures stand and are not mirrored; of the cap as for a [`Disk`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Its origin is the tip, its axis goes to the base.
    frame: AxialFrame,
    height: f64,
    radius: f64,
    /// Length of the side from the tip to the base's border.
    slant: f64,
    capped: bool,
}

impl Cone {
    /// From the middle of its base, a tip elsewhere, and the base's radius > 0.
    pub fn new(base: DVec3, tip: DVec3, radius: f64, capped: bool) -> Self {
        let height = (base - tip).length();
        let slant = height.hypot(radius);
        Self { frame: AxialFrame::new(tip, base - tip), height, radius, slant, capped }
    }

    /// The nearest hit, from outside or inside.
    pub fn intersect(&self, ray: &RayF64) -> Option<ShapeHit> {
        self.nearest(ray).map(axial::hit)
    }

    fn nearest(&self, ray: &RayF64) -> Option<(f64, u32)> {
        let line = self.frame.line(ray);
        let base = if self.capped { self.height } else { self.height * (1.0 + BORDER) };
        let ends = Stretch::between(&line, (0.0, 0), (base, 1))?;
        axial::meet(ray, &line, self.side_stretch(&line)?, ends, self.capped)
    }

    /// Where the line is inside the side, extended beyond the base and, by its image, beyond the tip: |p| ≤ k|z|. The
    /// quadratic A·s² − 2B·s + C is that of the foot of the tip on the line, which is why B is one product; B² − AC
    /// is a difference of squares of the line's moment about the tip, exact to the last digits also for lines that
    /// graze the side next to the tip.
    fn side_stretch(&self, line: &Line) -> Option<Stretch> {
        let k = self.radius / self.height;
        let (p, d) = (line.foot, line.direction);
        let factors = |x: DVec3| {
            let (across, along) = (x.truncate().length(), k * x.z.abs());
            (across - along) * (across + along)
        };
        let (a, b, c) = (factors(d), (1.0 + k * k) * p.z * d.z, factors(p));
        let moment = p.cross(d);
        let discriminant = factors(DVec3::new(k * moment.x, k * moment.y, moment.z / k));
        let crosses_both = a <= 0.0;
        if discriminant.is_nan() || discriminant < 0.0 && !crosses_both {
            return None;
        }
        let q = b + discriminant.max(0.0).sqrt().copysign(b);
        // A line as steep as the side meets it once; its other root is where slightly steeper ones have it.
        let a = if a == 0.0 { -0.0 } else { a };
        let (s0, s1) = if q == 0.0 { (0.0, 0.0) } else { (c / q, q / a) };
        Some(match (crosses_both, d.z > 0.0) {
            (false, _) => Stretch::of_side(s0.min(s1), s0.max(s1)),
            (true, true) => Stretch::of_side(s0.max(s1), f64::INFINITY),
            (true, false) => Stretch::of_side(f64::NEG_INFINITY, s0.min(s1)),
        })
    }

    /// The surface at a hit.
    pub fn surface(&self, ray: &RayF64, hit: &ShapeHit) -> SurfacePoint {
        let point = ray.at(exact_t(hit, self.nearest(ray)));
        if hit.primitive > 0 {
            return self.base().surface_near(point, self.reach());
        }
        let local = self.frame.local(point);
        let out = radial(local.truncate());
        let down = DVec2::new(self.radius, self.height) / self.slant;
        let along = DVec2::new(local.truncate().length(), local.z).dot(down).clamp(0.0, self.slant);
        let around = out.perp() * (-TAU * down.x * along);
        SurfacePoint::exact(
            self.frame.point((out * (down.x * along)).extend(down.y * along)),
            self.frame.vector((out * down.y).extend(-down.x)),
            Vec2::new(turn(mirrored(out)) as f32, (1.0 - along / self.slant) as f32),
            self.frame.vector(around.extend(0.0)),
            self.frame.vector((out * -self.radius).extend(-self.height)),
            self.reach(),
        )
    }

    fn reach(&self) -> f64 {
        self.frame.origin.abs().max_element() + self.height + self.radius
    }

    /// Point and unit normal of the side.
    pub fn side(&self, u: f64, v: f64) -> (DVec3, DVec3) {
        let out = mirrored(at_turn(u));
        let point = (out * self.radius).extend(self.height) * (1.0 - v);
        let normal = (out * self.height).extend(-self.radius) / self.slant;
        (self.frame.point(point), self.frame.vector(normal))
    }

    /// The cap, facing outwards.
    pub fn base(&self) -> Disk {
        Disk::new(self.frame.point(DVec3::Z * self.height), self.frame.axis(), self.radius)
    }

    /// Areas of the parts.
    pub fn areas(&self) -> [f64; 2] {
        let cap = if self.capped { PI * self.radius * self.radius } else { 0.0 };
        [PI * self.radius * self.slant, cap]
    }

    /// Centre of area.
    pub fn center(&self) -> DVec3 {
        let [side, cap] = self.areas();
        self.frame.point(DVec3::Z * (self.height * (side * 2.0 / 3.0 + cap) / (side + cap)))
    }

    /// Unit vector from the tip to the base.
    pub fn axis(&self) -> DVec3 {
        self.frame.axis()
    }

    /// Cosine and sine of the side's slope: of its normals, what is across the axis, and what is towards the tip.
    pub fn slope(&self) -> (f64, f64) {
        (self.height / self.slant, self.radius / self.slant)
    }

    /// Whether a point is inside.
    pub fn contains(&self, point: DVec3) -> bool {
        let p = self.frame.local(point);
        p.z < self.height && p.truncate().length() < self.radius / self.height * p.z
    }

    /// The box around it.
    pub fn bounds(&self) -> Aabb {
        self.frame.circle_bounds(0.0, 0.0).union(self.frame.circle_bounds(self.height, self.radius))
    }
}

/// Angles are counted about the axis from base to tip, against the frame's.
fn mirrored(p: DVec2) -> DVec2 {
    DVec2::new(p.x, -p.y)
}
