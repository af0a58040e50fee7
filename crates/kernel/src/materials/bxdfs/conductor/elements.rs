//! Complex indices of refraction of metals for linear red, green, and blue.
//!
//! The values are measured spectra weighted by the color matching functions of the sRGB primaries.
//! `assets/metals.py` contains the spectra and generates this table. Gold, silver, copper: Johnson and
//! Christy, *Optical constants of the noble metals*, Phys. Rev. B 6, 1972. Iron, chromium, titanium: Johnson
//! and Christy, *Optical constants of transition metals*, Phys. Rev. B 9, 1974. Aluminum: Rakić, *Algorithm
//! for the determination of intrinsic optical constants of metal films*, Appl. Opt. 34, 1995.

use crate::choice;
use crate::math::Vec3;

choice! {
    /// A metal whose index of refraction is built in.
    pub enum MetalElement {
        /// Au.
        Gold = "gold",
        /// Ag.
        Silver = "silver",
        /// Cu.
        Copper = "copper",
        /// Al.
        Aluminium = "aluminium",
        /// Fe.
        Iron = "iron",
        /// Cr.
        Chromium = "chromium",
        /// Ti.
        Titanium = "titanium",
    }
}

impl MetalElement {
    /// Real and imaginary parts of the index of refraction.
    pub fn complex_ior(self) -> [Vec3; 2] {
        let [eta, k] = match self {
            Self::Gold => [[0.108, 0.488, 1.478], [3.508, 2.338, 1.809]],
            Self::Silver => [[0.055, 0.055, 0.043], [4.293, 3.543, 2.535]],
            Self::Copper => [[0.237, 1.037, 1.298], [3.244, 2.601, 2.353]],
            Self::Aluminium => [[1.441, 0.989, 0.585], [7.558, 6.566, 5.306]],
            Self::Iron => [[2.917, 2.921, 2.532], [3.065, 2.939, 2.742]],
            Self::Chromium => [[3.224, 3.117, 2.256], [3.291, 3.339, 3.113]],
            Self::Titanium => [[2.716, 2.511, 2.227], [3.791, 3.403, 3.000]],
        };
        [eta, k].map(Vec3::from_array)
    }
}
