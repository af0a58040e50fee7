//! Techniques that find the light of lamps beside light samples, and the MIS weights of light samples against them (multiple
//! importance sampling: Veach, *Robust Monte Carlo Methods for Light Transport Simulation*, 1997, section 9.2).

use super::lit_row::LitRow;
use crate::lights::LightRow;
use crate::materials::Lobes;
use crate::materials::lobes::gloss;
use crate::math::Vec3;
use crate::math::lanes::{LANES, Lanes, Lanes3, lane, set_lane};

/// Technique that competes with light samples.
#[derive(Clone, Copy)]
pub(super) enum Others {
    /// No other technique.
    Nothing,
    /// The rays of paths that go on from the vertices.
    Paths,
    /// Rays in the glossy lobes of the vertices whose bits are set.
    Lobes(u32),
}

impl Others {
    /// The technique of rays in glossy lobes, if the bits of any vertices are set.
    pub(super) fn lobes(sharp: u32) -> Self {
        if sharp == 0 { Self::Nothing } else { Self::Lobes(sharp) }
    }

    /// Whether these are rays in glossy lobes.
    pub(super) fn are_lobes(self) -> bool {
        match self {
            Self::Nothing | Self::Paths => false,
            Self::Lobes(_) => true,
        }
    }

    /// Number of rays by the BSDF for each of so many samples of a light.
    #[inline(always)]
    pub(super) fn to_each(self, count: u32) -> f32 {
        match self {
            Self::Nothing => 0.0,
            Self::Paths => 1.0 / count as f32,
            Self::Lobes(_) => 1.0,
        }
    }

    /// Multiplies `values`, the contributions of light samples at the vertices of a row, by their power-heuristic weights. The
    /// inverse pdfs of the samples are given; `others` rays by the BSDF come on each sample.
    #[inline(always)]
    pub(super) fn left(
        self,
        row: &LitRow,
        samples: &LightRow,
        mut values: Lanes3,
        (of_light, others): (&Lanes, f32),
    ) -> Lanes3 {
        if let Self::Nothing = self {
            return values;
        }
        let mut glosses = [0.0; LANES];
        if row.is_glossy {
            for i in 0..LANES {
                let mirrored = lane(&row.mirrored_eye, i);
                glosses[i] = gloss(mirrored, lane(&samples.directions, i), row.shininess[i]);
            }
        }
        for i in 0..LANES {
            let density = self.lobes_of(row, i).density(lane(&samples.directions, i), glosses[i]);
            let weight = weight(density * of_light[i] * others);
            let weight = if self.start_from(i) { weight } else { 1.0 };
            let left = match self {
                Self::Nothing | Self::Paths => Vec3::splat(weight),
                Self::Lobes(_) => left_of_gloss(row, i, glosses[i], weight),
            };
            let value = lane(&values, i) * left;
            set_lane(&mut values, i, value);
        }
        values
    }

    /// The lobes in which rays leave a vertex.
    #[inline(always)]
    fn lobes_of(self, row: &LitRow, i: usize) -> Lobes {
        match self {
            Self::Nothing | Self::Paths => row.lobes(i),
            Self::Lobes(_) => glossy_lobe(row, i),
        }
    }

    /// Whether rays leave a vertex.
    #[inline(always)]
    fn start_from(self, i: usize) -> bool {
        match self {
            Self::Nothing => false,
            Self::Paths => true,
            Self::Lobes(sharp) => sharp & 1 << i != 0,
        }
    }
}

/// The glossy lobe of a vertex alone.
#[inline(always)]
pub(super) fn glossy_lobe(row: &LitRow, i: usize) -> Lobes {
    Lobes { diffuse: 0.0, specular: 1.0, ..row.lobes(i) }
}

/// Reflected light with its glossy part weighted. The weight applies to that part alone, as rays in a lobe bring no diffuse
/// light. Thereby the parts of a picture add up to it.
#[inline(always)]
fn left_of_gloss(row: &LitRow, i: usize, gloss: f32, weight: f32) -> Vec3 {
    let (diffuse, glossy) = (lane(&row.diffuse, i), lane(&row.specular, i) * gloss);
    let part = |diffuse: f32, glossy: f32| {
        let all = diffuse + glossy;
        if all > 0.0 { (diffuse + glossy * weight) / all } else { 0.0 }
    };
    Vec3::new(part(diffuse.x, glossy.x), part(diffuse.y, glossy.y), part(diffuse.z, glossy.z))
}

/// MIS weight of a sample, if the other technique's pdf is so many times as high (the power heuristic).
#[inline(always)]
pub fn weight(ratio: f32) -> f32 {
    1.0 / (1.0 + ratio * ratio)
}
