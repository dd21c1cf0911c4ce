"""Pictures of a model by whole processes: Canaletto, F3D and Blender; and reading it: Canaletto and trimesh.

    python3 bench/src/models.py target/release/canaletto model.glb [--rounds 5] [--python PYTHON]

Each round runs every program once, one after the other. The table has the median of the processor's time of each
process in user mode, and its peak memory. What isn't installed is left out:

    apt-get install f3d xvfb
    pip install bpy trimesh pillow        # bpy is Blender; PYTHON is the interpreter that has them
"""

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import tempfile

BLENDER = """
import sys, bpy, mathutils
source, target, side, samples, threads = sys.argv[1:6]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=source)
scene = bpy.context.scene
corners = [o.matrix_world @ mathutils.Vector(c) for o in scene.objects if o.type == 'MESH' for c in o.bound_box]
low = mathutils.Vector(min(c[i] for c in corners) for i in range(3))
high = mathutils.Vector(max(c[i] for c in corners) for i in range(3))
camera = bpy.data.objects.new('camera', bpy.data.cameras.new('camera'))
scene.collection.objects.link(camera)
camera.data.angle = 0.61
towards = mathutils.Vector((0.47, -0.81, 0.34))
camera.location = (low + high) / 2 + towards * (high - low).length * 1.6
camera.rotation_euler = towards.to_track_quat('Z', 'Y').to_euler()
scene.camera = camera
world = bpy.data.worlds.new('white')
scene.world = world
world.use_nodes = True
world.node_tree.nodes['Background'].inputs[0].default_value = (1, 1, 1, 1)
scene.render.engine = 'CYCLES'
scene.cycles.device = 'CPU'
scene.cycles.samples = int(samples)
scene.cycles.use_adaptive_sampling = False
scene.cycles.use_denoising = False
scene.render.threads_mode = 'FIXED'
scene.render.threads = int(threads)
scene.render.resolution_x = scene.render.resolution_y = int(side)
scene.render.filepath = target
bpy.ops.render.render(write_still=True)
"""

TRIMESH = """
import sys, trimesh
scene = trimesh.load(sys.argv[1])
for geometry in scene.geometry.values():
    geometry.vertices, geometry.faces
"""


def run(command):
    """The seconds in user mode and the peak memory in MiB of a process with its children; none if it fails."""
    with open(os.devnull, "w") as nothing:
        process = subprocess.Popen(command, stdout=nothing, stderr=nothing)
        _, status, usage = os.wait4(process.pid, 0)
    return (usage.ru_utime, usage.ru_maxrss / 1024) if status == 0 else None


def has(python, module):
    return subprocess.run([python, "-c", f"import {module}"], capture_output=True).returncode == 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("canaletto")
    parser.add_argument("model")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--python", default=sys.executable, help="the interpreter that has bpy and trimesh")
    flags = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        picture = os.path.join(folder, "out.png")
        script = {}
        for name, text in [("blender", BLENDER), ("trimesh", TRIMESH)]:
            script[name] = os.path.join(folder, f"{name}.py")
            with open(script[name], "w") as file:
                file.write(text)

        def ours(*more):
            return [flags.canaletto, "render", flags.model, "-o", picture, "-q", *more]

        def blender(side, samples, threads):
            return [flags.python, script["blender"], flags.model, picture, str(side), str(samples), str(threads)]

        one = ["--size", "256x256", "--samples", "64", "--threads", "1", "--denoise=none", "--light", "neutral"]
        thumbnail = ["--size", "512x512", "--threads", "2"]
        groups = [
            (
                "256 x 256, 64 samples, one thread",
                [("canaletto", ours(*one)), ("blender", blender(256, 64, 1))],
            ),
            (
                "512 x 512, two threads",
                [
                    ("canaletto draft", ours(*thumbnail, "--quality", "draft")),
                    ("canaletto good", ours(*thumbnail)),
                    ("f3d", ["xvfb-run", "-a", "f3d", flags.model, "--output", picture, "--resolution", "512,512"]),
                    ("blender, 64 samples", blender(512, 64, 2)),
                ],
            ),
            (
                "reading",
                [
                    ("canaletto info", [flags.canaletto, "info", flags.model, "--threads", "1"]),
                    ("trimesh", [flags.python, script["trimesh"], flags.model]),
                ],
            ),
        ]
        available = {
            "canaletto": True,
            "blender": has(flags.python, "bpy"),
            "trimesh": has(flags.python, "trimesh"),
            "f3d": bool(shutil.which("f3d") and shutil.which("xvfb-run")),
        }
        for title, programs in groups:
            programs = [(name, command) for name, command in programs if available[name.split()[0].strip(",")]]
            rounds = {name: [] for name, _ in programs}
            for _ in range(flags.rounds):
                for name, command in programs:
                    rounds[name].append(run(command))
            print(f"{title}\n{'':24}{'user s':>8} {'MiB':>7}")
            for name, results in rounds.items():
                if None in results:
                    print(f"{name:24}  fails")
                    continue
                seconds, memory = [statistics.median(values) for values in zip(*results)]
                print(f"{name:24}{seconds:8.2f} {memory:7.0f}")
            print()


if __name__ == "__main__":
    main()
