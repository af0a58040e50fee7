"""Scenes that are described once and exported to both renderers. Lengths are in scene units, angles in degrees, radiance is linear."""

from dataclasses import dataclass, field

import numpy as np

SIZE = 256


@dataclass
class Scene:
    """A camera, quads, boxes, spheres, meshes and lights."""

    name: str
    # Mitsuba's relMSE at 256 samples, which reveals whether the scene has changed since earlier figures; None if there are none
    anchor: float | None
    position: tuple
    look_at: tuple
    fov: float  # vertical
    # name -> diffuse reflectance or the name of a texture, or (that, emitted radiance), or {"mirror": reflectance}, {"glass": ior}
    materials: dict
    max_depth: int = 1  # bounces; 1: direct light, with integrators that compute nothing else
    aperture: float = 0.0  # radius of the lens
    focus: float = 0.0  # distance of the plane in focus
    quads: list = field(default_factory=list)  # corner, u, v, material; the front is along u x v
    boxes: list = field(default_factory=list)  # center, size, degrees about y, material
    spheres: list = field(default_factory=list)  # center, radius, material
    meshes: list = field(default_factory=list)  # file, scale, degrees about y, translation, material
    points: list = field(default_factory=list)  # position, intensity
    environment: str | tuple | None = None  # name of a sky map, or a constant radiance

    def toml(self, samples, seed, assets):
        """The scene file for glimt."""
        integrator = "whitted" if self.max_depth == 1 else "path"
        lines = [
            f"[render]\nwidth = {SIZE}\nheight = {SIZE}\nsamples = {samples}\nseed = {seed}",
            f'max_depth = {self.max_depth}\nshadow_samples = 1\nintegrator = "{integrator}"',
            f"[camera]\nposition = {list(self.position)}\nlook_at = {list(self.look_at)}\nfov = {self.fov}",
        ]
        if self.aperture > 0:
            lines.append(f"aperture = {self.aperture}\nfocus = {self.focus}")
        for name, material in self.materials.items():
            if isinstance(material, dict):
                [(kind, value)] = material.items()
                value = f"reflectance = {[value] * 3}" if kind == "mirror" else f"ior = {value}"
                lines.append(f'[materials.{name}]\ntype = "{kind}"\n{value}')
                continue
            diffuse, emission = lobes(material)
            if isinstance(diffuse, str):
                lines.append(f'[textures.{name}]\nfile = "{assets}/{diffuse}"')
                diffuse = f'{{ texture = "{name}" }}'
            else:
                diffuse = list(diffuse)
            lines.append(f"[materials.{name}]\ndiffuse = {diffuse}\nemission = {list(emission)}")
        for corner, u, v, material in self.quads:
            lines.append(f'[[quad]]\ncorner = {corner}\nu = {u}\nv = {v}\nmaterial = "{material}"')
        for center, size, turn, material in self.boxes:
            lines.append(
                f'[[box]]\ncenter = {center}\nsize = {size}\nrotate = [0, {turn}, 0]\nmaterial = "{material}"'
            )
        for center, radius, material in self.spheres:
            lines.append(f'[[sphere]]\ncenter = {center}\nradius = {radius}\nmaterial = "{material}"')
        for file, scale, turn, translation, material in self.meshes:
            lines.append(
                f'[[mesh]]\nfile = "{assets}/{file}"\nscale = {scale}\nrotate = [0, {turn}, 0]\n'
                f'translate = {translation}\nmaterial = "{material}"'
            )
        for position, intensity in self.points:
            lines.append(f"[[light]]\nposition = {position}\nintensity = {intensity}")
        if isinstance(self.environment, str):
            lines.append(f'[environment]\nfile = "{assets}/{self.environment}-glimt.exr"')
        elif self.environment:
            lines.append(f"[environment]\ncolor = {list(self.environment)}")
        return "\n".join(lines) + "\n"

    def mitsuba(self, mi, assets, options):
        """The scene for Mitsuba; `options` overrides the defaults of its integrator."""
        t = mi.ScalarTransform4f
        rgb = lambda value: {"type": "rgb", "value": list(value)}
        # Mitsuba's depth counts path edges, including the one at the camera.
        integrator = {"type": "direct"} if self.max_depth == 1 else {"type": "path", "max_depth": self.max_depth + 1}
        lens = {"type": "perspective"}
        if self.aperture > 0:
            lens = {"type": "thinlens", "aperture_radius": self.aperture, "focus_distance": self.focus}
        scene = {
            "type": "scene",
            "integrator": {**integrator, **options},
            "sensor": {
                **lens,
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
            scene[f"{kind}{number}"] = shape
            match self.materials[material]:
                case {"mirror": value}:
                    shape["bsdf"] = {"type": "conductor", "material": "none", "specular_reflectance": rgb([value] * 3)}
                    return
                case {"glass": ior}:
                    shape["bsdf"] = {"type": "dielectric", "int_ior": ior, "ext_ior": 1.0}
                    return
            diffuse, emission = lobes(self.materials[material])
            if isinstance(diffuse, str):
                # In Mitsuba, v = 0 is the top row.
                upright = t().scale([1, -1, 1])
                reflectance = {"type": "bitmap", "filename": str(assets / diffuse), "to_uv": upright}
            else:
                reflectance = rgb(diffuse)
            shape["bsdf"] = {"type": "twosided", "b": {"type": "diffuse", "reflectance": reflectance}}
            if any(emission):
                shape["emitter"] = {"type": "area", "radiance": rgb(emission)}

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
        for i, (file, scale, turn, translation, material) in enumerate(self.meshes):
            to_world = t().translate(translation).rotate([0, 1, 0], turn).scale(scale)
            add("mesh", i, {"type": "ply", "filename": str(assets / file), "to_world": to_world}, material)
        for i, (position, intensity) in enumerate(self.points):
            scene[f"point{i}"] = {"type": "point", "position": position, "intensity": rgb(intensity)}
        if isinstance(self.environment, str):
            scene["environment"] = {"type": "envmap", "filename": str(assets / f"{self.environment}-mitsuba.exr")}
        elif self.environment:
            scene["environment"] = {"type": "constant", "radiance": rgb(self.environment)}
        return scene


def lobes(material):
    """The diffuse reflectance or the name of its texture, and the emitted radiance."""
    is_lamp = isinstance(material, tuple) and not isinstance(material[0], float)
    return material if is_lamp else (material, (0.0, 0.0, 0.0))


WALLS = [
    ([-1, 0, 1], [2, 0, 0], [0, 0, -2], "white"),
    ([-1, 2, -1], [2, 0, 0], [0, 0, 2], "white"),
    ([-1, 0, -1], [2, 0, 0], [0, 2, 0], "white"),
    ([-1, 0, 1], [0, 0, -2], [0, 2, 0], "red"),
    ([1, 0, -1], [0, 0, 2], [0, 2, 0], "green"),
]
COLORS = {"white": (0.73, 0.71, 0.68), "red": (0.63, 0.06, 0.05), "green": (0.13, 0.45, 0.09)}
BOX = dict(
    position=(0, 1, 4.4),
    look_at=(0, 1, 0),
    fov=34,
    materials={**COLORS, "lamp": ((0.8, 0.8, 0.8), (17.0, 15.5, 12.5)), "gold": (0.7, 0.55, 0.2)},
    quads=WALLS + [([-0.3, 1.98, -0.3], [0.6, 0, 0], [0, 0, 0.6], "lamp")],
)
BLOCKS = [([-0.35, 0.6, -0.32], [0.6, 1.2, 0.6], 18, "white"), ([0.36, 0.3, 0.34], [0.6, 0.6, 0.6], -17, "white")]
BALLS = [
    ([-1.4, 0.7, 0], 0.7, "red"),
    ([0.2, 0.9, -0.8], 0.9, "blue"),
    ([1.5, 0.5, 0.5], 0.5, "gold"),
    ([-0.4, 0.35, 1.3], 0.35, "gold"),
    ([0.7, 0.25, 1.7], 0.25, "blue"),
]
PAINTS = {"floor": (0.6, 0.6, 0.6), "red": (0.7, 0.2, 0.15), "blue": (0.2, 0.3, 0.7), "gold": (0.7, 0.55, 0.2)}
FLOOR = ([-10, 0, 10], [20, 0, 0], [0, 0, -20], "floor")
DEPTH = 8

# A mirror ball and a glass ball under a small light, for photons.
CAUSTIC = Scene(
    name="B caustic",
    anchor=None,
    max_depth=DEPTH,
    spheres=[([-0.42, 0.42, -0.38], 0.42, "steel"), ([0.44, 0.36, 0.32], 0.36, "crystal")],
    **{
        **BOX,
        "materials": {
            **COLORS,
            "lamp": ((0.8, 0.8, 0.8), (150.0, 137.0, 110.0)),
            "steel": {"mirror": 0.92},
            "crystal": {"glass": 1.5},
        },
        "quads": WALLS + [([-0.1, 1.98, -0.1], [0.2, 0, 0], [0, 0, 0.2], "lamp")],
    },
)

SCENES = [
    Scene(name="A1 quad light", anchor=1.2e-5, boxes=BLOCKS, **BOX),
    Scene(
        name="D point",
        anchor=7.7e-7,
        position=(0, 2.2, 6),
        look_at=(0, 0.7, 0),
        fov=40,
        materials=PAINTS,
        quads=[FLOOR],
        spheres=BALLS,
        points=[([2.5, 5, 3], [60, 60, 60])],
    ),
    Scene(name="A all light", anchor=5.5e-4, boxes=BLOCKS, max_depth=6, **BOX),
    Scene(
        name="C lens",
        anchor=None,
        position=(0, 1.6, 5),
        look_at=(0, 0.6, 0),
        fov=36,
        aperture=0.12,
        focus=4.6,
        materials={
            "floor": "board.png",
            "wall": "marble.png",
            "stone": "marble.png",
            **{name: PAINTS[name] for name in ("red", "blue", "gold")},
            "lamp": ((0.8, 0.8, 0.8), (14.0, 13.0, 11.0)),
        },
        quads=[
            ([-3, 0, 3], [6, 0, 0], [0, 0, -6], "floor"),
            ([-3, 0, -3], [6, 0, 0], [0, 3, 0], "wall"),
            ([-1, 4, -0.5], [2, 0, 0], [0, 0, 2], "lamp"),
        ],
        boxes=[([0, 0.5, -1.6], [0.9, 1.0, 0.9], 30, "gold"), ([1.3, 0.3, 0.2], [0.6, 0.6, 0.6], -20, "blue")],
        spheres=[
            ([-1.2, 0.5, 0], 0.5, "red"),
            ([0.1, 0.3, 1.4], 0.3, "gold"),
            ([-0.7, 0.2, 2.2], 0.2, "blue"),
            ([1.9, 0.6, -1.4], 0.6, "red"),
        ],
        max_depth=DEPTH,
    ),
    Scene(
        name="N sky",
        anchor=None,
        position=(0, 2.2, 6),
        look_at=(0, 0.7, 0),
        fov=40,
        materials=PAINTS,
        quads=[FLOOR],
        boxes=[([-2.6, 0.6, -1.2], [0.8, 1.2, 0.8], 25, "floor")],
        spheres=BALLS,
        environment="sky",
        max_depth=DEPTH,
    ),
    Scene(
        name="E knot in the box",
        anchor=1.1e-3,
        meshes=[("knot.ply", 1.6, 20, [0, 0.7, 0], "gold")],
        max_depth=DEPTH,
        **BOX,
    ),
    Scene(
        name="E knot outside",
        anchor=None,
        position=(0, 2.2, 4),
        look_at=(0, 0.5, 0),
        fov=34,
        materials={**PAINTS, "lamp": ((0.8, 0.8, 0.8), (12.0, 11.0, 9.0))},
        quads=[FLOOR, ([0.5, 4, -0.5], [1.5, 0, 0], [0, 0, 1.5], "lamp")],
        meshes=[("knot.ply", 2.4, 20, [0, 0.6, 0], "gold")],
        environment=(0.35, 0.45, 0.6),
        max_depth=DEPTH,
    ),
]
