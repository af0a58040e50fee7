#!/usr/bin/env python3
"""Explains why rough plastic differs from Mitsuba 3: the diffuse term of `roughplastic` (nonlinear) and two formulas, in f64.

    python benches/materials/plastic.py

Runs in an environment with mitsuba and numpy. E and T are the coat's reflectance and transmittance (single scattering, integrated over
half vectors), and R is its reflectance from inside:

- glimt:   (1 - E(i))(1 - E(o)) kd / (pi eta^2 (1 - kd F)) with F = 1 - (1 - mean E)/eta^2, so that white reflects all light;
- Mitsuba: T(i) T(o) kd / (pi eta^2 (1 - kd R)), which loses light that the coat scatters twice. Its R comes from a table; the last
column solves for R in Mitsuba's red channel, and checks it with green and blue.
"""

import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")
ETA, DIFFUSE = 1.5, np.array([0.7, 0.1, 0.05])
PLACES, WEIGHTS = np.polynomial.legendre.leggauss(40)
COSINES, WEIGHTS = 0.5 * (PLACES + 1), 0.5 * WEIGHTS


def fresnel(cosine, eta):
    squared = eta * eta - 1 + cosine * cosine
    root = np.sqrt(np.maximum(squared, 0))
    parallel = (eta * eta * cosine - root) / (eta * eta * cosine + root)
    perpendicular = (cosine - root) / (cosine + root)
    return np.where(squared > 0, 0.5 * (parallel**2 + perpendicular**2), 1.0)


def albedos(cosine, alpha, eta, rings=1200, steps=96):
    """Reflection and transmission of a microfacet boundary."""
    y, turn = np.meshgrid((np.arange(rings) + 0.5) / rings, (np.arange(steps) + 0.5) / steps * 2 * np.pi, indexing="ij")
    slope = alpha * np.sqrt(1 / (1 - y) ** 2 - 1)
    half = np.stack([slope * np.cos(turn), slope * np.sin(turn), np.ones_like(turn)])
    half /= np.linalg.norm(half, axis=0)
    eye = np.array([np.sqrt(1 - cosine**2), 0, cosine])[:, None, None]
    between = (half * eye).sum(axis=0)
    masking = lambda z: 0.5 * (np.sqrt(1 + alpha**2 * (1 - z * z) / (z * z)) - 1)
    by_facet = lambda z: 2 * (1 - y) / y.size * between / (cosine * half[2]) / (1 + masking(cosine) + masking(z))
    squared = eta * eta - 1 + between * between
    mirrored = 2 * between * half[2] - cosine
    refracted = (half[2] * (np.sqrt(np.maximum(squared, 0)) - between) + cosine) / eta
    reflects, passes = (between > 0) & (mirrored > 0), (between > 0) & (squared > 0) & (refracted > 0)
    part = fresnel(np.maximum(between, 1e-9), eta)
    reflected = np.where(reflects, part * by_facet(np.where(reflects, mirrored, 1)), 0).sum()
    return reflected, np.where(passes, (1 - part) * by_facet(np.where(passes, refracted, 1)), 0).sum()


def mean(values):
    return 2 * (values * COSINES * WEIGHTS).sum()


def by_mitsuba(alpha, diffuse):
    reflectance = {"type": "rgb", "value": list(diffuse)}
    coat = {"type": "roughplastic", "distribution": "ggx", "alpha": alpha, "int_ior": ETA, "ext_ior": 1.0}
    bsdf = mi.load_dict({**coat, "nonlinear": True, "diffuse_reflectance": reflectance})

    def value(eye, light):
        interaction = mi.SurfaceInteraction3f()
        interaction.wi, interaction.t = mi.Vector3f(*eye), 1
        return np.array(bsdf.eval(mi.BSDFContext(), interaction, mi.Vector3f(*light))) / light[2]

    return value


def direction(cosine, turn):
    sine = np.sqrt(1 - cosine**2)
    return np.array([sine * np.cos(turn), sine * np.sin(turn), cosine])


def main():
    for alpha in (0.02, 0.1):
        outside = np.array([albedos(cosine, alpha, ETA) for cosine in COSINES])
        returned = 1 - (1 - mean(outside[:, 0])) / ETA**2
        within = mean(np.array([albedos(cosine, alpha, 1 / ETA) for cosine in COSINES])[:, 0])
        print(f"alpha {alpha}: F of glimt {returned:.4f}, R by quadrature {within:.4f}")
        red, black = by_mitsuba(alpha, DIFFUSE), by_mitsuba(alpha, [0, 0, 0])
        for eye, light in ((0.9, 0.6), (0.5, 0.9), (0.3, 0.4), (0.98, 0.98)):
            ways = direction(eye, 0), direction(light, 2)
            found = red(*ways) - black(*ways)
            (e_eye, t_eye), (e_light, t_light) = (albedos(cosine, alpha, ETA) for cosine in (eye, light))
            shape = DIFFUSE / (np.pi * ETA**2)
            glimt = (1 - e_eye) * (1 - e_light) * shape / (1 - DIFFUSE * returned)
            mitsuba = t_eye * t_light * shape / (1 - DIFFUSE * within)
            solved = (1 - t_eye * t_light * shape / found) / DIFFUSE
            again = t_eye * t_light * shape / (1 - DIFFUSE * solved[0])
            percent = lambda ratio: " ".join(f"{100 * x:+6.2f}" for x in ratio - 1)
            print(f"  {eye}, {light}: glimt {percent(glimt / found)} %, T T and R {percent(mitsuba / found)} %, "
                  f"with its R of {solved[0]:.4f} {percent(again / found)} %")


if __name__ == "__main__":
    main()
