"""See run.py, which starts this in its environment.

Each round renders the scene with every program, interleaved, with two threads and a different seed for each image.

- seconds: processor time of one image. For glimt, it is the time of the process minus that of a run with one pixel and one sample, which
covers reading, acceleration structures and writing. For Mitsuba, it is only the render; a render before the first round compiles it.
- us/path: microseconds per sample of a pixel (a pass of photons counts as one).
- error of a round: the variance of luminance between its images, divided by the reference's square plus 0.01, averaged over the pixels.
  Photons have errors other than noise, so the mean square distance from the reference is used instead, also for Mitsuba's images; it
  includes the reference's own noise.
- ratio: seconds x error divided by Mitsuba's, for all rounds together, and the smallest and largest of the rounds.
- mean: the mean luminance of all images, and its difference from the reference's, with the standard error of the difference.
"""

import argparse
import math
import os
import statistics
import sys
from dataclasses import dataclass, field
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")
from convert import Unknown  # noqa: E402
from renderers import THREADS, Glimt, Mitsuba  # noqa: E402
from subjects import subject  # noqa: E402

HOME = Path(os.environ["GLIMT_MITSUBA_HOME"])
ROOT = Path(__file__).resolve().parent.parent.parent
HEADER = f"{'scene':14}{'by':24}{'samples':>8}{'seconds':>9}{'us/path':>9}{'error':>10}{'product':>10}  {'ratio':22}{'mean':>9}"


@dataclass
class Method:
    """A method: a program with an integrator, and its results for a scene."""

    name: str
    renderer: object
    samples: int
    is_mitsuba: bool = False
    by_reference: bool = False
    rounds: list = field(default_factory=list)  # for each round, a list of (seconds, luminance)

    def render(self, seeds):
        self.rounds.append([self.renderer.render(self.samples, seed) for seed in seeds])

    def seconds(self, number=None):
        """Seconds of one image: the median of a round, or of all rounds."""
        chosen = self.rounds if number is None else [self.rounds[number]]
        return statistics.median(seconds for one in chosen for seconds, _ in one)

    def error(self, reference, by_reference, number=None):
        """The mean of the rounds' errors, or the error of one round."""
        chosen = self.rounds if number is None else [self.rounds[number]]
        return statistics.mean(error([picture for _, picture in one], reference, by_reference) for one in chosen)

    def product(self, reference, by_reference, number=None):
        return self.seconds(number) * self.error(reference, by_reference, number)

    def means(self):
        return [float(picture.mean()) for one in self.rounds for _, picture in one]


def error(pictures, reference, by_reference):
    """Error of the images, from the reference, or from the variance between them."""
    if by_reference:
        squares = np.mean([(picture - reference) ** 2 for picture in pictures], axis=0)
    else:
        squares = np.var(pictures, axis=0, ddof=1)
    return float(np.mean(squares / (reference**2 + 0.01)))


def methods(scene, args):
    """Returns the methods for the scene: Mitsuba first, then each binary with each integrator."""
    found = [Method("Mitsuba path", Mitsuba(scene, args.samples), args.samples, is_mitsuba=True)]
    for binary in args.glimt:
        name = Path(binary).name
        path_tracer = Glimt(binary, scene, HOME / "out", ["--integrator", "path"])
        found.append(Method(f"{name} path", path_tracer, args.samples))
        if args.photons:
            by_photons = Glimt(binary, scene, HOME / "out", ["--integrator", "whitted", "--photons", "on"])
            found.append(Method(f"{name} photons", by_photons, args.passes, by_reference=True))
    return found


def row(scene, method, mitsuba):
    """Formats the row of results for one method."""
    reference, by_reference = scene.luminance, method.by_reference
    seconds, spread = method.seconds(), method.error(reference, by_reference)
    paths = scene.width * scene.height * method.samples
    figures = f"{method.samples:8}{seconds:9.3f}{1e6 * seconds / paths:9.3f}{spread:10.2e}{seconds * spread:10.2e}"
    ratio = ""
    if not method.is_mitsuba:
        of = lambda number=None: method.product(reference, by_reference, number) / mitsuba.product(reference, by_reference, number)
        each = [of(number) for number in range(len(method.rounds))]
        ratio = f"{of():.2f} ({min(each):.2f} to {max(each):.2f})"
    means = method.means()
    mean, whole = statistics.mean(means), float(reference.mean())
    apart, scatter = mean / whole - 1, statistics.stdev(means) / len(means) ** 0.5 / whole
    return f"{scene.name:14}{method.name:24}{figures}  {ratio:22}{mean:9.5f} {apart:+.2%} ± {scatter:.2%}"


def compare(scene, args):
    """Prints the rows of a scene."""
    every = methods(scene, args)
    for number in range(args.rounds):
        # Every image of a scene has its own seed.
        first = 1 + number * args.seeds
        for method in every:
            method.render(range(first, first + args.seeds))
        print(f"{scene.name}: round {number + 1} of {args.rounds}", file=sys.stderr, flush=True)
    for method in every:
        print(row(scene, method, every[0]), flush=True)
    print(f"{scene.name:14}{'reference':24}{'':8}{'':9}{'':9}{'':10}{'':10}  {'':22}{scene.luminance.mean():9.5f}", flush=True)


def at_least(least):
    def read(text):
        if int(text) < least:
            raise argparse.ArgumentTypeError(f"must be at least {least}")
        return int(text)

    return read


def square(text):
    """Mitsuba's sampler rounds the number of samples up unless they form a grid."""
    if math.isqrt(int(text)) ** 2 != int(text):
        raise argparse.ArgumentTypeError("must be a square number, such as 16, 64 or 256")
    return int(text)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+", type=Path, metavar="SCENE")
    parser.add_argument("--photons", action="store_true", help="also measure whitted with photons")
    parser.add_argument("--rounds", type=at_least(1), default=5)
    parser.add_argument("--seeds", type=at_least(2), default=2, help="images per round")
    parser.add_argument("--samples", type=square, default=64, help="samples per pixel for path tracing")
    parser.add_argument("--passes", type=at_least(1), default=64, help="photon passes")
    parser.add_argument("--side", type=at_least(1), default=256, help="pixels along the longer side, for scene files")
    parser.add_argument("--reference", type=at_least(1), default=8192, help="samples of the reference, for scene files")
    parser.add_argument("--glimt", action="append", help="glimt binary; may be repeated")
    args = parser.parse_args()
    args.glimt = args.glimt or [ROOT / "target" / "release" / "glimt"]
    dr.set_thread_count(THREADS)
    print(HEADER)
    for path in args.scenes:
        try:
            compare(subject(path, args, HOME), args)
        except Unknown as unknown:
            sys.exit(f"{path}: cannot convert {unknown}")


main()
