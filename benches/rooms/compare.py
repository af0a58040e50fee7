"""See run.py, which starts this inside its environment.

Each round renders the scene by every program in turns, with two threads and a seed of its own for each picture.

- seconds: user and system time of one picture. glimt's is that of the process, less that of a call that renders one pixel by one
  path: what reading, trees and writing take. Mitsuba's is that of the render alone; a render before the first round compiles it.
- us/path: microseconds of these for each sample of a pixel (a pass of photons counts as one).
- error, of a round: the variance of luminance between its pictures, over the reference's square plus 0.01, the mean over pixels.
  Of photons, which are off by more than noise: the mean square distance to the reference in its place, of Mitsuba's pictures as
  well. That includes the reference's own noise.
- ratio: seconds x error over Mitsuba's, of all rounds together, and the least and the greatest of the rounds.
- mean: the mean luminance of all pictures, and how far it is from the reference's, with the standard error of that distance.
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
class Way:
    """One program's way to render a scene, and what it gave."""

    name: str
    renderer: object
    samples: int
    is_mitsuba: bool = False
    by_reference: bool = False
    rounds: list = field(default_factory=list)  # of lists of (seconds, luminance)

    def render(self, seeds):
        self.rounds.append([self.renderer.render(self.samples, seed) for seed in seeds])

    def seconds(self, number=None):
        """Of one picture; the median of a round's, or of all."""
        chosen = self.rounds if number is None else [self.rounds[number]]
        return statistics.median(seconds for one in chosen for seconds, _ in one)

    def error(self, reference, by_reference, number=None):
        """The mean of the rounds' errors, or that of one of them."""
        chosen = self.rounds if number is None else [self.rounds[number]]
        return statistics.mean(error([picture for _, picture in one], reference, by_reference) for one in chosen)

    def product(self, reference, by_reference, number=None):
        return self.seconds(number) * self.error(reference, by_reference, number)

    def means(self):
        return [float(picture.mean()) for one in self.rounds for _, picture in one]


def error(pictures, reference, by_reference):
    """By how far the pictures are from the reference, or from each other: half the mean square of a difference is the variance."""
    if by_reference:
        squares = np.mean([(picture - reference) ** 2 for picture in pictures], axis=0)
    else:
        squares = np.var(pictures, axis=0, ddof=1)
    return float(np.mean(squares / (reference**2 + 0.01)))


def ways(scene, asked):
    """Mitsuba first, then each binary by each integrator."""
    found = [Way("Mitsuba path", Mitsuba(scene, asked.samples), asked.samples, is_mitsuba=True)]
    for binary in asked.glimt:
        name = Path(binary).name
        by_paths = Glimt(binary, scene, HOME / "out", ["--integrator", "path"])
        found.append(Way(f"{name} path", by_paths, asked.samples))
        if asked.photons:
            by_photons = Glimt(binary, scene, HOME / "out", ["--integrator", "whitted", "--photons", "on"])
            found.append(Way(f"{name} photons", by_photons, asked.passes, by_reference=True))
    return found


def row(scene, way, mitsuba):
    """The line of a way."""
    reference, by_reference = scene.luminance, way.by_reference
    seconds, spread = way.seconds(), way.error(reference, by_reference)
    paths = scene.width * scene.height * way.samples
    figures = f"{way.samples:8}{seconds:9.3f}{1e6 * seconds / paths:9.3f}{spread:10.2e}{seconds * spread:10.2e}"
    ratio = ""
    if not way.is_mitsuba:
        of = lambda number=None: way.product(reference, by_reference, number) / mitsuba.product(reference, by_reference, number)
        each = [of(number) for number in range(len(way.rounds))]
        ratio = f"{of():.2f} ({min(each):.2f} to {max(each):.2f})"
    means = way.means()
    mean, whole = statistics.mean(means), float(reference.mean())
    apart, scatter = mean / whole - 1, statistics.stdev(means) / len(means) ** 0.5 / whole
    return f"{scene.name:14}{way.name:24}{figures}  {ratio:22}{mean:9.5f} {apart:+.2%} ± {scatter:.2%}"


def compare(scene, asked):
    """Print the rows of a scene."""
    every = ways(scene, asked)
    for number in range(asked.rounds):
        # No two pictures of a scene have a seed in common.
        first = 1 + number * asked.seeds
        for way in every:
            way.render(range(first, first + asked.seeds))
        print(f"{scene.name}: round {number + 1} of {asked.rounds}", file=sys.stderr, flush=True)
    for way in every:
        print(row(scene, way, every[0]), flush=True)
    print(f"{scene.name:14}{'reference':24}{'':8}{'':9}{'':9}{'':10}{'':10}  {'':22}{scene.luminance.mean():9.5f}", flush=True)


def at_least(least):
    def read(text):
        if int(text) < least:
            raise argparse.ArgumentTypeError(f"at least {least}")
        return int(text)

    return read


def square(text):
    """Mitsuba's sampler takes more samples than it is told to where they make no grid."""
    if math.isqrt(int(text)) ** 2 != int(text):
        raise argparse.ArgumentTypeError("a square, such as 16, 64, 256")
    return int(text)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+", type=Path, metavar="SCENE")
    parser.add_argument("--photons", action="store_true", help="whitted with photons as well")
    parser.add_argument("--rounds", type=at_least(1), default=5)
    parser.add_argument("--seeds", type=at_least(2), default=2, help="pictures of each way in a round")
    parser.add_argument("--samples", type=square, default=64, help="of paths")
    parser.add_argument("--passes", type=at_least(1), default=64, help="of photons")
    parser.add_argument("--side", type=at_least(1), default=256, help="pixels of the longer side, of a scene file")
    parser.add_argument("--reference", type=at_least(1), default=8192, help="samples of a scene file's reference")
    parser.add_argument("--glimt", action="append", help="the program; may be given several times")
    asked = parser.parse_args()
    asked.glimt = asked.glimt or [ROOT / "target" / "release" / "glimt"]
    dr.set_thread_count(THREADS)
    print(HEADER)
    for path in asked.scenes:
        try:
            compare(subject(path, asked, HOME), asked)
        except Unknown as unknown:
            sys.exit(f"{path}: Mitsuba is not told of {unknown}")


main()
