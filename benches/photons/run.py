#!/usr/bin/env python3
"""Photons beside paths: error against samples and seconds, of glimt alone.

    python3 benches/photons/run.py [NAME...] [--seeds N] [--most SAMPLES] [--glimt BINARY]

Renders each scene by photons and by `path` with 4, 16, 64, … samples, and prints seconds of rendering and relMSE, the slope of
the error between the last two, and the mean of the picture over that of the reference. The reference is by paths with --reference
samples over 8 seeds, or by photons of a --radius so small that it shows nothing; it is kept under target/photons. Pixels that see mirror or glass balls are left out where the scene says so.
"""

import argparse
import json
import math
import os
import statistics
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
HOME = ROOT / "target" / "photons"
SIDE = int(os.environ.get("SIDE", "256"))
# Scene, settings, and whether pixels that see its mirrors and glass are left out.
SCENES = {
    "caustic": ("scenes/photons.toml", ["render.max_depth=8", "photons.count=100000"], True),
    "box": ("scenes/cornell.toml", ["render.max_depth=8", "photons.count=20000"], False),
}


def picture(path):
    """Pixels of a .hdr file, as triples."""
    data = path.read_bytes()
    end = data.index(b"\n\n") + 2
    line = data.index(b"\n", end)
    height, width = (int(word) for word in data[end:line].split()[1::2])
    at, pixels = line + 1, []
    for _ in range(height):
        if data[at] == 2 and data[at + 1] == 2 and width >= 8:
            at += 4
            rows = []
            for _ in range(4):
                row = bytearray()
                while len(row) < width:
                    count = data[at]
                    if count > 128:
                        row += bytes([data[at + 1]]) * (count - 128)
                        at += 2
                    else:
                        row += data[at + 1 : at + 1 + count]
                        at += 1 + count
                rows.append(row)
            texels = zip(*rows)
        else:
            flat = data[at : at + 4 * width]
            at += 4 * width
            texels = zip(flat[::4], flat[1::4], flat[2::4], flat[3::4])
        for r, g, b, e in texels:
            f = math.ldexp(1.0, e - 136) if e else 0.0
            pixels.append((r * f, g * f, b * f))
    return pixels


def render(glimt, name, more, samples, seed):
    scene, sets, _ = SCENES[name]
    out, report = HOME / "picture.hdr", HOME / "report.json"
    command = [glimt, ROOT / scene, "--once", "--progress", "none", "--width", SIDE, "--height", SIDE, "--samples", samples]
    command += ["--seed", seed, "-o", out, "--report", report, *more]
    for one in sets:
        command += ["--set", one]
    subprocess.run([str(word) for word in command], check=True, capture_output=True)
    stages = json.loads(report.read_text())["stages"]
    return picture(out), sum(s["seconds"] for s in stages if s["name"] in ("photons", "render"))


def error(pixels, reference, used):
    squares = [
        (a - b) ** 2 / (b * b + 0.01) for p, r, u in zip(pixels, reference, used) if u for a, b in zip(p, r)
    ]
    return sum(squares) / len(squares)


def mean(pixels, used):
    return sum(sum(p) for p, u in zip(pixels, used) if u)


def reference(glimt, name, samples, radius, seeds):
    more = ["--integrator", "path"]
    if radius:
        more = ["--integrator", "whitted", "--photons", "on", "--set", f"photons.radius={radius}"]
    kept = HOME / f"{name}-{SIDE}-{samples}-{radius}-{seeds}.json"
    if not kept.exists():
        sums = None
        for seed in range(1000, 1000 + seeds):
            pixels, _ = render(glimt, name, more, samples, seed)
            sums = pixels if sums is None else [tuple(map(sum, zip(a, b))) for a, b in zip(sums, pixels)]
        kept.write_text(json.dumps([tuple(x / seeds for x in p) for p in sums]))
    return json.loads(kept.read_text())


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("names", nargs="*", default=list(SCENES))
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--most", type=int, default=64)
    parser.add_argument("--reference", type=int, default=4096)
    parser.add_argument("--reference-seeds", type=int, default=8)
    parser.add_argument("--radius", type=float, default=0, help="references by photons of this small radius in place of paths")
    parser.add_argument("--glimt", default=ROOT / "target" / "release" / "glimt")
    parser.add_argument("--by", nargs="*", default=["photons", "path"])
    asked = parser.parse_args()
    HOME.mkdir(parents=True, exist_ok=True)
    for name in asked.names:
        truth = reference(asked.glimt, name, asked.reference, asked.radius, asked.reference_seeds)
        used = [True] * len(truth)
        if SCENES[name][2]:
            # Mirror and glass have no albedo.
            albedo, _ = render(asked.glimt, name, ["--view", "albedo"], 1, 0)
            used = [max(p) > 0 for p in albedo]
        for by in asked.by:
            more = ["--integrator", "whitted", "--photons", "on"] if by == "photons" else ["--integrator", "path"]
            samples, before = 4, None
            while samples <= asked.most:
                runs = [render(asked.glimt, name, more, samples, seed) for seed in range(asked.seeds)]
                errors = [error(pixels, truth, used) for pixels, _ in runs]
                seconds = statistics.median(seconds for _, seconds in runs)
                slope = f"{math.log(statistics.mean(errors) / before) / math.log(4):+.2f}" if before else ""
                before = statistics.mean(errors)
                ratio = statistics.mean(mean(pixels, used) for pixels, _ in runs) / mean(truth, used)
                print(f"{name:8} {by:8} {samples:5} samples {seconds:8.2f} s  relMSE {before:.3e}  {slope:6} mean {ratio:.4f}",
                      flush=True)
                samples *= 4


sys.exit(main())
