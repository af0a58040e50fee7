#!/usr/bin/env python3
"""Compares the remaining noise with the requested error.

    python3 benches/adaptive/truth.py [SCENE...] [--error E] [--seeds N] [--side PIXELS] [--photons]
        [--integrator I] [--glimt BINARY]

Each scene is rendered with N seeds and `error = E`. The spread of these images is the true noise of each tile: the RMS standard deviation
of its pixels' luminance, divided by its mean, or by 1 % of the image's mean if that is larger. Prints, relative to E: the RMS over all tiles, the RMS over
the tiles that needed more than 16 samples, and the largest tile; then the fraction of such tiles, the mean number of samples, the
reported error over the true error of the whole image, and the ETA shown after a quarter of the work divided by the true remaining time (median
over the seeds that took half a second or more). Defaults: all bundled scenes, E = 0.02, 8 seeds, 192 pixels along the longer side. Runs in the
environment of ../mitsuba, which is created if it does not exist.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
TILE = 32
MIN_SAMPLES = 16
MIN_BRIGHTNESS = 0.01
MAX_SAMPLES = 65536
WEIGHTS = (0.2126, 0.7152, 0.0722)


def within_environment(program):
    """Restarts the program in an environment with numpy and Mitsuba, which reads float images."""
    sys.path.insert(0, str(HERE.parent / "mitsuba"))
    import run

    run.HOME.mkdir(parents=True, exist_ok=True)
    environment = {**os.environ, "DRJIT_LIBLLVM_PATH": run.llvm(), "GLIMT_TRUTH": "1"}
    command = [str(run.python()), program, *sys.argv[1:]]
    os.execve(command[0], command, environment)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", type=Path)
    parser.add_argument("--error", type=float, default=0.02)
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--side", type=int, default=192)
    parser.add_argument("--photons", action="store_true")
    parser.add_argument("--integrator")
    parser.add_argument("--glimt", default=str(ROOT / "target" / "release" / "glimt"))
    return parser.parse_args()


def tiles(picture):
    """The tiles of an image, row by row."""
    rows, columns = picture.shape[:2]
    return [picture[y : y + TILE, x : x + TILE] for y in range(0, rows, TILE) for x in range(0, columns, TILE)]


def size_of(scene, side):
    """Options that set the image size, given the number of pixels along the longer side."""
    with scene.open("rb") as file:
        own = tomllib.load(file).get("render", {})
    width, height = own.get("width", 640), own.get("height", 480)
    scale = side / max(width, height)
    return ["--width", max(1, round(width * scale)), "--height", max(1, round(height * scale))]


def rendered(args, scene, folder):
    """Luminance for each seed, samples of each pixel, and the reported errors and samples."""
    import mitsuba as mi
    import numpy as np

    mi.set_variant("scalar_rgb")
    size = size_of(scene, args.side)
    picture, report = folder / "picture.exr", folder / "report.json"

    def render(seed, options):
        call = [args.glimt, scene, "--once", "--progress", "json", *size, "-o", picture, "--report", report, "--seed", seed]
        call += ["--error", args.error, "--samples", MAX_SAMPLES, *options]
        stderr = subprocess.run([str(word) for word in call], check=True, stderr=subprocess.PIPE, text=True).stderr
        image = np.array(mi.Bitmap(str(picture)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False))
        return image.astype(np.float64), json.loads(report.read_text())["image"], eta_ratio(stderr)

    options = ["--photons", "on"] if args.photons else []
    options += ["--integrator", args.integrator] if args.integrator else []
    runs = [render(seed, options) for seed in range(1, args.seeds + 1)]
    counts = render(1, [*options, "--view", "samples"])[0][..., 0]
    reported = [image["error"] for _, image, _ in runs], [image["samples"]["mean"] for _, image, _ in runs]
    luminance = np.array([picture @ np.array(WEIGHTS) for picture, _, _ in runs])
    return luminance, counts, *reported, [share for _, _, share in runs if share]


def eta_ratio(lines):
    """The ETA shown after a quarter of the render, divided by the true remaining time."""
    events = [json.loads(line) for line in lines.splitlines()]
    events = [event for event in events if event["event"] == "progress"]
    at = next((event for event in events if event["fraction"] >= 0.25 and event["eta_seconds"] is not None), None)
    if at is None or events[-1]["elapsed_seconds"] < 0.5:
        return None
    return at["eta_seconds"] / (events[-1]["elapsed_seconds"] - at["elapsed_seconds"])


def row(args, scene, folder):
    import numpy as np

    luminance, counts, errors, samples, eta_ratios = rendered(args, scene, folder)
    mean, variance = luminance.mean(axis=0), luminance.var(axis=0, ddof=1)
    whole = mean.mean()
    noise = np.array(
        [
            np.sqrt(v.mean()) / max(m.mean(), MIN_BRIGHTNESS * whole, 1e-300)
            for m, v in zip(tiles(mean), tiles(variance))
        ]
    )
    noise /= args.error
    needed = np.array([tile.mean() > MIN_SAMPLES for tile in tiles(counts)])
    of_needed = np.sqrt((noise[needed] ** 2).mean()) if needed.any() else float("nan")
    mean_error = np.mean([error for error in errors if error is not None] or [float("nan")])
    true = np.sqrt(variance.mean()) / whole
    print(
        f"{scene.stem:18}{np.sqrt((noise**2).mean()):7.2f}{of_needed:8.2f}{noise.max():8.2f}{needed.mean():8.2f}"
        f"{np.mean(samples):9.1f}{mean_error:10.2e}{true:10.2e}{true / mean_error:7.2f}"
        f"{np.median(eta_ratios) if eta_ratios else float('nan'):7.2f}",
        flush=True,
    )


def main():
    args = arguments()
    print(f"error = {args.error}, {args.side} pixels, {args.seeds} seeds")
    print(f"{'':18}{'all':>7}{'needed':>8}{'largest':>8}{'part':>8}{'samples':>9}{'reported':>10}{'true':>10}{'ratio':>7}{'ETA':>7}")
    for scene in args.scenes or sorted((ROOT / "scenes").glob("*.toml")):
        with tempfile.TemporaryDirectory() as folder:
            row(args, scene, Path(folder))


if __name__ == "__main__":
    if "GLIMT_TRUTH" not in os.environ:
        within_environment(__file__)
    sys.exit(main())
