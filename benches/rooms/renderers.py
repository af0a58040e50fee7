"""Wrappers for both renderers. Each returns the processor seconds of an image, and its luminance."""

import resource
import statistics
import subprocess
import sys
import time

import drjit as dr
import mitsuba as mi
import numpy as np

THREADS = 2


def luminance(picture):
    """Luminance of linear Rec. 709 colors."""
    return picture.astype(np.float64) @ np.array([0.2126, 0.7152, 0.0722])


class Mitsuba:
    """A scene, loaded and compiled once."""

    def __init__(self, scene, samples):
        self.scene = mi.load_dict(scene.mitsuba(mi))
        self.render(samples, 0)

    def render(self, samples, seed):
        start = time.process_time()
        picture = mi.render(self.scene, spp=samples, seed=seed)
        dr.eval(picture)
        dr.sync_thread()
        return time.process_time() - start, luminance(np.array(picture))


class Glimt:
    """A glimt binary with a scene and options."""

    def __init__(self, binary, scene, folder, options):
        folder.mkdir(parents=True, exist_ok=True)
        self.picture = folder / "picture.exr"
        size = ["--width", scene.width, "--height", scene.height]
        call = [binary, scene.file, "--once", "-o", self.picture, "--progress", "none", "--threads", THREADS, *size]
        self.call = [str(word) for word in call]
        self.options = options
        # Render one pixel with one path to measure everything except rendering.
        one = ["--samples", "1", "--crop", "0,0,1,1", "--integrator", "path"]
        self.set_up = statistics.median(self.seconds(one) for _ in range(5))

    def seconds(self, options):
        """Processor time of the process."""
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run([*self.call, *options], capture_output=True, text=True)
        if done.returncode != 0:
            sys.exit(done.stderr)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    def render(self, samples, seed):
        taken = self.seconds([*self.options, "--samples", str(samples), "--seed", str(seed)])
        bitmap = mi.Bitmap(str(self.picture)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
        return taken - self.set_up, luminance(np.array(bitmap))
