//! The list of nested glass solids around a ray, which determines the medium.

use crate::materials::Dielectric;
use crate::math::Vec3;
use crate::world::{MAX_INTERIORS, World};

/// A glass solid around a ray. Parts of a solid may have different materials.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Interior {
    /// Index of the solid, in file order.
    pub body: u32,
    /// Material of the surface through which the ray entered.
    pub material: u32,
}

/// The glass solids around a ray, in file order. The last solid has priority and determines the medium. If
/// the list is full, the first solids are dropped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct InteriorList {
    inside: [Interior; MAX_INTERIORS],
    /// Number of recorded solids. This is a whole word because the processor stalls if a word is copied soon
    /// after one of its bytes was written.
    count: u32,
}

impl InteriorList {
    fn solids(&self) -> &[Interior] {
        &self.inside[..self.count as usize]
    }

    /// Whether the ray is in air.
    pub fn is_air(&self) -> bool {
        self.count == 0
    }

    /// The glass that determines the medium.
    pub fn medium_glass(&self) -> Option<Interior> {
        self.solids().last().copied()
    }

    /// Returns the list after entering a solid.
    pub fn entered(mut self, glass: Interior) -> Self {
        if self.count as usize == self.inside.len() {
            if glass < self.inside[0] {
                return self;
            }
            self.inside.rotate_left(1);
            self.count -= 1;
        }
        let mut place = self.count as usize;
        while place > 0 && self.inside[place - 1] > glass {
            self.inside[place] = self.inside[place - 1];
            place -= 1;
        }
        self.inside[place] = glass;
        self.count += 1;
        self
    }

    /// Returns the list after leaving a solid, or `None` if the ray was not recorded as inside it. A surface
    /// made of several types of glass may be entered through one type and left through another. In that case,
    /// the solid's last entry is removed.
    pub fn exited(self, glass: Interior) -> Option<Self> {
        let same = self.solids().iter().rposition(|&own| own == glass);
        same.or_else(|| self.solids().iter().rposition(|own| own.body == glass.body))
            .map(|place| self.without_index(place))
    }

    fn without_index(mut self, place: usize) -> Self {
        self.inside[place..self.count as usize].rotate_left(1);
        self.count -= 1;
        self.inside[self.count as usize] = Interior::default();
        self
    }

    /// Keeps only the solids for which `holds` returns true.
    pub fn filter_solids(self, holds: impl Fn(Interior) -> bool) -> Self {
        let mut left = Self::default();
        for &glass in self.solids() {
            if holds(glass) {
                left.inside[left.count as usize] = glass;
                left.count += 1;
            }
        }
        left
    }
}

/// Interior lists of vertices, by index. Index 0 is air.
#[derive(Debug, Default)]
pub struct InteriorListPool {
    /// Lists with glass, starting at index 1.
    inside: Vec<InteriorList>,
}

impl InteriorListPool {
    /// Removes all lists.
    pub fn clear(&mut self) {
        self.inside.clear();
    }

    /// Whether all lists are empty.
    pub fn are_all_air(&self) -> bool {
        self.inside.is_empty()
    }

    /// Stores a list and returns its index.
    pub fn push_list(&mut self, interiors: &InteriorList) -> u32 {
        if interiors.is_air() {
            return 0;
        }
        self.inside.push(*interiors);
        self.inside.len() as u32
    }

    /// Returns the list with this index.
    #[inline]
    pub fn get(&self, number: u32) -> InteriorList {
        (number as usize).checked_sub(1).map_or(InteriorList::default(), |index| self.inside[index])
    }
}

/// Transmittance of a ray's medium over a distance.
#[inline]
pub fn medium_transmittance(world: &World, interiors: &InteriorList, distance: f32) -> Vec3 {
    let glass = interiors.medium_glass().and_then(|inside| dielectric_of_interior(world, inside));
    glass.map_or(Vec3::ONE, |glass| glass.interior_transmittance(distance))
}

/// Index of refraction of a ray's medium.
pub fn medium_ior(world: &World, interiors: &InteriorList) -> f32 {
    interiors
        .medium_glass()
        .and_then(|inside| dielectric_of_interior(world, inside))
        .map_or(1.0, |glass| glass.ior)
}

fn dielectric_of_interior(world: &World, inside: Interior) -> Option<&Dielectric> {
    world.materials[inside.material as usize].bsdf.as_dielectric()
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn part(body: u32, material: u32) -> Interior {
        Interior { body, material }
    }

    #[test]
    fn last_solid_has_priority() {
        let (seven, nine) = (part(7, 0), part(9, 1));
        let air = InteriorList::default();
        for in_both in [air.entered(seven).entered(nine), air.entered(nine).entered(seven)] {
            assert_eq!(in_both.medium_glass(), Some(nine));
            assert_eq!(in_both.exited(seven), Some(air.entered(nine)));
            assert_eq!(in_both.exited(nine), Some(air.entered(seven)));
            assert_eq!(in_both.exited(nine).and_then(|one| one.exited(seven)), Some(air));
        }
        assert_eq!(air.exited(part(3, 0)), None);
        for deep in [
            (0..6).fold(air, |interiors, object| interiors.entered(part(object, 0))),
            (0..6).rev().fold(air, |interiors, object| interiors.entered(part(object, 0))),
        ] {
            assert_eq!(deep.medium_glass(), Some(part(5, 0)));
            assert_eq!(deep.exited(part(0, 0)), None);
            assert_eq!(
                deep.exited(part(5, 0)).and_then(|interiors| interiors.medium_glass()),
                Some(part(4, 0))
            );
        }
    }

    #[test]
    fn parts_of_a_solid_may_differ_in_material() {
        let both = InteriorList::default().entered(part(1, 0)).entered(part(1, 5));
        assert_eq!(both.exited(part(1, 0)), Some(InteriorList::default().entered(part(1, 5))));
        // Enter through material 0, leave through material 2.
        assert_eq!(
            InteriorList::default().entered(part(1, 0)).exited(part(1, 2)),
            Some(InteriorList::default())
        );
        // Enter one solid twice.
        let twice = InteriorList::default().entered(part(1, 0)).entered(part(1, 0));
        assert_eq!(twice.exited(part(1, 0)), Some(InteriorList::default().entered(part(1, 0))));
    }

    #[test]
    fn retained_keeps_order() {
        let both = InteriorList::default().entered(part(3, 0)).entered(part(1, 5)).entered(part(2, 0));
        let odd = InteriorList::default().entered(part(1, 5)).entered(part(3, 0));
        assert_eq!(both.filter_solids(|glass| glass.body != 2), odd);
        assert_eq!(both.filter_solids(|_| false), InteriorList::default());
    }
}
