"""Prints the table of crates/kernel/src/materials/elements.rs: eta and k of metals for linear red, green and blue.

Each component is the mean of the measured spectrum, weighted by the matching function of that primary of sRGB (from the colour matching
functions of CIE 1931 in the form of Wyman, Sloan and Shirley, Simple Analytic Approximations to the CIE XYZ Color Matching
Functions, JCGT 2(2), 2013). Rows are wavelength in nm, n, k.

Sources: Johnson and Christy, Optical constants of the noble metals, Phys. Rev. B 6, 1972 (gold, silver, copper); Johnson and
Christy, Optical constants of transition metals, Phys. Rev. B 9, 1974 (iron, chromium, titanium); Rakic, Algorithm for the
determination of intrinsic optical constants of metal films, Appl. Opt. 34, 1995 (aluminium); as refractiveindex.info has them.
"""

import math

NOBLE = [381.5, 397.4, 413.3, 430.5, 450.9, 471.4, 495.9, 520.9, 548.6, 582.1, 616.8, 659.5, 704.5, 756.0, 821.1]
OTHER = [381, 397, 413, 431, 451, 471, 496, 521, 549, 582, 617, 659, 704, 756, 821]
RAKIC = [364.66, 413.28, 442.8, 476.87, 516.6, 563.57, 619.93, 652.25, 688.81, 729.32, 774.91, 815.69]

METALS = {
    "gold": (NOBLE,
             [1.46, 1.47, 1.46, 1.45, 1.38, 1.31, 1.04, 0.62, 0.43, 0.29, 0.21, 0.14, 0.13, 0.14, 0.16],
             [1.933, 1.952, 1.958, 1.948, 1.914, 1.849, 1.833, 2.081, 2.455, 2.863, 3.272, 3.697, 4.103, 4.542, 5.083]),
    "silver": (NOBLE,
               [0.05, 0.05, 0.05, 0.04, 0.04, 0.05, 0.05, 0.05, 0.06, 0.05, 0.06, 0.05, 0.04, 0.03, 0.04],
               [1.864, 2.070, 2.275, 2.462, 2.657, 2.869, 3.093, 3.324, 3.586, 3.858, 4.152, 4.483, 4.838, 5.242, 5.727]),
    "copper": (NOBLE,
               [1.33, 1.32, 1.28, 1.25, 1.24, 1.25, 1.22, 1.18, 1.02, 0.70, 0.30, 0.22, 0.21, 0.24, 0.26],
               [2.045, 2.116, 2.207, 2.305, 2.397, 2.483, 2.564, 2.608, 2.577, 2.704, 3.205, 3.747, 4.205, 4.665, 5.180]),
    "aluminium": (RAKIC,
                  [0.39877, 0.52135, 0.6079, 0.7278, 0.8734, 1.0728, 1.3660, 1.5724, 1.8301, 2.1606, 2.6154, 2.7668],
                  [4.3957, 5.0008, 5.3676, 5.7781, 6.2418, 6.7839, 7.4052, 7.7354, 8.0601, 8.3565, 8.4914, 8.2573]),
    "iron": (OTHER,
             [2.12, 2.24, 2.35, 2.48, 2.59, 2.67, 2.74, 2.86, 2.95, 2.94, 2.88, 2.92, 2.86, 2.87, 2.94],
             [2.50, 2.58, 2.65, 2.71, 2.77, 2.82, 2.88, 2.91, 2.93, 2.99, 3.05, 3.10, 3.19, 3.28, 3.39]),
    "chromium": (OTHER,
                 [1.92, 2.00, 2.08, 2.19, 2.33, 2.51, 2.75, 2.94, 3.18, 3.22, 3.17, 3.09, 3.05, 3.08, 3.20],
                 [2.74, 2.83, 2.93, 3.04, 3.14, 3.24, 3.30, 3.33, 3.33, 3.30, 3.30, 3.34, 3.39, 3.42, 3.48]),
    "titanium": (OTHER,
                 [1.99, 2.08, 2.14, 2.21, 2.27, 2.32, 2.36, 2.44, 2.54, 2.60, 2.67, 2.76, 2.86, 3.00, 3.21],
                 [2.93, 2.95, 2.98, 3.01, 3.04, 3.10, 3.19, 3.30, 3.43, 3.58, 3.72, 3.84, 3.96, 4.01, 4.01]),
}


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
    raise ValueError(x)


def main():
    wavelengths = range(382, 781)
    weights = [matching(x) for x in wavelengths]
    for name, (xs, *spectra) in METALS.items():
        means = []
        for spectrum in spectra:
            values = [at(xs, spectrum, x) for x in wavelengths]
            total = [sum(w[c] for w in weights) for c in range(3)]
            mean = [sum(w[c] * v for w, v in zip(weights, values)) / total[c] for c in range(3)]
            means.append(", ".join(f"{m:.3f}" for m in mean))
        print(f"{name}: eta [{means[0]}], k [{means[1]}]")
        pairs = zip(*([float(m) for m in one.split(",")] for one in means))
        print("   reflects", [round(((n - 1) ** 2 + k * k) / ((n + 1) ** 2 + k * k), 3) for n, k in pairs])


main()
