#!/usr/bin/env python3
"""Measures tree construction over triangles that share a vertex, compared with separate triangles.

    python3 benches/memory/fans.py [--program target/release/glimt] [--triangles N,N] [--rounds 3]

All triangles of a fan share one vertex, so no plane separates them there. A soup has the same number of triangles of the same size at random
positions. Prints the reported seconds of the tree (the minimum of several interleaved rounds) and the ratio of fan to soup.
"""

import argparse
import json
import math
import random
import subprocess
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
SCENE = """
[camera]
position = [0, 0, 4]
look_at = [0, 0, 0]

[[light]]
type = "point"
position = [0, 0, 5]
intensity = [20, 20, 20]

[materials.clay]
diffuse = [0.5, 0.5, 0.5]

[[mesh]]
file = "mesh.obj"
material = "clay"
"""


def fan(count):
    """A cone around the first vertex, wavy so that its triangles are not coplanar."""
    def rim(i):
        angle = math.tau * i / count
        return math.cos(angle), math.sin(angle), 0.3 * math.sin(7 * angle)

    vertices = [(0.0, 0.0, 0.0), *(rim(i) for i in range(count))]
    return vertices, [(1, 2 + i, 2 + (i + 1) % count) for i in range(count)]


def soup(count):
    """Triangles of the fan's shape, each randomly rotated and moved within the same volume."""
    numbers = random.Random(1)
    vertices, faces = [], []
    width = math.tau / count
    for i in range(count):
        x, y, z, angle = *(numbers.uniform(-1, 1) for _ in range(3)), numbers.uniform(0, math.tau)
        along, across = (math.cos(angle), math.sin(angle)), (-math.sin(angle) * width, math.cos(angle) * width)
        vertices += [(x, y, z), (x + along[0], y + along[1], z), (x + along[0] + across[0], y + along[1] + across[1], z)]
        faces.append((3 * i + 1, 3 * i + 2, 3 * i + 3))
    return vertices, faces


def rendered(program, accel, folder):
    """Seconds spent building the tree."""
    report = folder / "report.json"
    command = [program, folder / "scene.toml", "--once", "--progress", "none", "--accel", accel, "--width", "32", "--height", "32",
               "--samples", "1", "-o", folder / "x.png", "--report", report]
    subprocess.run([str(word) for word in command], check=True, stderr=subprocess.DEVNULL)
    stages = json.loads(report.read_text())["stages"]
    return next(stage["seconds"] for stage in stages if stage["name"] == "accel")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default=str(ROOT / "target" / "release" / "glimt"))
    parser.add_argument("--triangles", default="5000,20000,100000")
    parser.add_argument("--rounds", type=int, default=3)
    args = parser.parse_args()
    print(f"{'':8}{'triangles':>10}{'fan s':>9}{'soup s':>9}{'fan/soup':>10}")
    for accel in ["bvh", "kdtree"]:
        for count in map(int, args.triangles.split(",")):
            best = {}
            with tempfile.TemporaryDirectory() as folder:
                for kind in [fan, soup]:
                    place = Path(folder) / kind.__name__
                    place.mkdir()
                    vertices, faces = kind(count)
                    lines = ["v %.9g %.9g %.9g" % one for one in vertices] + ["f %d %d %d" % one for one in faces]
                    (place / "mesh.obj").write_text("\n".join(lines) + "\n")
                    (place / "scene.toml").write_text(SCENE)
                for _ in range(args.rounds):
                    for kind in ["fan", "soup"]:
                        found = rendered(args.program, accel, Path(folder) / kind)
                        best[kind] = min(found, best.get(kind, found))
            ratio = best["fan"] / best["soup"]
            print(f"{accel:8}{count:10}{best['fan']:9.3f}{best['soup']:9.3f}{ratio:10.2f}", flush=True)


if __name__ == "__main__":
    main()
