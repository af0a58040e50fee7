#!/usr/bin/env python3
"""Compares the processor time of two glimt binaries on the same scenes, with interleaved runs and each scene's own settings.

    python3 benches/pairs.py BEFORE AFTER SCENE... [--pairs N] [--layers] [-- OPTION...]

For each scene, prints the median processor seconds of both processes, the median ratio of the pairs, the ratio of the minima, and
whether the images have the same pixels. Ends with the geometric mean of the median ratios. Slow scenes get fewer pairs, but at least
three. Options after `--` are passed to both binaries. With `--layers`, both write EXR files, AFTER with all layers; BEFORE and AFTER may
be the same binary.
"""

import argparse
import math
import os
import resource
import statistics
import subprocess
import sys
import tempfile

# Seconds per binary and scene after which no more pairs are started.
BUDGET_SECONDS = 12


def seconds(binary, scene, picture, options):
    """Processor seconds of one render."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    depth = [] if picture.endswith(".exr") else ["--bit-depth", "16"]
    command = [binary, scene, "--once", "--progress", "none", *depth, "-o", picture, *options]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{binary} {scene}: {done.stderr}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def content(picture):
    """The bytes of a PPM except its comments, which name the program."""
    with open(picture, "rb") as file:
        return [line for line in file if not line.startswith(b"#")]


def main():
    arguments, options = sys.argv[1:], []
    if "--" in arguments:
        cut = arguments.index("--")
        arguments, options = arguments[:cut], arguments[cut + 1 :]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("before")
    parser.add_argument("after")
    parser.add_argument("scenes", nargs="+", metavar="SCENE")
    parser.add_argument("--pairs", type=int, default=9, metavar="N", help="maximum number of pairs per scene")
    parser.add_argument("--layers", action="store_true", help="write EXR files, AFTER with all layers")
    args = parser.parse_args(arguments)
    binaries, ratios = (args.before, args.after), []
    with tempfile.TemporaryDirectory() as folder:
        names = ("before.exr", "after.exr") if args.layers else ("before.ppm", "after.ppm")
        pictures = [os.path.join(folder, name) for name in names]
        both = (options, [*options, "--layers", "all"]) if args.layers else (options, options)
        for scene in args.scenes:
            first = seconds(binaries[0], scene, pictures[0], both[0])
            count = max(3, min(args.pairs, int(BUDGET_SECONDS / max(first, 1e-3))))
            times = ([], [])
            for number in range(count):
                for which in (0, 1) if number % 2 == 0 else (1, 0):
                    times[which].append(seconds(binaries[which], scene, pictures[which], both[which]))
            ratio = statistics.median(after / before for before, after in zip(*times))
            ratios.append(ratio)
            same = ""
            if not args.layers:
                same = ", same pixels" if content(pictures[0]) == content(pictures[1]) else ", different pixels"
            medians = [statistics.median(of) for of in times]
            print(
                f"{os.path.basename(scene):22} {medians[0]:8.3f} {medians[1]:8.3f}  ratio {ratio:.3f}"
                f"  of the minima {min(times[1]) / min(times[0]):.3f}  {count} pairs{same}",
                flush=True,
            )
    print(f"geometric mean {math.exp(statistics.fmean(map(math.log, ratios))):.4f}")


main()
