//! Complex indices of refraction of conductors for linear red, green, and blue.
//!
//! The values are measured spectra weighted by the color matching functions of the sRGB primaries.
//! `assets/metals.py` generates this file from the spectra in `assets/metals.csv`. Conductors with English names:
//! Johnson and Christy, *Optical constants of the noble metals*, Phys. Rev. B 6, 1972, and *Optical constants of
//! transition metals*, Phys. Rev. B 9, 1974; Rakić, *Algorithm for the determination of intrinsic optical
//! constants of metal films*, Appl. Opt. 34, 1995. Conductors with chemical symbols have the figures that pbrt-v4
//! and Mitsuba 3 use, most of them from Palik, *Handbook of Optical Constants of Solids*, 1985, and its second
//! volume, 1991.

use crate::choice;
use crate::math::Vec3;

choice! {
    /// A metal or compound whose index of refraction is built in.
    pub enum NamedConductor {
        /// Au: Johnson and Christy 1972.
        Gold = "gold",
        /// Ag: Johnson and Christy 1972.
        Silver = "silver",
        /// Cu: Johnson and Christy 1972.
        Copper = "copper",
        /// Al: Rakić 1995.
        Aluminium = "aluminium",
        /// Fe: Johnson and Christy 1974.
        Iron = "iron",
        /// Cr: Johnson and Christy 1974.
        Chromium = "chromium",
        /// Ti: Johnson and Christy 1974.
        Titanium = "titanium",
        /// Amorphous carbon: Palik.
        AmorphousCarbon = "a-C",
        /// Silver: luxpop.com.
        Ag = "Ag",
        /// Aluminum: luxpop.com.
        Al = "Al",
        /// Aluminum arsenide: Palik 1991.
        AlAs = "AlAs",
        /// Aluminum antimonide: Palik 1991.
        AlSb = "AlSb",
        /// Gold: luxpop.com.
        Au = "Au",
        /// Beryllium: Palik.
        Be = "Be",
        /// Chromium: Palik.
        Cr = "Cr",
        /// Cesium iodide: Palik 1991.
        CsI = "CsI",
        /// Copper: luxpop.com.
        Cu = "Cu",
        /// Copper(I) oxide: Palik 1991.
        Cu2O = "Cu2O",
        /// Copper(II) oxide: Palik 1991.
        CuO = "CuO",
        /// Brass: pbrt-v4.
        CuZn = "CuZn",
        /// Diamond: Palik 1985.
        Diamond = "d-C",
        /// Mercury: Palik 1991.
        Hg = "Hg",
        /// Mercury telluride: Palik 1991.
        HgTe = "HgTe",
        /// Iridium: Palik 1985.
        Ir = "Ir",
        /// Potassium: Palik 1991.
        K = "K",
        /// Lithium: Palik 1991.
        Li = "Li",
        /// Magnesium oxide: Palik 1991.
        MgO = "MgO",
        /// Molybdenum: Palik 1985.
        Mo = "Mo",
        /// Sodium: Palik 1991.
        Na = "Na",
        /// Niobium: Palik 1991.
        Nb = "Nb",
        /// Nickel: Palik 1985.
        Ni = "Ni",
        /// Rhodium: Palik 1985.
        Rh = "Rh",
        /// Selenium, ordinary ray: Palik 1991.
        Se = "Se",
        /// Silicon carbide: Palik 1991.
        SiC = "SiC",
        /// Tin telluride: Palik 1991.
        SnTe = "SnTe",
        /// Tantalum: Palik 1991.
        Ta = "Ta",
        /// Tellurium, ordinary ray: Palik 1991.
        Te = "Te",
        /// Thorium fluoride: Palik 1991.
        ThF4 = "ThF4",
        /// Titanium carbide: Palik 1991.
        TiC = "TiC",
        /// Titanium nitride: Palik 1991.
        TiN = "TiN",
        /// Rutile, ordinary ray: Palik 1985.
        TiO2 = "TiO2",
        /// Vanadium: Palik 1991.
        V = "V",
        /// Vanadium carbide: Palik 1991.
        VC = "VC",
        /// Vanadium nitride: Palik 1991.
        VN = "VN",
        /// Tungsten: Palik.
        W = "W",
    }
}

impl NamedConductor {
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
            Self::AmorphousCarbon => [[2.443, 2.349, 2.165], [0.737, 0.842, 0.897]],
            Self::Ag => [[0.129, 0.123, 0.152], [3.998, 3.299, 2.361]],
            Self::Al => [[1.369, 0.933, 0.573], [7.643, 6.621, 5.319]],
            Self::AlAs => [[3.128, 3.251, 3.678], [0.001, 0.000, 0.012]],
            Self::AlSb => [[3.919, 4.279, 5.043], [0.000, 0.097, 1.429]],
            Self::Au => [[0.122, 0.392, 1.587], [3.296, 2.523, 1.762]],
            Self::Be => [[3.473, 3.360, 3.062], [3.183, 3.175, 3.155]],
            Self::Cr => [[3.620, 3.081, 1.820], [4.321, 4.462, 4.131]],
            Self::CsI => [[1.780, 1.795, 1.828], [0.000, 0.000, 0.000]],
            Self::Cu => [[0.170, 0.971, 1.213], [3.236, 2.594, 2.356]],
            Self::Cu2O => [[2.950, 3.110, 3.027], [0.096, 0.203, 0.666]],
            Self::CuO => [[2.693, 2.583, 2.431], [0.435, 0.600, 0.794]],
            Self::CuZn => [[0.433, 0.514, 1.146], [3.584, 2.695, 1.750]],
            Self::Diamond => [[2.412, 2.423, 2.450], [0.000, 0.000, 0.000]],
            Self::Hg => [[1.985, 1.523, 1.000], [5.244, 4.616, 3.763]],
            Self::HgTe => [[3.964, 3.410, 2.926], [1.361, 1.663, 1.903]],
            Self::Ir => [[2.559, 2.198, 1.779], [4.637, 4.293, 3.593]],
            Self::K => [[0.053, 0.049, 0.042], [1.742, 1.425, 1.004]],
            Self::Li => [[0.220, 0.206, 0.243], [2.932, 2.442, 1.835]],
            Self::MgO => [[1.734, 1.741, 1.754], [0.000, 0.000, 0.000]],
            Self::Mo => [[3.719, 3.719, 3.053], [3.411, 3.608, 3.465]],
            Self::Na => [[0.050, 0.059, 0.068], [2.633, 2.231, 1.737]],
            Self::Nb => [[2.841, 2.941, 2.635], [2.855, 2.887, 2.838]],
            Self::Ni => [[1.962, 1.756, 1.613], [3.728, 3.221, 2.579]],
            Self::Rh => [[2.143, 1.963, 1.710], [5.621, 4.965, 4.373]],
            Self::Se => [[3.393, 2.996, 3.102], [0.632, 0.671, 0.573]],
            Self::SiC => [[2.633, 2.664, 2.727], [0.000, 0.000, 0.000]],
            Self::SnTe => [[3.746, 2.098, 1.409], [0.000, 0.000, 0.000]],
            Self::Ta => [[1.720, 2.518, 2.891], [1.992, 1.840, 2.141]],
            Self::Te => [[6.126, 4.735, 2.900], [2.716, 3.711, 3.622]],
            Self::ThF4 => [[1.519, 1.521, 1.526], [0.000, 0.000, 0.000]],
            Self::TiC => [[3.069, 2.994, 2.840], [2.708, 2.481, 2.389]],
            Self::TiN => [[1.367, 1.214, 1.517], [2.788, 2.055, 1.211]],
            Self::TiO2 => [[2.870, 2.954, 3.195], [0.000, 0.000, 0.001]],
            Self::V => [[3.551, 3.705, 3.037], [2.897, 3.047, 3.422]],
            Self::VC => [[3.034, 2.904, 2.785], [2.544, 2.320, 2.159]],
            Self::VN => [[2.376, 2.236, 2.134], [2.513, 2.171, 1.777]],
            Self::W => [[3.625, 3.482, 3.297], [2.904, 2.748, 2.500]],
        };
        [eta, k].map(Vec3::from_array)
    }
}
