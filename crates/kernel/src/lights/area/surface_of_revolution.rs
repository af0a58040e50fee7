//! Cylinder and cone lights: a curved side and caps.

use super::disk::{DiskEmitter, perpendicular};
use super::meridians::{AzimuthDistribution, PolarFrame, SinCos};
use super::sample_point::SampledLightPoint;
use super::{LightHitPoint, ShapeEmitter};
use crate::geometry::cone::Cone;
use crate::geometry::cylinder::Cylinder;
use crate::math::{DVec3, Vec3};

/// A curved side and its caps. At most one cap is visible from any point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CappedRevolutionEmitter<S> {
    side: S,
    caps: [Option<DiskEmitter>; 2],
    middle: DVec3,
}

/// A light's curved side. Its intersection with each half plane around a pole is a single interval.
pub trait RevolutionSide {
    /// The side seen from a point.
    type View: RevolutionSideView;

    /// The side seen from a point, or `None` if the point is behind the side.
    fn view_from(&self, point: Vec3) -> Option<Self::View>;
}

/// A curved side seen from a point.
pub trait RevolutionSideView {
    /// The pole around which the half planes rotate.
    fn polar_frame(&self) -> &PolarFrame;

    /// Largest angle around the pole at which the side is visible.
    fn max_visible_angle(&self) -> SinCos;

    /// Difference between the cosines at the two ends of the visible interval, for an angle around the pole.
    fn visible_polar_cosine_extent(&self, around: SinCos) -> f64;

    /// Angle from the pole and distance of the point on the side whose angle around the pole is `around`, and
    /// whose polar cosine is at `fraction` of the visible interval.
    fn polar_angle_and_distance_at_fraction(&self, around: SinCos, fraction: f64) -> (SinCos, f64);
}

/// The visible part of a light.
struct RevolutionView<V> {
    side: Option<(V, AzimuthDistribution)>,
    cap: Option<(super::disk::DiskView, DVec3)>,
    /// Probability of sampling the side rather than the cap.
    side_probability: f64,
}

impl<S: RevolutionSide> ShapeEmitter for CappedRevolutionEmitter<S> {
    /// Samples nearly uniformly over the solid angle. The density varies between meridians, and it varies by
    /// up to 20 % on a cap.
    fn sample(&self, point: Vec3, u: [f32; 2]) -> SampledLightPoint {
        let view = self.view_from(point);
        let side_probability = view.side_probability as f32;
        let (direction, distance, factor) = match (view.side, view.cap) {
            (Some((side, meridians)), _) if u[0] < side_probability => {
                let (angle, density) = meridians.sample(u[1]);
                let around = SinCos::from_radians(angle);
                let (from_pole, distance) =
                    side.polar_angle_and_distance_at_fraction(around, f64::from(u[0] / side_probability));
                let factor =
                    side.visible_polar_cosine_extent(around) / (density * f64::from(side_probability));
                (side.polar_frame().direction(from_pole, around), distance, factor)
            }
            (_, Some((cap, normal))) => {
                let rest = (u[0] - side_probability) / (1.0 - side_probability);
                let (direction, distance, factor) = cap.sample(normal, [rest.min(1.0_f32.next_down()), u[1]]);
                (direction, distance, factor / f64::from(1.0 - side_probability))
            }
            (_, None) => return SampledLightPoint::NOTHING,
        };
        let direction = direction.as_vec3();
        SampledLightPoint { direction, target: point + direction * distance as f32, factor: factor as f32 }
    }

    fn pdf(&self, from: Vec3, hit: &LightHitPoint) -> f32 {
        let view = self.view_from(from);
        let side_probability = f64::from(view.side_probability as f32);
        let is_cap = |normal: DVec3| hit.normal.as_dvec3().dot(normal) > 1.0 - 1e-5;
        let density = match (view.side, view.cap) {
            (_, Some((cap, normal))) if is_cap(normal) => (1.0 - side_probability) * cap.pdf(hit.direction),
            (Some((side, meridians)), _) => {
                let angle = side.polar_frame().azimuth(hit.direction);
                side_probability * meridians.pdf(angle)
                    / side.visible_polar_cosine_extent(SinCos::from_radians(angle.abs()))
            }
            (None, _) => 0.0,
        };
        density as f32
    }

    fn area_centroid(&self) -> DVec3 {
        self.middle
    }
}

impl<S: RevolutionSide> CappedRevolutionEmitter<S> {
    fn view_from(&self, point: Vec3) -> RevolutionView<S::View> {
        let side = self.side.view_from(point).map(|view| {
            let meridians = AzimuthDistribution::new(view.max_visible_angle(), |turn| {
                view.visible_polar_cosine_extent(turn)
            });
            (view, meridians)
        });
        let side = side.filter(|(_, meridians)| meridians.total() > 0.0);
        let caps = self.caps.iter().flatten().map(|cap| (cap.view_from(point), cap.normal()));
        let cap = caps.into_iter().find(|(cap, _)| cap.is_front_visible());
        let solid_angle = side.as_ref().map_or(0.0, |(_, meridians)| meridians.total());
        let of_cap = cap.as_ref().map_or(0.0, |(cap, _)| cap.solid_angle_bound());
        let side_probability = if side.is_none() { 0.0 } else { solid_angle / (solid_angle + of_cap) };
        RevolutionView { side, cap, side_probability }
    }
}

/// The curved side of a cylinder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CylinderSide {
    middle: DVec3,
    /// Unit vector along the cylinder.
    axis: DVec3,
    half_length: f64,
    radius: f64,
}

/// A cylinder seen from a point. The pole is parallel to the cylinder's axis. Angles around the pole are
/// directions from the point to the cross-section circle.
pub struct CylinderView {
    pole: PolarFrame,
    reach: SinCos,
    radius: f64,
    /// Distance from the axis.
    distance: f64,
    /// distance² − radius².
    power: f64,
    /// Heights of the ends relative to the point.
    ends: [f64; 2],
}

impl CappedRevolutionEmitter<CylinderSide> {
    /// Creates an emitter for an entire cylinder.
    pub fn from_entire_cylinder(cylinder: &Cylinder) -> Self {
        let caps = [1, 2].map(|number| cylinder.cap_disk(number));
        let across = caps[1].centroid() - caps[0].centroid();
        let side = CylinderSide {
            middle: cylinder.centroid(),
            axis: caps[1].normal(),
            half_length: across.length() * 0.5,
            radius: caps[0].radius(),
        };
        let caps = caps.map(|cap| cylinder.is_capped().then(|| DiskEmitter::new(&cap)));
        Self { side, caps, middle: cylinder.centroid() }
    }
}

impl RevolutionSide for CylinderSide {
    type View = CylinderView;

    fn view_from(&self, point: Vec3) -> Option<CylinderView> {
        let to_middle = self.middle - point.as_dvec3();
        let height = to_middle.dot(self.axis);
        let across = to_middle - self.axis * height;
        let distance = across.length();
        let power = (distance - self.radius) * (distance + self.radius);
        (power > 0.0).then(|| CylinderView {
            pole: PolarFrame::new(self.axis, across / distance),
            reach: SinCos { sin: self.radius / distance, cos: power.sqrt() / distance },
            radius: self.radius,
            distance,
            power,
            ends: [height - self.half_length, height + self.half_length],
        })
    }
}

impl CylinderView {
    /// Distance to the cross-section circle, computed without cancellation.
    fn distance_to_cross_section(&self, around: SinCos) -> f64 {
        let off = self.distance * around.sin;
        let half_chord = ((self.radius - off) * (self.radius + off)).max(0.0).sqrt();
        self.power / (self.distance * around.cos + half_chord)
    }

    fn end_cosines(&self, to_circle: f64) -> [f64; 2] {
        self.ends.map(|end| end / (to_circle * to_circle + end * end).sqrt())
    }
}

impl RevolutionSideView for CylinderView {
    fn polar_frame(&self) -> &PolarFrame {
        &self.pole
    }

    fn max_visible_angle(&self) -> SinCos {
        self.reach
    }

    fn visible_polar_cosine_extent(&self, around: SinCos) -> f64 {
        let [low, high] =
            self.end_cosines(self.distance_to_cross_section(SinCos { sin: around.sin.abs(), ..around }));
        high - low
    }

    fn polar_angle_and_distance_at_fraction(&self, around: SinCos, fraction: f64) -> (SinCos, f64) {
        let to_circle = self.distance_to_cross_section(SinCos { sin: around.sin.abs(), ..around });
        let [low, high] = self.end_cosines(to_circle);
        let cos = low + (high - low) * fraction;
        let height = to_circle * cos / ((1.0 - cos) * (1.0 + cos)).max(f64::MIN_POSITIVE).sqrt();
        let height = height.clamp(self.ends[0], self.ends[1]);
        let distance = (to_circle * to_circle + height * height).sqrt();
        (SinCos { sin: to_circle / distance, cos: height / distance }, distance)
    }
}

/// The curved side of a cone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConeSide {
    tip: DVec3,
    /// Unit vector from the tip to the base.
    axis: DVec3,
    /// Sine and cosine of the half angle at the tip.
    opening: (f64, f64),
    /// Distance from the tip to the rim of the base.
    slant: f64,
}

/// A cone seen from a point. The pole points to the tip. Each half plane intersects the side in one straight
/// line from the tip to the base.
pub struct ConeView {
    pole: PolarFrame,
    reach: SinCos,
    /// Distance from the point to the tip.
    distance: f64,
    /// Cosine and sine of the angle at the tip between the point and the axis.
    off_axis: (f64, f64),
    /// Cosine of the half angle at the tip.
    cos_opening: f64,
    slant: f64,
}

impl CappedRevolutionEmitter<ConeSide> {
    /// Creates an emitter for an entire cone.
    pub fn from_entire_cone(cone: &Cone) -> Self {
        let (base, tip) = (cone.base_disk(), cone.tip());
        let (height, radius) = ((base.centroid() - tip).length(), base.radius());
        let slant = (height * height + radius * radius).sqrt();
        let side = ConeSide { tip, axis: base.normal(), opening: (radius / slant, height / slant), slant };
        let cap = cone.is_capped().then(|| DiskEmitter::new(&base));
        Self { side, caps: [cap, None], middle: cone.centroid() }
    }
}

impl RevolutionSide for ConeSide {
    type View = ConeView;

    fn view_from(&self, point: Vec3) -> Option<ConeView> {
        let to_tip = self.tip - point.as_dvec3();
        let distance = to_tip.length();
        let pole = to_tip / distance;
        let cos = -pole.dot(self.axis);
        let across = self.axis + pole * cos;
        let sin = across.length();
        let (sin_opening, cos_opening) = self.opening;
        let is_around = cos <= -cos_opening;
        let reach = if is_around {
            SinCos { sin: 0.0, cos: -1.0 }
        } else {
            let cos_reach = ((cos_opening - cos) * (cos_opening + cos)).max(0.0).sqrt() / sin;
            SinCos { sin: (sin_opening / sin).min(1.0), cos: cos_reach }
        };
        let front = if sin > 0.0 { across / sin } else { perpendicular(pole) };
        (distance > 0.0 && cos < cos_opening).then(|| ConeView {
            pole: PolarFrame::new(pole, front),
            reach,
            distance,
            off_axis: (cos, sin),
            cos_opening,
            slant: self.slant,
        })
    }
}

impl ConeView {
    /// Angle at the tip between the direction to the point and the line where a half plane intersects the
    /// side.
    fn tip_angle_to_generatrix(&self, around: SinCos) -> SinCos {
        let ((m, sin), c) = (self.off_axis, self.cos_opening);
        let q = sin * around.cos;
        let square = m * m + q * q;
        let w = (square - c * c).max(0.0).sqrt();
        // Two lines are at this angle to the axis. Choose the nearer one.
        let sin = if m > 0.0 { (c - m) * (c + m) / (q * c + m * w) } else { (q * c - m * w) / square };
        SinCos { sin, cos: (m * c + q * w) / square }
    }
}

impl RevolutionSideView for ConeView {
    fn polar_frame(&self) -> &PolarFrame {
        &self.pole
    }

    fn max_visible_angle(&self) -> SinCos {
        self.reach
    }

    fn visible_polar_cosine_extent(&self, around: SinCos) -> f64 {
        let at_tip = self.tip_angle_to_generatrix(around);
        let (along, across) = (self.distance - self.slant * at_tip.cos, self.slant * at_tip.sin);
        let length = (along * along + across * across).sqrt();
        if along > 0.0 { across * across / (length * (length + along)) } else { 1.0 - along / length }
    }

    fn polar_angle_and_distance_at_fraction(&self, around: SinCos, fraction: f64) -> (SinCos, f64) {
        let at_tip = self.tip_angle_to_generatrix(around);
        let versine = fraction * self.visible_polar_cosine_extent(around);
        let from_pole = SinCos { sin: (versine * (2.0 - versine)).max(0.0).sqrt(), cos: 1.0 - versine };
        let sin = at_tip.sin * from_pole.cos + at_tip.cos * from_pole.sin;
        let farthest = self.distance + self.slant;
        let distance = self.distance * at_tip.sin / sin;
        (from_pole, if (distance > 0.0) & (distance < farthest) { distance } else { farthest })
    }
}
