//! Which glass a ray is in, and what that does to it.

use crate::materials::Glass;
use crate::math::Vec3;
use crate::world::World;

/// A glass that a ray is in: the parts of one object may be of several.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Inside {
    /// The object.
    pub object: u32,
    /// The material of the surface that the ray entered by.
    pub material: u32,
}

/// The glass around a ray, the innermost last. Glass nested deeper than the list is long forgets the outermost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Medium {
    inside: [Inside; 4],
    count: u8,
}

impl Medium {
    /// The innermost glass.
    pub fn innermost(&self) -> Option<Inside> {
        self.count.checked_sub(1).map(|last| self.inside[usize::from(last)])
    }

    /// After entering a glass.
    pub fn entered(mut self, glass: Inside) -> Self {
        if usize::from(self.count) == self.inside.len() {
            self.inside.rotate_left(1);
            self.count -= 1;
        }
        self.inside[usize::from(self.count)] = glass;
        self.count += 1;
        self
    }

    /// After leaving a glass; none where the ray was in none of that object, as far as it knows. A surface of several
    /// glasses may be entered by one and left by another: then the object's innermost is left.
    pub fn left(mut self, glass: Inside) -> Option<Self> {
        let known = &self.inside[..usize::from(self.count)];
        let same = known.iter().rposition(|&own| own == glass);
        let place = same.or_else(|| known.iter().rposition(|own| own.object == glass.object))?;
        self.inside[place..usize::from(self.count)].rotate_left(1);
        self.count -= 1;
        self.inside[usize::from(self.count)] = Inside::default();
        Some(self)
    }
}

/// What glass leaves of radiance along a ray to its hit at `distance`: the innermost glass that it is in, or, for a ray that
/// started inside without knowing, the glass whose back it hits.
pub fn absorption(world: &World, medium: Medium, back_of: Option<&Glass>, distance: f32) -> Vec3 {
    let glass = match medium.innermost() {
        Some(inside) => glass_of(world, inside),
        None => back_of,
    };
    glass.map_or(Vec3::ONE, |glass| glass.transmittance(distance))
}

/// Index of refraction of what a ray is in.
pub fn ior(world: &World, medium: Medium) -> f32 {
    medium.innermost().and_then(|inside| glass_of(world, inside)).map_or(1.0, |glass| glass.ior)
}

fn glass_of(world: &World, inside: Inside) -> Option<&Glass> {
    world.materials[inside.material as usize].bsdf.glass()
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn part(object: u32, material: u32) -> Inside {
        Inside { object, material }
    }

    #[test]
    fn nested_and_overlapping_glass() {
        let (seven, nine) = (part(7, 0), part(9, 1));
        let air = Medium::default();
        let in_both = air.entered(seven).entered(nine);
        assert_eq!(in_both.innermost(), Some(nine));
        assert_eq!(in_both.left(seven), Some(air.entered(nine)));
        assert_eq!(in_both.left(nine), Some(air.entered(seven)));
        assert_eq!(
            in_both.left(nine).and_then(|one| one.left(seven)).and_then(|none| none.innermost()),
            None
        );
        assert_eq!(air.left(part(3, 0)), None);
        let deep = (0..6).fold(air, |medium, object| medium.entered(part(object, 0)));
        assert_eq!(deep.innermost(), Some(part(5, 0)));
        assert_eq!(deep.left(part(0, 0)), None);
    }

    #[test]
    fn parts_of_one_object_are_told_apart_by_their_material() {
        let both = Medium::default().entered(part(1, 0)).entered(part(1, 5));
        assert_eq!(both.left(part(1, 0)), Some(Medium::default().entered(part(1, 5))));
        // Entered by material 0, left by material 2.
        assert_eq!(Medium::default().entered(part(1, 0)).left(part(1, 2)), Some(Medium::default()));
    }
}
