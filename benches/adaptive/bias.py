#!/usr/bin/env python3
"""Compares the mean of adaptively sampled images with the mean of uniformly sampled ones.

    python3 benches/adaptive/bias.py [SCENE...] [--error E | --time-share P] [--seeds N] [--side PIXELS] [--glimt BINARY]

Renders N images with different seeds that stop at `error = E`, or after the fraction P of the time that 256 samples take. Their mean
luminance is compared with that of a quarter as many uniformly sampled images, with enough samples to be equally precise. Prints the
difference of the means in percent, its standard error, and their ratio. Defaults: cornell and cornell_glass, E = 0.05, 200 seeds,
48 pixels along the longer side. Runs in the environment of ../mitsuba, which is created if it does not exist.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from truth import MAX_SAMPLES, ROOT, WEIGHTS, size_of, within_environment


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", type=Path)
    parser.add_argument("--error", type=float, default=0.05)
    parser.add_argument("--time-share", type=float)
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--side", type=int, default=48)
    parser.add_argument("--glimt", default=str(ROOT / "target" / "release" / "glimt"))
    return parser.parse_args()


def mean_of(args, scene, folder, seed, options):
    """The mean luminance of an image, its mean number of samples, and the seconds of its render stage."""
    import mitsuba as mi
    import numpy as np

    mi.set_variant("scalar_rgb")
    picture, report = folder / "picture.exr", folder / "report.json"
    call = [args.glimt, scene, "--once", "--progress", "none", *size_of(scene, args.side), "-o", picture]
    call += ["--report", report, "--seed", seed, *options]
    subprocess.run([str(word) for word in call], check=True, stderr=subprocess.DEVNULL)
    image = np.array(mi.Bitmap(str(picture)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False))
    data = json.loads(report.read_text())
    seconds = sum(stage["seconds"] for stage in data["stages"] if stage["name"] == "render")
    return float((image.astype(np.float64) @ np.array(WEIGHTS)).mean()), data["image"]["samples"]["mean"], seconds


def row(args, scene, folder):
    if args.time_share is None:
        options = ["--error", args.error, "--samples", MAX_SAMPLES]
    else:
        seconds = mean_of(args, scene, folder, 1, ["--error", 0, "--samples", 256])[2]
        options = ["--error", 0, "--samples", MAX_SAMPLES, "--time", max(0.001, args.time_share * seconds)]
    runs = [mean_of(args, scene, folder, seed, options) for seed in range(1, args.seeds + 1)]
    samples = max(run[1] for run in runs)
    equal = ["--error", 0, "--samples", 8 * int(samples)]
    references = [mean_of(args, scene, folder, 100_000 + seed, equal) for seed in range(max(2, args.seeds // 4))]
    means, others = [run[0] for run in runs], [run[0] for run in references]
    of_other = statistics.fmean(others)
    apart = statistics.fmean(means) / of_other - 1
    error = (statistics.variance(means) / len(means) + statistics.variance(others) / len(others)) ** 0.5 / of_other
    mean_samples = statistics.fmean(run[1] for run in runs)
    print(f"{scene.stem:18}{mean_samples:9.1f}{100 * apart:+10.4f}{100 * error:10.4f}{apart / error:8.2f}", flush=True)


def main():
    args = arguments()
    how = f"error = {args.error}" if args.time_share is None else f"--time, {args.time_share} of 256 samples"
    print(f"{how}, {args.side} pixels, {args.seeds} seeds")
    print(f"{'':18}{'samples':>9}{'bias %':>10}{'± %':>10}{'ratio':>8}")
    for scene in args.scenes or [ROOT / "scenes" / name for name in ("cornell.toml", "cornell_glass.toml")]:
        with tempfile.TemporaryDirectory() as folder:
            row(args, scene, Path(folder))


if __name__ == "__main__":
    if "GLIMT_TRUTH" not in os.environ:
        within_environment(__file__)
    sys.exit(main())
