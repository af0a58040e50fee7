#!/usr/bin/env python3
"""Compares the mean colors of image regions in glimt and Mitsuba 3: differences in percent, with standard errors.

    python benches/materials/means.py BINARY [SCENE...] [--samples N] [--pictures N] [--side PIXELS]

Runs in an environment with mitsuba and numpy; the variant is llvm_ad_rgb if DRJIT_LIBLLVM_PATH is set, otherwise scalar_rgb. An image
is divided into 4 x 3 regions; the errors come from several images per program with different seeds.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb" if "DRJIT_LIBLLVM_PATH" in os.environ else "scalar_rgb")
HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "rooms"))
from convert import Conversion  # noqa: E402

REGIONS = (3, 4)


def regions(picture):
    """Mean colors of the regions, row by row."""
    rows = np.array_split(picture, REGIONS[0], axis=0)
    return np.array([part.mean(axis=(0, 1)) for row in rows for part in np.array_split(row, REGIONS[1], axis=1)])


def render_with_mitsuba(file, content, size, options, made):
    scene = mi.load_dict(Conversion(mi, content, file.parent, size, made).scene())
    for seed in range(options.pictures):
        yield np.array(mi.render(scene, spp=options.samples, seed=seed))


def render_with_glimt(file, size, options, made):
    out = made / "picture.exr"
    call = [options.binary, file, "--once", "-o", out, "--progress", "none", "--integrator", options.integrator]
    call += ["--width", size[0], "--height", size[1], "--samples", options.samples]
    for seed in range(options.pictures):
        subprocess.run([str(word) for word in [*call, "--seed", seed]], check=True)
        yield np.array(mi.Bitmap(str(out)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False))


def compare(file, options, made):
    content = tomllib.loads(file.read_text())
    width, height = content["render"]["width"], content["render"]["height"]
    scale = min(1, options.side / max(width, height))
    size = (round(width * scale), round(height * scale))
    ways = [render_with_glimt(file, size, options, made), render_with_mitsuba(file, content, size, options, made)]
    (own, own_error), (other, other_error) = (mean_and_error([regions(one) for one in way]) for way in ways)
    off, error = own / other - 1, np.hypot(own_error, other_error) / other
    print(f"{file.stem}: worst region {np.abs(off).max():.3%}, root mean square {np.sqrt((off**2).mean()):.3%}, ± {error.max():.3%}")
    for number, (one, noise) in enumerate(zip(off, error)):
        text = "  ".join(f"{100 * x:+7.3f} ± {100 * y:.3f} %" for x, y in zip(one, noise))
        print(f"  {number // REGIONS[1] + 1},{number % REGIONS[1] + 1}  {text}")


def mean_and_error(values):
    return np.mean(values, axis=0), np.std(values, axis=0, ddof=1) / np.sqrt(len(values))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("binary")
    parser.add_argument("scenes", nargs="*")
    parser.add_argument("--samples", type=int, default=256)
    parser.add_argument("--pictures", type=int, default=8)
    parser.add_argument("--side", type=int, default=160)
    parser.add_argument("--integrator", default="path")
    options = parser.parse_args()
    files = [Path(one) for one in options.scenes] or sorted(HERE.glob("*.toml"))
    with tempfile.TemporaryDirectory() as made:
        for file in files:
            compare(file, options, Path(made))


if __name__ == "__main__":
    main()
