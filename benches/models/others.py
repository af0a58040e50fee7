"""Runs the model benchmark with other programs: a 512 × 512 image of a model, with a new process for each run.

    python3 -m venv others && others/bin/pip install f3d bpy
    others/bin/python benches/models/others.py MODEL [f3d] [blender]

f3d rasterizes; Blender renders with Cycles on the CPU with 64 samples, without denoising. Both are on PyPI. `bpy` needs the Python
version of its wheel.
"""

import subprocess
import sys
import time

RUNS = 5

F3D = """
import f3d, sys
f3d.Engine.autoload_plugins()
engine = f3d.Engine.create(offscreen=True)
engine.scene.add(sys.argv[1])
engine.window.size = 512, 512
engine.window.render_to_image().save("f3d.png")
"""

BLENDER = """
import bpy, os, sys
from mathutils import Vector
bpy.ops.wm.read_factory_settings(use_empty=True)
name = sys.argv[1]
ending = name.rsplit(".", 1)[-1].lower()
if ending in ("glb", "gltf"):
    bpy.ops.import_scene.gltf(filepath=name)
else:
    {"ply": bpy.ops.wm.ply_import, "stl": bpy.ops.wm.stl_import, "obj": bpy.ops.wm.obj_import}[ending](filepath=name)
scene = bpy.context.scene
points = [o.matrix_world @ Vector(c) for o in scene.objects if o.type == "MESH" for c in o.bound_box]
middle = sum(points, Vector()) / len(points)
size = max((p - middle).length for p in points)
camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
scene.collection.objects.link(camera)
camera.location = middle + Vector((0.8, -1.0, 0.62)).normalized() * size * 4
camera.rotation_euler = (middle - camera.location).to_track_quat("-Z", "Y").to_euler()
scene.camera = camera
sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
scene.collection.objects.link(sun)
sun.rotation_euler = (0.7, 0.2, 0.3)
world = bpy.data.worlds.new("sky")
world.color = (0.5, 0.5, 0.5)
scene.world = world
scene.render.engine = "CYCLES"
scene.cycles.samples = 64
scene.cycles.use_denoising = False
scene.render.resolution_x = scene.render.resolution_y = 512
scene.render.filepath = os.path.abspath("blender.png")
bpy.ops.render.render(write_still=True)
"""


def seconds(script, model):
    begin = time.perf_counter()
    subprocess.run([sys.executable, "-c", script, model], check=True, capture_output=True)
    return time.perf_counter() - begin


def main():
    model, names = sys.argv[1], sys.argv[2:] or ["f3d", "blender"]
    for name in names:
        runs = sorted(seconds({"f3d": F3D, "blender": BLENDER}[name], model) for _ in range(RUNS))
        print(f"{name}: {runs[0]:.2f} {runs[len(runs) // 2]:.2f} {runs[-1]:.2f} s (minimum, median, maximum of {RUNS})")


main()
