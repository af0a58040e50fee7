#!/usr/bin/env python3
"""Renders the pictures of README and docs from the bundled scenes.

    python3 assets/pictures/make.py [FILE…] [--glimt BINARY]

Renders all of them by default, which takes about half an hour on two cores. `benches/terminal/screen.py` and `benches/terminal/moving.py` make
screen.png and save.png; `glimt bench scenes/cornell.toml scenes/cornell_glass.toml --plot` made bench.svg.
"""

import argparse
import subprocess
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent

# Each picture has the name of its scene.
PICTURES = {
    "path.jpg": "--width 960 --height 960 --samples 2048 --time 560",
    "photons.jpg": "--width 960 --height 960 --samples 384",
    "water.jpg": "--width 960 --height 720 --samples 256",
    "lamps.jpg": "--width 960 --height 600 --samples 256",
    "environment.jpg": "--width 960 --height 600 --samples 512",
    "metals.jpg": "--width 960 --height 533 --samples 4096",
    "leaves.jpg": "--width 960 --height 720 --samples 256 --clamp 1",
    "racer.jpg": "--width 960 --height 630 --samples 512 --time 80",
    "textures.png": "--width 320 --height 240 --samples 128",
    "ring.png": "--width 480 --height 320 --samples 64",
    "shapes.png": "--width 480 --height 300 --samples 96",
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", metavar="FILE", choices=[*PICTURES, []])
    parser.add_argument("--glimt", type=Path, default=ROOT / "target" / "release" / "glimt")
    args = parser.parse_args()
    for file in args.files or PICTURES:
        picture = HERE / file
        scene, options = ROOT / "scenes" / f"{picture.stem}.toml", PICTURES[file].split()
        subprocess.run([args.glimt.absolute(), scene, "--once", *options, "-o", picture], check=True)
        print(f"{picture.name}: {picture.stat().st_size // 1000} kB")


if __name__ == "__main__":
    main()
