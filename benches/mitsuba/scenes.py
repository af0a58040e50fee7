"""The scenes, described once and written for both renderers. Lengths in scene units, angles in degrees, radiance linear."""

from dataclasses import dataclass, field

import numpy as np

SIZE = 256


@dataclass
class Scene:
    """A camera, quads, boxes, spheres, point lights."""

    name: str
    # Mitsuba's relMSE at 256 samples, by which the scene is known to be the one that earlier figures are of
    anchor: float
    position: tuple
    look_at: tuple
    fov: float  # vertical
    materials: dict  # name -> diffuse reflectance, or (diffuse reflectance, emitted radiance)
    quads: list = field(default_factory=list)  # corner, u, v, material; the front is along u x v
    boxes: list = field(default_factory=list)  # center, size, degrees about y, material
    spheres: list = field(default_factory=list)  # center, radius, material
    points: list = field(default_factory=list)  # position, intensity

    def toml(self, samples, seed):
        """For glimt."""
        lines = [
            f"[render]\nwidth = {SIZE}\nheight = {SIZE}\nsamples = {samples}\nseed = {seed}",
            "max_depth = 1\nshadow_samples = 1",
            f"[camera]\nposition = {list(self.position)}\nlook_at = {list(self.look_at)}\nfov = {self.fov}",
        ]
        for name, material in self.materials.items():
            diffuse, emission = lobes(material)
            lines.append(f"[materials.{name}]\ndiffuse = {list(diffuse)}\nemission = {list(emission)}")
        for corner, u, v, material in self.quads:
            lines.append(f'[[quad]]\ncorner = {corner}\nu = {u}\nv = {v}\nmaterial = "{material}"')
        for center, size, turn, material in self.boxes:
            lines.append(
                f'[[box]]\ncenter = {center}\nsize = {size}\nrotate = [0, {turn}, 0]\nmaterial = "{material}"'
            )
        for center, radius, material in self.spheres:
            lines.append(f'[[sphere]]\ncenter = {center}\nradius = {radius}\nmaterial = "{material}"')
        for position, intensity in self.points:
            lines.append(f"[[light]]\nposition = {position}\nintensity = {intensity}")
        return "\n".join(lines) + "\n"

    def mitsuba(self, mi, integrator):
        """For Mitsuba; `integrator` holds what differs from the defaults of its direct light."""
        t = mi.ScalarTransform4f
        rgb = lambda value: {"type": "rgb", "value": list(value)}
        scene = {
            "type": "scene",
            "integrator": {"type": "direct", **integrator},
            "sensor": {
                "type": "perspective",
                "fov": self.fov,
                "fov_axis": "y",
                "to_world": t().look_at(list(self.position), list(self.look_at), [0, 1, 0]),
                "film": {
                    "type": "hdrfilm",
                    "width": SIZE,
                    "height": SIZE,
                    "rfilter": {"type": "box"},
                    "pixel_format": "rgb",
                    "component_format": "float32",
                },
                "sampler": {"type": "multijitter", "sample_count": 256},
            },
        }

        def add(kind, number, shape, material):
            diffuse, emission = lobes(self.materials[material])
            shape["bsdf"] = {"type": "twosided", "b": {"type": "diffuse", "reflectance": rgb(diffuse)}}
            if any(emission):
                shape["emitter"] = {"type": "area", "radiance": rgb(emission)}
            scene[f"{kind}{number}"] = shape

        for i, (corner, u, v, material) in enumerate(self.quads):
            corner, u, v = (np.array(x, dtype=float) for x in (corner, u, v))
            normal = np.cross(u, v)
            matrix = np.eye(4)
            matrix[:3, 0], matrix[:3, 1] = u / 2, v / 2
            matrix[:3, 2], matrix[:3, 3] = normal / np.linalg.norm(normal), corner + (u + v) / 2
            add("quad", i, {"type": "rectangle", "to_world": t(matrix)}, material)
        for i, (center, size, turn, material) in enumerate(self.boxes):
            to_world = t().translate(center).rotate([0, 1, 0], turn).scale([x / 2 for x in size])
            add("box", i, {"type": "cube", "to_world": to_world}, material)
        for i, (center, radius, material) in enumerate(self.spheres):
            add("sphere", i, {"type": "sphere", "center": center, "radius": radius}, material)
        for i, (position, intensity) in enumerate(self.points):
            scene[f"point{i}"] = {"type": "point", "position": position, "intensity": rgb(intensity)}
        return scene


def lobes(material):
    """Diffuse reflectance and emitted radiance."""
    return material if isinstance(material[0], tuple) else (material, (0.0, 0.0, 0.0))


WALLS = [
    ([-1, 0, 1], [2, 0, 0], [0, 0, -2], "white"),
    ([-1, 2, -1], [2, 0, 0], [0, 0, 2], "white"),
    ([-1, 0, -1], [2, 0, 0], [0, 2, 0], "white"),
    ([-1, 0, 1], [0, 0, -2], [0, 2, 0], "red"),
    ([1, 0, -1], [0, 0, 2], [0, 2, 0], "green"),
]
COLORS = {"white": (0.73, 0.71, 0.68), "red": (0.63, 0.06, 0.05), "green": (0.13, 0.45, 0.09)}

SCENES = [
    Scene(
        name="A1 quad lamp",
        anchor=1.2e-5,
        position=(0, 1, 4.4),
        look_at=(0, 1, 0),
        fov=34,
        materials={**COLORS, "lamp": ((0.8, 0.8, 0.8), (17.0, 15.5, 12.5))},
        quads=WALLS + [([-0.3, 1.98, -0.3], [0.6, 0, 0], [0, 0, 0.6], "lamp")],
        boxes=[
            ([-0.35, 0.6, -0.32], [0.6, 1.2, 0.6], 18, "white"),
            ([0.36, 0.3, 0.34], [0.6, 0.6, 0.6], -17, "white"),
        ],
    ),
    Scene(
        name="D point",
        anchor=7.7e-7,
        position=(0, 2.2, 6),
        look_at=(0, 0.7, 0),
        fov=40,
        materials={"floor": (0.6, 0.6, 0.6), "red": (0.7, 0.2, 0.15), "blue": (0.2, 0.3, 0.7), "gold": (0.7, 0.55, 0.2)},
        quads=[([-10, 0, 10], [20, 0, 0], [0, 0, -20], "floor")],
        spheres=[
            ([-1.4, 0.7, 0], 0.7, "red"),
            ([0.2, 0.9, -0.8], 0.9, "blue"),
            ([1.5, 0.5, 0.5], 0.5, "gold"),
            ([-0.4, 0.35, 1.3], 0.35, "gold"),
            ([0.7, 0.25, 1.7], 0.25, "blue"),
        ],
        points=[([2.5, 5, 3], [60, 60, 60])],
    ),
]
