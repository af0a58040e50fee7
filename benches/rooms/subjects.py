"""The scenes to render with both programs, with their sizes and references."""

import hashlib
import importlib.util
import tomllib

import drjit as dr
import numpy as np

from convert import Conversion
from renderers import luminance

# Samples per render of a reference; the renders are averaged.
CHUNK = 64


def subject(path, args, home):
    """Returns the subject for a scene file, or for a folder with a scene."""
    return Folder(path) if path.is_dir() else File(path, args.side, args.reference, home)


class Folder:
    """A folder with the scene for both programs, and a reference."""

    def __init__(self, path):
        self.path, self.name, self.file = path, path.resolve().name, path / "scene.toml"
        reference = np.load(path / "ref.npy")
        self.height, self.width = reference.shape[:2]
        self.luminance = luminance(reference)

    def mitsuba(self, mi):
        spec = importlib.util.spec_from_file_location(f"mi_load_{self.name}", self.path / "mi_load.py")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        scene = module.mi_dict(str(self.path))
        scene["sensor"]["sampler"] = {"type": "multijitter", "sample_count": CHUNK}
        return scene


class File:
    """A glimt scene file. Mitsuba renders its translation and the reference."""

    def __init__(self, path, side, samples, home):
        self.name, self.file = path.stem, path
        with path.open("rb") as file:
            self.content = tomllib.load(file)
        settings = self.content.get("render", {})
        width, height = settings.get("width", 640), settings.get("height", 480)
        scale = min(1, side / max(width, height))
        self.width, self.height = max(1, round(width * scale)), max(1, round(height * scale))
        self.folder = home / "rooms"
        self.folder.mkdir(parents=True, exist_ok=True)
        self.luminance = luminance(self.reference(samples))

    def mitsuba(self, mi):
        return Conversion(mi, self.content, self.file.parent, (self.width, self.height), self.folder).scene()

    def reference(self, samples):
        """The mean of many renders by Mitsuba, cached until the scene or its files change."""
        import mitsuba as mi

        file = self.folder / f"{self.name}-{self.fingerprint()}-{samples}.npy"
        if not file.exists():
            print(f"{self.name}: rendering the reference, {samples} samples", flush=True)
            scene, total = mi.load_dict(self.mitsuba(mi)), 0.0
            count = -(-samples // CHUNK)
            for number in range(count):
                picture = mi.render(scene, spp=CHUNK, seed=1_000_000 + number)
                dr.eval(picture)
                total = total + np.array(picture, dtype=np.float64)
            np.save(self.folder / "unfinished.npy", total / count)
            (self.folder / "unfinished.npy").rename(file)
        return np.load(file)

    def fingerprint(self):
        """A hash of the scene, the files that it refers to, and the size."""
        digest = hashlib.sha256(self.file.read_bytes())
        tables = [*self.content.get("mesh", []), *self.content.get("textures", {}).values()]
        for table in [*tables, self.content.get("environment", {})]:
            if "file" in table:
                digest.update((self.file.parent / table["file"]).read_bytes())
        digest.update(f"{self.width} {self.height}".encode())
        return digest.hexdigest()[:16]
