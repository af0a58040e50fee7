"""See run.py, which starts this in its environment.

`caustic` and `box` are rendered with 1, 2, 4, … samples and several seeds: relMSE, its slope, seconds of the stages photons and render.
In the caustic scene, the pixels that show the balls are excluded. Mitsuba's path tracer renders the same scene with 256 samples; its
error is inversely proportional to the samples. `large` is the caustic scene at 1074 x 1051 with 30 bounces and all of its pixels.

References are two independent images a, b with a small photon radius, rendered once: the expectation of (x - a)(x - b) is the squared
error, regardless of their noise. The mean is compared with path tracing, which is unbiased.
"""

import argparse
import json
import math
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path.insert(0, str(HERE.parent / "mitsuba"))

import drjit as dr  # noqa: E402
import mitsuba as mi  # noqa: E402
import numpy as np  # noqa: E402

mi.set_variant("llvm_ad_rgb")
from scenes import BLOCKS, BOX, CAUSTIC, DEPTH, Scene  # noqa: E402

HOME = Path(os.environ["GLIMT_MITSUBA_HOME"])
THREADS = 2
PHOTONS = "\n[photons]\nenabled = true\n"
GOAL = 1e-2


class Subject:
    """A scene, its references, and the pixels to compare."""

    def __init__(self, glimt, scene, size, reference_samples, masked, settings=()):
        self.glimt, self.scene, self.size, self.settings = glimt, scene, size, list(settings)
        self.folder = HOME / "photons" / f"{scene.name.replace(' ', '-')}-{size[0]}"
        self.folder.mkdir(parents=True, exist_ok=True)
        fine = ["photons.radius=0.006"]
        self.pair = [self.kept(f"reference-{seed}", reference_samples, seed, fine) for seed in (1001, 1002)]
        self.mean = sum(self.pair) / 2
        self.used = np.ones(self.mean.shape[:2], dtype=bool)
        if masked:
            # Mirrors and glass have no albedo.
            self.used = self.render(1, 0, ["--view", "albedo"])[1].max(axis=2) > 0

    def render(self, samples, seed, options=(), sets=()):
        """Returns the seconds of the photons and render stages, and the image."""
        file, picture, report = (self.folder / name for name in ("scene.toml", "picture.exr", "report.json"))
        by_photons = "--integrator" not in options
        text = self.scene.toml(samples, seed, "").replace('integrator = "path"', 'integrator = "whitted"')
        file.write_text(text + PHOTONS)
        command = [self.glimt, file, "--once", "-o", picture, "--report", report, "--threads", THREADS, *options]
        command += ["--width", self.size[0], "--height", self.size[1]]
        for one in [*sets, *self.settings] if by_photons else self.settings:
            command += ["--set", one]
        subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        stages = json.loads(report.read_text())["stages"]
        image = np.array(mi.Bitmap(str(picture)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False))
        return sum(s["seconds"] for s in stages if s["name"] in ("photons", "render")), image.astype(np.float64)

    def kept(self, name, samples, seed, sets):
        """A cached image, which is rendered if it does not exist."""
        file = self.folder / f"{name}-{samples}.npy"
        if not file.exists():
            np.save(file, self.render(samples, seed, (), sets)[1])
        return np.load(file)

    def rel_mse(self, picture):
        """Mean squared error over r^2 + 0.01, without the noise of the references."""
        a, b = self.pair
        squares = (picture - a) * (picture - b) / (self.mean**2 + 0.01)
        return float(squares[self.used].mean())

    def brightness(self, picture):
        """The mean of the compared pixels."""
        return float(picture[self.used].mean())

    def row(self, by, samples, seconds, errors, means, before=None):
        """Prints a row; returns the error."""
        error = statistics.mean(errors)
        slope = f"{math.log(error / before[1]) / math.log(samples / before[0]):+.2f}" if before else ""
        spread = statistics.stdev(means) / math.sqrt(len(means)) if len(means) > 1 else float("nan")
        print(
            f"{self.scene.name:12}{by:10}{samples:6}{statistics.median(seconds):10.2f}{error:11.2e}{slope:>8}"
            f"{statistics.mean(means):11.5f} ± {spread:.5f}",
            flush=True,
        )
        return error

    def noted(self, by, samples, seed, options):
        """Renders and reports the result on stderr, since the last renders take minutes."""
        seconds, picture = self.render(samples, seed, options)
        of = f"{self.rel_mse(picture):.3e} {self.brightness(picture):.5f}"
        print(f"{self.scene.name} {by} {samples} seed {seed}: {seconds:.2f} {of}", file=sys.stderr, flush=True)
        return seconds, picture

    def rows(self, by, counts, seeds, options=()):
        """Prints rows with increasing samples."""
        errors = {}
        for samples in counts:
            runs = [self.noted(by, samples, seed, options) for seed in range(seeds)]
            before = next(((n, errors[n]) for n in reversed(errors)), None)
            seconds, pictures = zip(*runs)
            means = [self.brightness(picture) for picture in pictures]
            errors[samples] = self.row(by, samples, seconds, map(self.rel_mse, pictures), means, before)
        return errors


def mitsuba(subject, samples=256):
    """Prints a row for Mitsuba's path tracer, and the seconds that it needs to reach the goal."""
    scene = mi.load_dict(subject.scene.mitsuba(mi, Path("."), {}))
    seconds, errors, means = [], [], []
    for seed in range(4):
        start = time.perf_counter()
        image = mi.render(scene, spp=samples, seed=seed)
        dr.eval(image)
        dr.sync_thread()
        if seed > 0:  # the first render includes compilation
            seconds.append(time.perf_counter() - start)
            picture = np.array(image, dtype=np.float64)
            errors.append(subject.rel_mse(picture))
            means.append(subject.brightness(picture))
    error = subject.row("Mitsuba", samples, seconds, errors, means)
    print(f"{subject.scene.name:12}Mitsuba needs {statistics.median(seconds) * error / GOAL:.1f} s to reach {GOAL}", flush=True)


def last_slope(subject, errors):
    """Prints the slope of the error over the last decade of passes, or over fewer if there are fewer rows."""
    last = max(errors)
    first = min(errors, key=lambda passes: abs(math.log(10 * passes / last)))
    if first < last:
        slope = math.log(errors[last] / errors[first]) / math.log(last / first)
        print(f"{subject.scene.name:12}slope from {first} to {last} passes {slope:+.2f}", flush=True)


def powers(most):
    """The powers of two up to `most`."""
    return [1 << k for k in range(most.bit_length()) if 1 << k <= most]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("names", nargs="*", default=["caustic", "box", "large"])
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--most", type=int, default=64)
    parser.add_argument("--passes", type=lambda text: [int(word) for word in text.split(",")])
    parser.add_argument("--reference", type=int, default=512)
    parser.add_argument("--glimt", default=ROOT / "target" / "release" / "glimt")
    parser.add_argument("--side", type=int, default=256)
    args = parser.parse_args()
    passes = args.passes or powers(args.most)
    dr.set_thread_count(THREADS)
    print(f"{'':12}{'':10}{'passes':>6}{'seconds':>10}{'relMSE':>11}{'slope':>8}{'mean':>11}")
    square = (args.side, args.side)
    path_tracer = ["--integrator", "path"]
    if "caustic" in args.names:
        subject = Subject(args.glimt, CAUSTIC, square, args.reference, True)
        last_slope(subject, subject.rows("photons", passes, args.seeds))
        subject.rows("path", [256], 3, path_tracer)
        mitsuba(subject)
    if "box" in args.names:
        box = Scene(name="box", anchor=None, boxes=BLOCKS, max_depth=DEPTH, **BOX)
        subject = Subject(args.glimt, box, square, args.reference, False)
        last_slope(subject, subject.rows("photons", passes, args.seeds))
        subject.rows("path", [64, 256], args.seeds, path_tracer)
    if "large" in args.names:
        settings = ["render.max_depth=30", "photons.bounces=30"]
        subject = Subject(args.glimt, CAUSTIC, (1074, 1051), args.reference // 8, False, settings)
        subject.rows("photons", [8, 12, 16, 24], 1)


main()
