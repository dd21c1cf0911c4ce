"""Pictures of a model by whole processes: Canaletto, F3D and Blender; and reading it: Canaletto and trimesh.

    python3 bench/src/models.py target/release/canaletto model.glb [--rounds 5] [--python PYTHON]

Each round runs every program once, one after the other. The table has the median of the processor's time of each
process in user mode, and its peak memory. What isn't installed is left out:

    apt-get install f3d xvfb
    pip install bpy trimesh pillow        # bpy is Blender; PYTHON is the interpreter that has them

The last table is of 225 rings, whatever the model is: a node for each, one node with EXT_mesh_gpu_instancing, and one
mesh of all their triangles. The pictures are the same.
"""

import argparse
import array
import json
import math
import multiprocessing
import os
import shutil
import statistics
import struct
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


def ring(around=72, along=35):
    """Positions, normals and indices of a ring of 5,040 triangles."""
    positions, normals, indices = [], [], []
    for i in range(around):
        a = math.tau * i / around
        for j in range(along):
            b = math.tau * j / along
            normals.append((math.cos(b) * math.cos(a), math.sin(b), math.cos(b) * math.sin(a)))
            positions.append(tuple(0.15 * n + 0.3 * c for n, c in zip(normals[-1], (math.cos(a), 0, math.sin(a)))))
            near, far = i * along, (i + 1) % around * along
            k = (j + 1) % along
            indices += [near + j, near + k, far + j, far + j, near + k, far + k]
    return positions, normals, indices


def turned(quaternion, vector):
    """A vector, turned by a unit quaternion."""
    u, w = quaternion[:3], quaternion[3]

    def cross(a, b):
        return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]

    t = [2 * c for c in cross(u, vector)]
    return tuple(v + w * s + c for v, s, c in zip(vector, t, cross(u, t)))


def write_rings(path, how):
    """Writes a GLB of 15 x 15 rings and a camera: as nodes, instances or one merged mesh."""
    places = [(i - 7, 0, j - 7) for i in range(15) for j in range(15)]
    halves = [0.1 * i for i in range(225)]
    turns = [(math.sin(h) * 0.8, 0, math.sin(h) * 0.6, math.cos(h)) for h in halves]
    positions, normals, indices = ring()
    if how == "merged":
        copies = list(zip(places, turns))
        indices = [len(positions) * n + i for n in range(len(copies)) for i in indices]
        positions = [tuple(map(sum, zip(p, turned(q, v)))) for p, q in copies for v in positions]
        normals = [turned(q, v) for _, q in copies for v in normals]
    body, views, accessors = bytearray(), [], []

    def accessor(rows, shape, kind=5126, **more):
        flat = [c for row in rows for c in row] if shape != "SCALAR" else rows
        data = array.array("f" if kind == 5126 else "I", flat).tobytes()
        views.append({"buffer": 0, "byteOffset": len(body), "byteLength": len(data)})
        view = {"bufferView": len(views) - 1, "componentType": kind, "count": len(rows), "type": shape}
        accessors.append(view | more)
        body.extend(data)
        return len(accessors) - 1

    bounds = array.array("f", [end(axis) for end in (min, max) for axis in zip(*positions)])
    attributes = {
        "POSITION": accessor(positions, "VEC3", min=list(bounds[:3]), max=list(bounds[3:])),
        "NORMAL": accessor(normals, "VEC3"),
    }
    primitive = {"attributes": attributes, "indices": accessor(indices, "SCALAR", 5125), "material": 0}
    document = {"asset": {"version": "2.0"}, "scene": 0, "nodes": [{"mesh": 0}]}
    document["meshes"] = [{"primitives": [primitive]}]
    if how == "nodes":
        document["nodes"] = [{"mesh": 0, "translation": p, "rotation": q} for p, q in zip(places, turns)]
    if how == "instances":
        used = {"TRANSLATION": accessor(places, "VEC3"), "ROTATION": accessor(turns, "VEC4")}
        document["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": used}}
        document["extensionsUsed"] = document["extensionsRequired"] = ["EXT_mesh_gpu_instancing"]
    downwards = (-math.sin(0.4), 0, 0, math.cos(0.4))
    document["nodes"].append({"camera": 0, "translation": (0, 13, 13), "rotation": downwards})
    document["scenes"] = [{"nodes": list(range(len(document["nodes"])))}]
    view = {"yfov": 0.8, "aspectRatio": 1, "znear": 0.1}
    document["cameras"] = [{"type": "perspective", "perspective": view}]
    surface = {"baseColorFactor": [0.8, 0.6, 0.4, 1], "metallicFactor": 0, "roughnessFactor": 0.5}
    document["materials"] = [{"pbrMetallicRoughness": surface}]
    document |= {"buffers": [{"byteLength": len(body)}], "bufferViews": views, "accessors": accessors}
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    with open(path, "wb") as file:
        file.write(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(body)))
        file.write(struct.pack("<I4s", len(text), b"JSON") + text)
        file.write(struct.pack("<I4s", len(body), b"BIN\0") + body)


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

        rings = ["--size", "256x256", "--samples", "16", "--threads", "1", "--denoise=none", "--light", "neutral"]
        copies = []
        for how in ["nodes", "instances", "merged"]:
            file = os.path.join(folder, f"{how}.glb")
            # Another process makes the file: a program's peak memory is at least that of the process that starts it.
            maker = multiprocessing.Process(target=write_rings, args=(file, how))
            maker.start()
            maker.join()
            command = [flags.canaletto, "render", file, "-o", picture, "-q", "--ground", "none", *rings]
            copies.append((f"canaletto, {how}", command))
        # Blender has no floor.
        one = ["--size", "256x256", "--samples", "64", "--threads", "1", "--denoise=none", "--light", "neutral"]
        one += ["--ground", "none"]
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
            ("225 rings, 256 x 256, 16 samples, one thread", copies),
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
