#!/usr/bin/env python3
"""Compares adaptive sampling with uniform sampling: time to reach the same relMSE.

    python3 benches/adaptive/run.py [SCENE...] [--samples N] [--error E] [--seeds N] [--side PIXELS] [--glimt BINARY]

Renders each scene with N samples everywhere, interleaved with adaptive renders of several fractions of that time (`--time`), and
interpolates the time that adaptive sampling needs for the same relMSE. With `--error E`, renders with that target error instead, and
searches for the number of uniform samples with the same relMSE. A reference with many samples is rendered first. Defaults: all bundled scenes, 256 samples,
3 seeds, 256 pixels along the longer side.
"""

import argparse
import json
import math
import statistics
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
REFERENCE_TIMES = 32
MAX_SAMPLES = 65536


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", type=Path)
    parser.add_argument("--samples", type=int, default=256)
    parser.add_argument("--error", type=float)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--side", type=int, default=256)
    parser.add_argument("--glimt", default=str(ROOT / "target" / "release" / "glimt"))
    return parser.parse_args()


class Render:
    """Renders one scene at one size and compares the images with a reference."""

    def __init__(self, glimt, scene, side, folder):
        with scene.open("rb") as file:
            own = tomllib.load(file).get("render", {})
        width, height = own.get("width", 640), own.get("height", 480)
        scale = side / max(width, height)
        size = [max(1, round(width * scale)), max(1, round(height * scale))]
        self.call = [glimt, str(scene), "--once", "--progress", "none", "--width", str(size[0]), "--height", str(size[1])]
        self.glimt = glimt
        self.folder = Path(folder)
        self.reference = self.folder / "reference.exr"

    def run(self, name, options):
        """Returns the seconds spent on sampling and the mean number of samples per pixel."""
        report = self.folder / "report.json"
        command = [*self.call, "-o", str(self.folder / name), "--report", str(report), *map(str, options)]
        subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
        data = json.loads(report.read_text())
        seconds = sum(stage["seconds"] for stage in data["stages"] if stage["name"] in ("render", "photons"))
        return seconds, data["image"]["samples"]["mean"]

    def error(self):
        command = [self.glimt, "compare", "--json", str(self.folder / "picture.exr"), str(self.reference)]
        return json.loads(subprocess.run(command, check=True, capture_output=True).stdout)["relmse"]

    def adaptive(self, error, seed):
        seconds, samples = self.run("picture.exr", ["--error", error, "--samples", MAX_SAMPLES, "--seed", seed])
        return seconds, samples, self.error()

    def fixed(self, samples, seed):
        seconds, _ = self.run("picture.exr", ["--error", 0, "--samples", samples, "--seed", seed])
        return seconds, self.error()


def log_between(x, low, high):
    """Interpolates y at x between two points, linearly in their logarithms."""
    (x0, y0), (x1, y1) = low, high
    if x0 == x1:
        return math.sqrt(y0 * y1)
    return y0 * (y1 / y0) ** (math.log(x / x0) / math.log(x1 / x0))


PARTS = [0.3, 0.45, 0.65, 0.9, 1.1]


def where_equal(fixed, runs):
    """Returns the time fraction and the samples at which adaptive `runs` reach the mean relMSE of the uniform renders."""
    goal = statistics.fmean(run[1] for run in fixed)
    points = [[statistics.fmean(run[1] for run in runs[part]), *(statistics.median(run[k] for run in runs[part]) for k in (0, 2))] for part in PARTS]
    above = [k for k in range(len(PARTS) - 1) if points[k + 1][0] < goal]
    k = above[0] if above else len(PARTS) - 2
    return [log_between(goal, (points[k][0], points[k][i]), (points[k + 1][0], points[k + 1][i])) for i in (1, 2)]


def in_time(render, samples, seeds):
    """Returns the seconds of adaptive and uniform sampling at equal relMSE, their ratio, the samples of both, the relMSE, and the jackknife
standard error of the ratio."""
    render.run("reference.exr", ["--error", 0, "--samples", REFERENCE_TIMES * samples, "--seed", 999])
    fixed, runs = [], {part: [] for part in PARTS}
    for seed in range(1, seeds + 1):
        fixed.append(render.fixed(samples, seed))
        for part in PARTS:
            budget = ["--time", max(0.001, part * fixed[-1][0]), "--samples", MAX_SAMPLES, "--seed", seed]
            seconds, mean = render.run("picture.exr", ["--error", 0, *budget])
            runs[part].append((seconds / fixed[-1][0], render.error(), mean))
    ratio, mean = where_equal(fixed, runs)
    others = []
    for k in range(seeds if seeds > 2 else 0):
        without = [row[:k] + row[k + 1 :] for row in (fixed, *runs.values())]
        others.append(where_equal(without[0], dict(zip(PARTS, without[1:])))[0])
    error = (seeds - 1) / math.sqrt(seeds) * statistics.stdev(others) if others else math.nan
    seconds = statistics.median(run[0] for run in fixed)
    goal = statistics.fmean(run[1] for run in fixed)
    return ratio * seconds, seconds, ratio, mean, samples, goal, error


def compared(render, error, seeds):
    """Returns the seconds of adaptive and uniform sampling at equal relMSE, their ratio, the samples of both, the relMSE, and the standard
error of the ratio."""
    _, samples = render.run("picture.exr", ["--error", error, "--samples", MAX_SAMPLES])
    render.run("reference.exr", ["--error", 0, "--samples", min(MAX_SAMPLES, max(1024, round(REFERENCE_TIMES * samples))), "--seed", 999])
    tried = {}

    def mean_of_fixed(count):
        if count not in tried:
            runs = [render.fixed(count, seed) for seed in range(1, seeds + 1)]
            tried[count] = [statistics.fmean(run[1] for run in runs), [run[0] for run in runs]]
        return tried[count]

    runs = [render.adaptive(error, seed) for seed in range(1, seeds + 1)]
    goal = statistics.fmean(run[2] for run in runs)
    count = max(1, round(samples))
    for _ in range(4):
        reached = mean_of_fixed(count)[0]
        if abs(reached / goal - 1) < 0.02:
            break
        count = max(1, round(count * reached / goal))
    low, high = max(1, math.floor(count * 0.8)), math.ceil(count * 1.25)
    mean_of_fixed(low), mean_of_fixed(high)
    # Interleave the runs, as the speed of the machine may change.
    ratios = []
    for seed in range(1, seeds + 1):
        own = render.adaptive(error, seed)[0]
        around = [(tried[n][0], render.fixed(n, seed)[0]) for n in (low, high)]
        ratios.append((own, log_between(goal, *around)))
    fixed_samples = log_between(goal, (tried[low][0], low), (tried[high][0], high))
    own, fixed = (statistics.median(column) for column in zip(*ratios))
    each = [one / other for one, other in ratios]
    error = statistics.stdev(each) / math.sqrt(seeds) if seeds > 1 else math.nan
    return own, fixed, statistics.median(each), statistics.fmean(run[1] for run in runs), fixed_samples, goal, error


def main():
    args = arguments()
    scenes = args.scenes or sorted((ROOT / "scenes").glob("*.toml"))
    print(f"{'--time' if args.error is None else f'error = {args.error}'}, {args.side} pixels, {args.seeds} seeds")
    print(f"{'':18} {'seconds':>9} {'samples':>9} {'fixed, s':>9} {'samples':>9} {'relMSE':>10} {'ratio':>7} {'±':>6}")
    for scene in scenes:
        with tempfile.TemporaryDirectory() as folder:
            render = Render(args.glimt, scene, args.side, folder)
            if args.error is None:
                figures = in_time(render, args.samples, args.seeds)
            else:
                figures = compared(render, args.error, args.seeds)
            own, fixed, ratio, samples, fixed_samples, goal, error = figures
        print(f"{scene.stem:18} {own:9.3f} {samples:9.1f} {fixed:9.3f} {fixed_samples:9.1f} {goal:10.2e} {ratio:7.3f} {error:6.3f}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
