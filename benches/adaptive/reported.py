#!/usr/bin/env python3
"""Compares the reported error with the true error, for each scene, integrator and number of samples.

    python3 benches/adaptive/reported.py [SCENE...] [--seeds N] [--side PIXELS] [--samples N,N] [--integrators A,B] [--glimt BINARY]

Each scene is rendered with N seeds. The spread of these images is the true noise: the RMS over the pixels of the standard deviation of
their luminance, divided by its mean. Prints the RMS over the seeds of `image.error` relative to the true noise, with a 95 % bootstrap
interval over the seeds; then the same for the standard error of the mean luminance in the EXR files, relative to the spread of the means.
The last lines summarize: the median of all ratios, how many are outside 0.9 to 1.35 (and for how many of these the entire
interval is outside), and the pooled ratio of the mean's standard error. Defaults: all bundled scenes, both integrators, 16, 64 and 256 samples,
40 seeds, 64 × 64 pixels. Runs in the environment of ../mitsuba, which is created if it does not exist.
"""

import argparse
import json
import os
import statistics
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

from truth import ROOT, WEIGHTS, within_environment

BAND = (0.9, 1.35)
RESAMPLES = 400
MEAN_ERROR = b"glimtMeanLuminanceError\0double\0"


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", type=Path)
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--side", type=int, default=64)
    parser.add_argument("--samples", default="16,64,256")
    parser.add_argument("--integrators", default="whitted,path")
    parser.add_argument("--glimt", default=str(ROOT / "target" / "release" / "glimt"))
    return parser.parse_args()


def mean_error(picture):
    """The standard error of the mean luminance from an EXR file; None for images with photons."""
    head = picture.read_bytes()[:4096]
    at = head.find(MEAN_ERROR)
    return None if at < 0 else struct.unpack("<d", head[at + len(MEAN_ERROR) + 4 :][:8])[0]


def rendered(args, scene, integrator, samples, folder):
    """Luminance for each seed, and the values from reports and files."""
    import mitsuba as mi
    import numpy as np

    mi.set_variant("scalar_rgb")
    picture, report = folder / "picture.exr", folder / "report.json"
    call = [args.glimt, scene, "--once", "--progress", "none", "--width", args.side, "--height", args.side, "--error", 0]
    call += ["--integrator", integrator, "--samples", samples, "-o", picture, "--report", report]
    luminance, reported_errors, of_means = [], [], []
    for seed in range(1, args.seeds + 1):
        subprocess.run([str(word) for word in [*call, "--seed", seed]], check=True, stderr=subprocess.DEVNULL)
        image = np.array(mi.Bitmap(str(picture)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False))
        luminance.append(image.astype(np.float64) @ np.array(WEIGHTS))
        reported_errors.append(json.loads(report.read_text())["image"]["error"])
        of_means.append(mean_error(picture))
    return np.array(luminance), np.array(reported_errors), of_means


def row(args, scene, integrator, samples, folder):
    """Prints a row; returns its ratio, its interval and the squared ratio of the mean's error, or None if there is no noise."""
    import numpy as np

    luminance, reported_errors, of_means = rendered(args, scene, integrator, samples, folder)
    # Sums of squares per seed, for the bootstrap.
    means = luminance.mean(axis=(1, 2))

    def ratio(seeds):
        true = np.sqrt(luminance[seeds].var(axis=0, ddof=1).mean()) / means[seeds].mean()
        return np.sqrt((reported_errors[seeds] ** 2).mean()) / true if true > 0 else float("nan")

    all_seeds = np.arange(len(reported_errors))
    found = ratio(all_seeds)
    if not np.isfinite(found):
        print(f"{scene.stem:16}{integrator:9}{samples:5}  no noise", flush=True)
        return None
    random = np.random.default_rng(1)

    def drawn():
        # Draw half of the seeds without replacement, as repeated seeds would bias the variance. The spread of the ratio is the same.
        return ratio(random.choice(all_seeds, size=len(all_seeds) // 2, replace=False))

    low, high = np.quantile([drawn() for _ in range(RESAMPLES)], [0.025, 0.975])
    square = None
    if None not in of_means:
        # The variance of n normal means divided by their spread is 1/(1 − 2/(n − 1)) times too large on average.
        square = np.mean(np.square(of_means)) / means.var(ddof=1) * (1 - 2 / (len(means) - 1))
    of_mean = "" if square is None else f"{np.sqrt(square):9.2f}"
    print(f"{scene.stem:16}{integrator:9}{samples:5}{found:8.2f}  {low:5.2f} to {high:5.2f}{of_mean}", flush=True)
    return found, low, high, square


def main():
    args = arguments()
    print(f"{args.seeds} seeds, {args.side} × {args.side} pixels")
    print(f"{'':30}{'ratio':>8}{'95 % interval':>16}{'mean':>7}")
    rows = []
    for scene in args.scenes or sorted((ROOT / "scenes").glob("*.toml")):
        for integrator in args.integrators.split(","):
            for samples in map(int, args.samples.split(",")):
                with tempfile.TemporaryDirectory() as folder:
                    rows.append(row(args, scene, integrator, samples, Path(folder)))
    rows = [one for one in rows if one]
    outside = [one for one in rows if not BAND[0] <= one[0] <= BAND[1]]
    surely = [one for one in outside if one[2] < BAND[0] or one[1] > BAND[1]]
    print(f"median {statistics.median(one[0] for one in rows):.2f}, {len(outside)} of {len(rows)} outside of {BAND[0]} to {BAND[1]}, {len(surely)} significantly")
    squares = [one[3] for one in rows if one[3] is not None]
    print(f"standard error of the mean luminance, pooled: {statistics.fmean(squares) ** 0.5:.2f}")


if __name__ == "__main__":
    if "GLIMT_TRUTH" not in os.environ:
        within_environment(__file__)
    sys.exit(main())
