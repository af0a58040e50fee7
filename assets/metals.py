"""Prints crates/kernel/src/materials/bxdfs/conductor/elements.rs: eta and k of conductors for linear red, green and blue.

Each component is the mean of a measured spectrum, weighted by the matching function of that primary of sRGB (from the color matching
functions of CIE 1931 in the form of Wyman, Sloan and Shirley, Simple Analytic Approximations to the CIE XYZ Color Matching
Functions, JCGT 2(2), 2013). metals.csv contains the spectra: name, wavelength in nm, n, k. Beyond the first and the last row of a
conductor, the values stay constant.

Sources of the conductors with English names, as refractiveindex.info has them: Johnson and Christy, Optical constants of the noble
metals, Phys. Rev. B 6, 1972 (gold, silver, copper); Johnson and Christy, Optical constants of transition metals, Phys. Rev. B 9,
1974 (iron, chromium, titanium); Rakic, Algorithm for the determination of intrinsic optical constants of metal films, Appl. Opt.
34, 1995 (aluminium).

The conductors with chemical symbols are those that pbrt-v4 and Mitsuba 3 name. Their figures are from the files data/ior/NAME.eta.spd
and NAME.k.spd of the Python package mitsuba 3 (Na, Ni and V: NAME_palik), which come from the database of luxpop.com; pbrt-v4 has the
same figures for Ag, Al, Au, Cu, MgO and TiO2. CuZn is from pbrt-v4's src/pbrt/util/spectrum.cpp. The headers of the files state the
measurement, which CONDUCTORS repeats. Rows without n (AlAs, 394 to 435 nm) are omitted. SnTe has no k.
"""

import csv
import math
import sys
from pathlib import Path

PALIK_1 = "Palik 1985"
PALIK_2 = "Palik 1991"
# The volume is not stated.
PALIK = "Palik"

# Name, variant, substance, source of the visible part.
CONDUCTORS = [
    ("gold", "Gold", "Au", "Johnson and Christy 1972"),
    ("silver", "Silver", "Ag", "Johnson and Christy 1972"),
    ("copper", "Copper", "Cu", "Johnson and Christy 1972"),
    ("aluminium", "Aluminium", "Al", "Rakić 1995"),
    ("iron", "Iron", "Fe", "Johnson and Christy 1974"),
    ("chromium", "Chromium", "Cr", "Johnson and Christy 1974"),
    ("titanium", "Titanium", "Ti", "Johnson and Christy 1974"),
    ("a-C", "AmorphousCarbon", "Amorphous carbon", PALIK),
    ("Ag", "Ag", "Silver", "luxpop.com"),
    ("Al", "Al", "Aluminum", "luxpop.com"),
    ("AlAs", "AlAs", "Aluminum arsenide", PALIK_2),
    ("AlSb", "AlSb", "Aluminum antimonide", PALIK_2),
    ("Au", "Au", "Gold", "luxpop.com"),
    ("Be", "Be", "Beryllium", PALIK),
    ("Cr", "Cr", "Chromium", PALIK),
    ("CsI", "CsI", "Cesium iodide", PALIK_2),
    ("Cu", "Cu", "Copper", "luxpop.com"),
    ("Cu2O", "Cu2O", "Copper(I) oxide", PALIK_2),
    ("CuO", "CuO", "Copper(II) oxide", PALIK_2),
    ("CuZn", "CuZn", "Brass", "pbrt-v4"),
    ("d-C", "Diamond", "Diamond", PALIK_1),
    ("Hg", "Hg", "Mercury", PALIK_2),
    ("HgTe", "HgTe", "Mercury telluride", PALIK_2),
    ("Ir", "Ir", "Iridium", PALIK_1),
    ("K", "K", "Potassium", PALIK_2),
    ("Li", "Li", "Lithium", PALIK_2),
    ("MgO", "MgO", "Magnesium oxide", PALIK_2),
    ("Mo", "Mo", "Molybdenum", PALIK_1),
    ("Na", "Na", "Sodium", PALIK_2),
    ("Nb", "Nb", "Niobium", PALIK_2),
    ("Ni", "Ni", "Nickel", PALIK_1),
    ("Rh", "Rh", "Rhodium", PALIK_1),
    ("Se", "Se", "Selenium, ordinary ray", PALIK_2),
    ("SiC", "SiC", "Silicon carbide", PALIK_2),
    ("SnTe", "SnTe", "Tin telluride", PALIK_2),
    ("Ta", "Ta", "Tantalum", PALIK_2),
    ("Te", "Te", "Tellurium, ordinary ray", PALIK_2),
    ("ThF4", "ThF4", "Thorium fluoride", PALIK_2),
    ("TiC", "TiC", "Titanium carbide", PALIK_2),
    ("TiN", "TiN", "Titanium nitride", PALIK_2),
    ("TiO2", "TiO2", "Rutile, ordinary ray", PALIK_1),
    ("V", "V", "Vanadium", PALIK_2),
    ("VC", "VC", "Vanadium carbide", PALIK_2),
    ("VN", "VN", "Vanadium nitride", PALIK_2),
    ("W", "W", "Tungsten", PALIK),
]

HEAD = '''//! Complex indices of refraction of conductors for linear red, green, and blue.
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
'''

MIDDLE = '''    }
}

impl NamedConductor {
    /// Real and imaginary parts of the index of refraction.
    pub fn complex_ior(self) -> [Vec3; 2] {
        let [eta, k] = match self {
'''

TAIL = '''        };
        [eta, k].map(Vec3::from_array)
    }
}
'''


def bell(x, middle, left, right):
    return math.exp(-0.5 * ((x - middle) / (left if x < middle else right)) ** 2)


def matching(x):
    """Matching functions of linear red, green and blue at a wavelength in nm."""
    big_x = 1.056 * bell(x, 599.8, 37.9, 31.0) + 0.362 * bell(x, 442.0, 16.0, 26.7) - 0.065 * bell(x, 501.1, 20.4, 26.2)
    big_y = 0.821 * bell(x, 568.8, 46.9, 40.5) + 0.286 * bell(x, 530.9, 16.3, 31.1)
    big_z = 1.217 * bell(x, 437.0, 11.8, 36.0) + 0.681 * bell(x, 459.0, 26.0, 13.8)
    rows = [(3.2406, -1.5372, -0.4986), (-0.9689, 1.8758, 0.0415), (0.0557, -0.2040, 1.0570)]
    return [a * big_x + b * big_y + c * big_z for a, b, c in rows]


def at(xs, ys, x):
    for (x0, y0), (x1, y1) in zip(zip(xs, ys), zip(xs[1:], ys[1:])):
        if x0 <= x <= x1:
            return y0 + (y1 - y0) * (x - x0) / (x1 - x0)
    return ys[0] if x < xs[0] else ys[-1]


def spectra():
    """Wavelengths, n and k of each conductor."""
    found = {}
    for row in csv.DictReader(open(Path(__file__).parent / "metals.csv")):
        for column, key in zip(found.setdefault(row["name"], ([], [], [])), ["nm", "n", "k"]):
            column.append(float(row[key]))
    return found


def main():
    wavelengths = range(382, 781)
    weights = [matching(x) for x in wavelengths]
    total = [sum(w[c] for w in weights) for c in range(3)]
    known = spectra()
    print(HEAD, end="")
    for name, variant, substance, source in CONDUCTORS:
        print(f"        /// {substance}: {source}.\n        {variant} = \"{name}\",")
    print(MIDDLE, end="")
    for name, variant, _, _ in CONDUCTORS:
        xs, *parts = known[name]
        means = []
        for spectrum in parts:
            values = [at(xs, spectrum, x) for x in wavelengths]
            mean = [sum(w[c] * v for w, v in zip(weights, values)) / total[c] for c in range(3)]
            means.append([max(m, 0.0) for m in mean])
        texts = ", ".join("[" + ", ".join(f"{m:.3f}" for m in mean) + "]" for mean in means)
        print(f"            Self::{variant} => [{texts}],")
        reflected = [round(((n - 1) ** 2 + k * k) / ((n + 1) ** 2 + k * k), 3) for n, k in zip(*means)]
        print(f"{name} reflects {reflected}", file=sys.stderr)
    print(TAIL, end="")


main()
