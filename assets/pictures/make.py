#!/usr/bin/env python3
"""Renders the pictures of README and docs from the bundled scenes.

    python3 assets/pictures/make.py [NAME…] [--glimt BINARY]

By itself all of them, which takes some ten minutes on two cores. `benches/terminal/screen.py` and `benches/terminal/moving.py` make
screen.png and save.png; `glimt bench scenes/cornell.toml scenes/cornell_glass.toml --plot` made bench.svg.
"""

import argparse
import subprocess
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent

# Each picture has the name of its scene.
PICTURES = {
    "cornell": "--width 400 --height 400 --samples 256 --integrator path",
    "photons": "--width 400 --height 400 --samples 96",
    "water": "--width 480 --height 360 --samples 128",
    "stairs": "--width 480 --height 360 --samples 224",
    "environment": "--width 480 --height 300 --samples 160",
    "textures": "--width 480 --height 300 --samples 96",
    "ring": "--width 480 --height 360 --samples 96",
    "shapes": "--width 480 --height 300 --samples 96",
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", choices=[*PICTURES, []])
    parser.add_argument("--glimt", type=Path, default=ROOT / "target" / "release" / "glimt")
    asked = parser.parse_args()
    for name in asked.names or PICTURES:
        scene, picture = ROOT / "scenes" / f"{name}.toml", HERE / f"{name}.jpg"
        options = PICTURES[name].split()
        subprocess.run([asked.glimt.absolute(), scene, "--once", *options, "-o", picture], check=True)
        print(f"{picture.name}: {picture.stat().st_size // 1000} kB")


if __name__ == "__main__":
    main()
