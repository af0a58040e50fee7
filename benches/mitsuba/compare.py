"""See run.py, which starts this inside its environment."""

import argparse
import hashlib
import json
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")
import assets  # noqa: E402
from scenes import SCENES  # noqa: E402

HOME = Path(os.environ["GLIMT_MITSUBA_HOME"])
ROOT = Path(__file__).resolve().parent.parent.parent
THREADS = 2
SAMPLES = 256
# By default, Mitsuba's direct integrator samples the light and the BSDF; with only light samples, it does half of the work.
LIGHT_SAMPLES_ONLY = {"emitter_samples": 1, "bsdf_samples": 0}
# The noise at which glimt stops sampling a tile, in an additional row.
STOP = "3e-4"
# Number of renders for a reference: for direct light, which is quick, and for paths.
DIRECT_REFERENCE, PATH_REFERENCE = (24, 1024), (16, 1024)


def rel_mse(picture, reference):
    """mean((x - r)^2 / (r^2 + 0.01)) on linear radiance."""
    return float(np.mean((picture - reference) ** 2 / (reference**2 + 0.01)))


class Mitsuba:
    """A scene loaded into Mitsuba."""

    def __init__(self, scene, options):
        self.scene = mi.load_dict(scene.mitsuba(mi, assets.directory(HOME), options))

    def render(self, samples, seed):
        """Returns the seconds and the image. The first render also compiles the kernel, so do not measure it."""
        start = time.perf_counter()
        image = mi.render(self.scene, spp=samples, seed=seed)
        dr.eval(image)
        dr.sync_thread()
        return time.perf_counter() - start, np.array(image, dtype=np.float64)


def reference(scene, renderer, render):
    """The mean of many images of one renderer, cached in a file, even while incomplete. Delete the file when the
    renderer's results change."""
    count, samples = DIRECT_REFERENCE if scene.max_depth == 1 else PATH_REFERENCE
    key = hashlib.sha256(scene.toml(count, samples, assets.directory(HOME)).encode()).hexdigest()[:16]
    file = HOME / f"reference-{renderer}-{key}.npz"
    pictures, total = 0, 0.0
    if file.exists():
        kept = np.load(file)
        pictures, total = int(kept["pictures"]), kept["total"]
    for number in range(pictures, count):
        total = total + render(samples, 1000 + number)[1]
        np.savez(HOME / "unfinished.npz", pictures=number + 1, total=total)
        (HOME / "unfinished.npz").rename(file)
    return total / count


def glimt(binary, scene, samples, seed, options=()):
    """Returns the seconds of the render stage, and the image."""
    folder = HOME / "out"
    folder.mkdir(exist_ok=True)
    file, picture, report = folder / "scene.toml", folder / "picture.exr", folder / "report.json"
    file.write_text(scene.toml(samples, seed, assets.directory(HOME)))
    command = [binary, "--once", file, "-o", picture, "--report", report, "--threads", str(THREADS), *options]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    stages = {stage["name"]: stage for stage in json.loads(report.read_text())["stages"]}
    image = np.array(mi.Bitmap(str(picture)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False))
    return stages["render"]["seconds"], image.astype(np.float64)


def spread(pictures):
    """The relMSE of a single image, estimated from the differences between images: E|a - b|^2 is twice the variance."""
    mean, variance = np.mean(pictures, axis=0), np.var(pictures, axis=0, ddof=1)
    return float(np.mean(variance / (mean**2 + 0.01)))


def compare(scene, binaries, rounds, by_spread):
    """Prints the rows of a scene."""
    ways = {"Mitsuba": {}, "only light samples": LIGHT_SAMPLES_ONLY} if scene.max_depth == 1 else {"Mitsuba": {}}
    loaded = {name: Mitsuba(scene, options) for name, options in ways.items()}
    by_glimt = lambda binary, *more: lambda samples, seed: glimt(binary, scene, samples, seed, more)
    # Each renderer has its own reference: Mitsuba offsets shadow rays by a fixed epsilon, which moves the edges of shadows.
    own = glimts = None
    if not by_spread:
        own = reference(scene, "mitsuba", list(loaded.values())[-1].render)
        glimts = reference(scene, "glimt", by_glimt(binaries[0]))
    renderers = []
    for name, mitsuba in loaded.items() if rounds > 0 else ():
        mitsuba.render(SAMPLES, 0)
        renderers.append((name, mitsuba.render, own))
    for binary in binaries if rounds > 0 else ():
        renderers.append((Path(binary).name, by_glimt(binary), glimts))
    if rounds > 0:
        renderers.append((f"error = {STOP}", by_glimt(binaries[-1], "--error", STOP), glimts))
    seconds, pictures = [[] for _ in renderers], [[] for _ in renderers]
    for round_number in range(1, rounds + 1):
        for (_, render, _), taken, seen in zip(renderers, seconds, pictures):
            time_taken, picture = render(SAMPLES, round_number)
            taken.append(time_taken)
            seen.append(picture)
    results = []
    for (name, _, held_to), taken, seen in zip(renderers, seconds, pictures):
        error = spread(seen) if by_spread else statistics.mean(rel_mse(picture, held_to) for picture in seen)
        results.append((statistics.median(taken), error))
        product, of_mitsuba = (result[0] * result[1] for result in (results[-1], results[0]))
        figures = f"{results[-1][0]:9.3f}{error:10.2e}{product:10.2e}{product / of_mitsuba:12.2f}"
        print(f"{scene.name:18}{name:16}{figures}", flush=True)
    if results:
        off = results[0][1] / scene.anchor - 1 if scene.anchor else None
        if off is None:
            print(f"{scene.name}: no anchor")
        elif abs(off) > 0.1:
            print(f"{scene.name}: Mitsuba's relMSE differs by {off:+.0%} from the anchor {scene.anchor:.1e}")
    # The overall brightness reveals lost or doubled light, which noise hides in single pixels.
    if by_spread:
        own, glimts = np.mean(pictures[0], axis=0), np.mean(pictures[-2], axis=0)
    bias = np.mean(glimts) / np.mean(own) - 1
    print(f"{scene.name:18}{'references':16}{'':9}{rel_mse(glimts, own):10.2e}  difference, mean {bias:+.3%}", flush=True)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("names", nargs="*", help="scenes whose name contains one of these")
    parser.add_argument("--rounds", type=int, default=5, help="0: only render the references")
    by_spread = "compute errors from the differences between the rounds' images, without references"
    parser.add_argument("--spread", action="store_true", help=by_spread)
    parser.add_argument("--glimt", nargs="+", default=[ROOT / "target" / "release" / "glimt"])
    options = parser.parse_args()
    dr.set_thread_count(THREADS)
    print(f"{'':18}{'':16}{'seconds':>9}{'relMSE':>10}{'product':>10}{'to Mitsuba':>12}")
    for scene in SCENES:
        if not options.names or any(name in scene.name for name in options.names):
            compare(scene, options.glimt, options.rounds, options.spread)


if __name__ == "__main__":
    main()
