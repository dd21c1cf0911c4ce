"""Compares the time that Canaletto, Mitsuba 3 and Blender's Cycles take to the same error.

    python3 equal_error.py CANALETTO [--size N] [--seeds N] [--error E] [--samples N ...] [--converged N]
                           [--sampler NAME] [--scenes NAME ...] [--pictures FOLDER]

Needs `pip install mitsuba bpy`, and LLVM for Mitsuba's `llvm_ad_rgb`. The scenes are those of `scenes.py`, without the
medium and smooth surfaces. The programs take turns with each seed and number of samples. The reference is the mean of two
pictures of Canaletto with `--converged` samples, whose own error is taken away. In `glass` and `standard`, whose surfaces
are each program's own, it is the program's own picture. A pixel's error is its difference from the reference over the
reference, whose square has a hundredth of the squared mean added. A picture's error is the root of the mean square. A line
fitted through the logarithms of time and error tells the time to the error `--error`.

Time is CPU seconds of all threads. Mitsuba's and Cycles' scenes are loaded and compiled before. Canaletto's time includes
the start of the program, reading the scene and writing the picture.
"""

import argparse
import os
import sys
import tempfile

import numpy as np

try:
    import bpy
    import mitsuba as mi
    from mathutils import Matrix
except ImportError as missing:
    sys.exit(f"equal_error: {missing}; pip install mitsuba bpy")

from scenes import GOLD, SCENES, Canaletto, Mitsuba, cpu_seconds, write_image


def z_up(p):
    """A point of a scene whose up is y, in Blender's axes, whose up is z."""
    return (p[0], -p[2], p[1])


class Cycles:
    """A scene in Blender's memory."""

    def __init__(self, scene, folder, size):
        self.folder = folder
        bpy.ops.wm.read_factory_settings(use_empty=True)
        target = self.target = bpy.context.scene
        target.render.engine = "CYCLES"
        target.render.resolution_x = target.render.resolution_y = size
        target.render.resolution_percentage = 100
        target.render.image_settings.file_format = "OPEN_EXR"
        target.render.image_settings.color_depth = "32"
        target.render.use_persistent_data = True
        cycles = target.cycles
        cycles.device = "CPU"
        cycles.use_adaptive_sampling = cycles.use_denoising = False
        cycles.pixel_filter_type = "BOX"
        # The width of the filter is in pixels.
        cycles.filter_width = 1.0
        cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
        cycles.blur_glossy = 0.0
        cycles.caustics_reflective = cycles.caustics_refractive = True
        for name in ("max", "diffuse", "glossy", "transmission", "transparent_max", "volume"):
            setattr(cycles, f"{name}_bounces", 1024)
        cycles.light_sampling_threshold = 0.0
        target.view_settings.view_transform = "Raw"
        self.texture = None
        if scene.texture is not None:
            self.texture = bpy.data.images.load(write_image(scene.texture, folder, "paint.exr"))
            self.texture.colorspace_settings.name = "Non-Color"
        self.materials = {name: self.material(name, material) for name, material in scene.materials.items()}
        for kind, name, shape in scene.shapes:
            self.shape(kind, shape).data.materials.append(self.materials[name])
        self.world(scene)
        self.camera(scene)

    def world(self, scene):
        world = bpy.data.worlds.new("world")
        self.target.world = world
        world.use_nodes = True
        background = next(n for n in world.node_tree.nodes if n.type == "BACKGROUND")
        background.inputs["Color"].default_value = (0, 0, 0, 1)
        if scene.image is not None:
            nodes = world.node_tree.nodes
            texture = nodes.new("ShaderNodeTexEnvironment")
            texture.image = bpy.data.images.load(write_image(scene.image, self.folder, "sky.exr"))
            texture.image.colorspace_settings.name = "Non-Color"
            mapping, coordinates = nodes.new("ShaderNodeMapping"), nodes.new("ShaderNodeTexCoord")
            # Our image begins at a quarter turn from Blender's.
            mapping.inputs["Rotation"].default_value = (0, 0, np.radians(SKY_TURN))
            links = world.node_tree.links
            links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
            links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
            links.new(texture.outputs["Color"], background.inputs["Color"])

    def camera(self, scene):
        camera = bpy.data.cameras.new("camera")
        camera.sensor_fit = "VERTICAL"
        camera.angle = np.radians(scene.fovy)
        camera.clip_start = 1e-3
        camera.clip_end = 1e4
        thing = bpy.data.objects.new("camera", camera)
        eye, center = (np.array(z_up(p), float) for p in (scene.eye, scene.center))
        back = (eye - center) / np.linalg.norm(eye - center)
        right = np.cross((0, 0, 1), back)
        right /= np.linalg.norm(right)
        matrix = np.eye(4)
        matrix[:3, :] = np.column_stack([right, np.cross(back, right), back, eye])
        thing.matrix_world = Matrix(matrix.tolist())
        self.target.collection.objects.link(thing)
        self.target.camera = thing

    def material(self, name, material):
        made = bpy.data.materials.new(name)
        made.use_nodes = True
        nodes, links = made.node_tree.nodes, made.node_tree.links
        nodes.clear()
        output = nodes.new("ShaderNodeOutputMaterial")
        color = lambda values: (*map(float, values), 1.0)
        # Cycles' roughness is the root of α.
        rough = np.sqrt(material.get("alpha", 0.0))
        if material["kind"] == "matte":
            if material["emission"]:
                # The lamps reflect nothing and shine from their outer side.
                shader = nodes.new("ShaderNodeEmission")
                shader.inputs["Color"].default_value = color(material["emission"])
                front = nodes.new("ShaderNodeMath")
                front.operation = "SUBTRACT"
                front.inputs[0].default_value = 1.0
                links.new(nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"], front.inputs[1])
                links.new(front.outputs[0], shader.inputs["Strength"])
                made.cycles.emission_sampling = "FRONT"
            else:
                shader = nodes.new("ShaderNodeBsdfDiffuse")
                shader.inputs["Color"].default_value = color(material["color"])
        elif material["kind"] == "standard":
            shader = nodes.new("ShaderNodeBsdfPrincipled")
            shader.inputs["Metallic"].default_value = material["metalness"]
            shader.inputs["Roughness"].default_value = material["roughness"]
            image = nodes.new("ShaderNodeTexImage")
            image.image = self.texture
            links.new(image.outputs["Color"], shader.inputs["Base Color"])
        elif material["kind"] == "glass":
            shader = nodes.new("ShaderNodeBsdfGlass")
            shader.distribution = "GGX"
            shader.inputs["IOR"].default_value = material["ior"]
            shader.inputs["Roughness"].default_value = rough
        else:
            shader = nodes.new("ShaderNodeBsdfMetallic")
            shader.distribution = "GGX"
            shader.fresnel_type = "PHYSICAL_CONDUCTOR"
            shader.inputs["IOR"].default_value = GOLD["eta"]
            shader.inputs["Extinction"].default_value = GOLD["k"]
            shader.inputs["Roughness"].default_value = rough
        links.new(shader.outputs[0], output.inputs["Surface"])
        return made

    def shape(self, kind, shape):
        if kind == "box":
            low, high = np.array(shape["low"], float), np.array(shape["high"], float)
            bpy.ops.mesh.primitive_cube_add(size=1, location=z_up((low + high) / 2))
            thing = bpy.context.object
            thing.scale = np.abs(z_up(high - low))
        elif kind == "sphere":
            bpy.ops.mesh.primitive_uv_sphere_add(
                segments=128, ring_count=64, radius=shape["radius"], location=z_up(shape["center"])
            )
            bpy.ops.object.shade_smooth()
            thing = bpy.context.object
        elif kind == "mesh":
            data = bpy.data.meshes.new("mesh")
            data.from_pydata([z_up(p) for p in shape["vertices"].tolist()], [], shape["faces"].tolist())
            thing = bpy.data.objects.new("mesh", data)
            self.target.collection.objects.link(thing)
        else:
            turn = (0, 0, 0) if shape["up"] > 0 else (np.pi, 0, 0)
            location = z_up(shape["center"])
            bpy.ops.mesh.primitive_circle_add(
                vertices=256, radius=shape["radius"], fill_type="NGON", location=location, rotation=turn
            )
            thing = bpy.context.object
        return thing

    def render(self, samples, seed):
        self.target.cycles.samples = samples
        self.target.cycles.seed = seed
        path = os.path.join(self.folder, "cycles.exr")
        self.target.render.filepath = path
        with Silence():
            bpy.ops.render.render(write_still=True)
        return np.array(mi.Bitmap(path))[:, :, :3].astype(float)


# The angle in degrees by which a sky of ours is turned about the vertical for Blender.
SKY_TURN = -90.0


class Silence:
    """Sends what a library writes to standard output nowhere."""

    def __enter__(self):
        sys.stdout.flush()
        self.saved = os.dup(1)
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.close(nowhere)

    def __exit__(self, *_):
        os.dup2(self.saved, 1)
        os.close(self.saved)


def measured(renderer, samples, seed):
    start = cpu_seconds()
    picture = renderer.render(samples, seed)
    return picture, cpu_seconds() - start


def time_to(error, times, errors):
    """The time at an error, by a line through the logarithms."""
    slope, offset = np.polyfit(np.log(errors), np.log(times), 1)
    return float(np.exp(offset + slope * np.log(error)))


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("program")
    arguments.add_argument("--size", type=int, default=128)
    arguments.add_argument("--seeds", type=int, default=2)
    arguments.add_argument("--error", type=float, default=0.05)
    arguments.add_argument("--samples", type=int, nargs="+", default=[16, 64, 256])
    arguments.add_argument("--converged", type=int, default=1024)
    arguments.add_argument("--sampler", default="multijitter")
    arguments.add_argument("--pictures", help="a folder for the pictures of the first seed")
    arguments.add_argument("--scenes", nargs="+", default=[name for name in SCENES if name not in ("medium", "smooth")])
    options = arguments.parse_args()
    mi.set_variant("llvm_ad_rgb")
    print(f"time in CPU seconds to the error {options.error}, {options.size} x {options.size} pixels; "
          f"Mitsuba {mi.__version__} with {options.sampler}, Cycles {bpy.app.version_string}")
    print(f"{'scene':9} {'renderer':10} {'time':>7} {'of ours':>8} {'samples/s':>10} {'variance':>10} {'mean':>8}")
    for name in options.scenes:
        with tempfile.TemporaryDirectory() as folder:
            scene = SCENES[name]()
            ours = Canaletto(scene, options.program, folder, options.size)
            renderers = {
                "Canaletto": ours,
                "Mitsuba": Mitsuba(scene, options.size, options.sampler),
                "Cycles": Cycles(scene, folder, options.size),
            }
            seeds = (1001, 1002)
            references = {"Canaletto": [ours.render(options.converged, seed) for seed in seeds]}
            for key, renderer in renderers.items():
                if key not in references:
                    own = [renderer.render(options.converged, seed) for seed in seeds] if scene.differs else None
                    references[key] = own or references["Canaletto"]
            compare(name, renderers, references, options)


def compare(name, renderers, references, options):
    """Prints a line for each renderer."""
    middle, scale, own = {}, {}, {}
    for key, (a, b) in references.items():
        middle[key] = (a + b) / 2
        scale[key] = middle[key] ** 2 + 0.01 * middle[key].mean() ** 2
        own[key] = ((a - b) ** 2 / 4 / scale[key]).mean()
    times = {key: [] for key in renderers}
    errors = {key: [] for key in renderers}
    means = {key: [] for key in renderers}
    for samples in options.samples:
        # Mitsuba compiles for each number of samples.
        renderers["Mitsuba"].render(samples, 0)
        runs = {key: [] for key in renderers}
        for seed in range(1, options.seeds + 1):
            for key, renderer in renderers.items():
                runs[key].append(measured(renderer, samples, seed))
        for key, taken in runs.items():
            squares = [((picture - middle[key]) ** 2 / scale[key]).mean() - own[key] for picture, _ in taken]
            errors[key].append(np.sqrt(np.mean(squares)))
            times[key].append(np.median([seconds for _, seconds in taken]))
            means[key].append(np.mean([picture.mean() for picture, _ in taken]))
            if options.pictures:
                path = os.path.join(options.pictures, f"{name}-{key}-{samples}.exr")
                mi.Bitmap(taken[0][0].astype(np.float32)).write(path)
    reached = {key: time_to(options.error, times[key], errors[key]) for key in renderers}
    for key in renderers:
        most = options.samples[-1]
        rate = most * options.size**2 / times[key][-1]
        variance = errors[key][-1] ** 2 * most
        print(f"{name:9} {key:10} {reached[key]:7.2f} {reached[key] / reached['Canaletto']:7.2f}x {rate:10.0f} "
              f"{variance:10.3f} {means[key][-1] / middle[key].mean():8.4f}", flush=True)


if __name__ == "__main__":
    main()
