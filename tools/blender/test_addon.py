"""Tests of the add-on with Blender's Python module, against Cycles:

    python -m venv venv && venv/bin/pip install bpy
    venv/bin/python tools/blender/test_addon.py target/release/photonmill
"""

import math
import os
import sys
import tempfile
import unittest

import bpy

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import photonmill

PROGRAM = "photonmill"
SIZE = 48
QUICK = ["--error", "1%", "--time", "60s"]
COARSE = ["--texels-per-metre", "3", "--photons", "20000", "--rounds", "2"]


def material(name, colour):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    shader = made.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*colour, 1)
    shader.inputs["Roughness"].default_value = 1
    shader.inputs["Specular IOR Level"].default_value = 0
    return made


def fresh():
    """A floor with a ball on it, seen from above the front, no emitter."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=6)
    floor = bpy.context.object
    floor.name = "floor"
    floor.data.materials.append(material("grey", (0.6, 0.5, 0.4)))
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.6, location=(0.8, 0.4, 0.6), segments=48, ring_count=24)
    bpy.ops.object.shade_smooth()
    bpy.context.object.data.materials.append(material("blue", (0.2, 0.3, 0.8)))
    bpy.ops.object.camera_add(location=(0, -5, 4), rotation=(math.radians(52), 0, 0))
    scene.camera = bpy.context.object
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    set_world((0, 0, 0))
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    return scene


def set_world(colour, strength=1.0):
    node = bpy.context.scene.world.node_tree.nodes["Background"]
    node.inputs["Color"].default_value = (*colour, 1)
    node.inputs["Strength"].default_value = strength


def lamp(kind, energy, location, rotation=(0, 0, 0), **settings):
    bpy.ops.object.light_add(type=kind, location=location, rotation=rotation)
    made = bpy.context.object
    made.data.energy = energy
    for name, value in settings.items():
        setattr(made.data, name, value)
    return made


def pixels(image):
    """Rows of pixels, the lowest first, red, green and blue each."""
    width, height = image.size
    values = list(image.pixels)
    step = image.channels
    return [[tuple(values[step * (row * width + column):][:3]) for column in range(width)] for row in range(height)]


def by_cycles(scene, folder, samples=512, bounces=16):
    scene.render.engine = "CYCLES"
    scene.cycles.samples = samples
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    scene.cycles.sample_clamp_indirect = 0
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = bounces
    scene.cycles.pixel_filter_type = "BOX"
    scene.render.filepath = os.path.join(folder, "cycles.exr")
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    bpy.ops.render.render(write_still=True, scene=scene.name)
    return bpy.data.images.load(scene.render.filepath, check_existing=False)


def images(scene):
    """Lightmaps of a scene's materials, by name."""
    nodes = [node for thing in scene.objects if thing.type == "MESH" for slot in thing.material_slots for node in slot.material.node_tree.nodes]
    return {node.image.name: node.image for node in nodes if node.type == "TEX_IMAGE"}


def shown(scene):
    """The mean of each of them."""
    mean = lambda values: sum(values) / len(values)
    return {name: mean([value for row in pixels(image) for pixel in row for value in pixel]) for name, image in images(scene).items()}


def blocks(image, count=6):
    """Means of count x count parts, each of three channels."""
    rows = pixels(image)
    side = len(rows) // count
    mean = lambda i, j, k: sum(rows[j * side + y][i * side + x][k] for y in range(side) for x in range(side)) / side**2
    return [mean(i, j, k) for j in range(count) for i in range(count) for k in range(3)]


class AddOn(unittest.TestCase):
    def setUp(self):
        self.scene = fresh()
        self.folder = tempfile.TemporaryDirectory()

    def tearDown(self):
        self.folder.cleanup()

    def compare(self, within_mean=0.015, within_block=0.06, arguments=QUICK):
        own = photonmill.render(self.scene, self.folder.name, PROGRAM, arguments)
        self.agree(blocks(own), blocks(by_cycles(self.scene, self.folder.name)), within_mean, within_block)

    def agree(self, own, cycles, within_mean, within_block):
        total = sum(own) / sum(cycles)
        brightest = max(cycles)
        worst = max(abs(a - b) / max(b, 0.05 * brightest) for a, b in zip(own, cycles))
        print(f"{self.id()}: {total:.4f} of Cycles' light, blocks within {worst:.3f}")
        self.assertLess(abs(total - 1), within_mean)
        self.assertLess(worst, within_block)

    def test_area_lamps_become_panels_of_their_power(self):
        shapes = [("SQUARE", 1, 1), ("RECTANGLE", 2, 0.5), ("DISK", 1, 1), ("ELLIPSE", 1.5, 0.4)]
        for shape, x, y in shapes:
            with self.subTest(shape):
                self.scene = fresh()
                made = lamp("AREA", 120, (-0.5, 0, 2.5), (0.2, -0.3, 0.4), shape=shape, size=x, size_y=y, color=(1, 0.7, 0.4))
                made.scale = (1.5, 1, 1)
                self.compare()

    def test_lamps_of_gltf_have_their_power(self):
        for kind, energy, settings in [("POINT", 150, {"shadow_soft_size": 0}), ("SUN", 2, {"angle": 0}), ("SPOT", 400, {"shadow_soft_size": 0, "spot_size": 1.2, "spot_blend": 0})]:
            with self.subTest(kind):
                self.scene = fresh()
                lamp(kind, energy, (-1, -0.5, 3), (0.3, -0.3, 0), **settings)
                # The edge of a sharp cone lies within pixels.
                self.compare(0.02, 0.12)

    def test_a_world_of_one_colour_lights(self):
        set_world((0.5, 0.7, 1.0), 0.8)
        self.compare()

    def test_a_turned_picture_lights_from_where_it_is_bright(self):
        picture = bpy.data.images.new("sky", 64, 32, float_buffer=True)
        values = []
        for row in range(32):
            for column in range(64):
                sun = 60.0 if 18 <= row < 22 and 40 <= column < 44 else 0.0
                values += [0.2 + sun, 0.4 * row / 32 + 0.8 * sun, 0.5 * column / 64 + 0.5 * sun, 1]
        picture.pixels = values
        picture.pack()
        nodes, link = self.scene.world.node_tree.nodes, self.scene.world.node_tree.links.new
        sky, turn, place = nodes.new("ShaderNodeTexEnvironment"), nodes.new("ShaderNodeMapping"), nodes.new("ShaderNodeTexCoord")
        sky.image = picture
        turn.inputs["Rotation"].default_value = (0, 0, 1.1)
        link(place.outputs["Generated"], turn.inputs["Vector"])
        link(turn.outputs["Vector"], sky.inputs["Vector"])
        link(sky.outputs["Color"], nodes["Background"].inputs["Color"])
        self.compare(0.02, 0.08)

    def test_the_scene_stays_as_it_was(self):
        lamp("AREA", 50, (0, 0, 2))
        state = lambda: {name: sorted(thing.name for thing in getattr(bpy.data, name)) for name in ("objects", "meshes", "materials", "scenes", "cameras", "lights", "worlds")}
        before, selected = state(), [thing.name for thing in bpy.context.selected_objects]
        photonmill.export(self.scene, self.folder.name)
        self.assertEqual(before, state())
        self.assertEqual(selected, [thing.name for thing in bpy.context.selected_objects])
        self.assertEqual(self.scene.world.name, "world")
        # Where it cannot write, too.
        with self.assertRaises(Exception):
            photonmill.export(self.scene, "/proc/nowhere")
        self.assertEqual(before, state())

    def test_failures_are_one_line(self):
        lamp("AREA", 50, (0, 0, 2))
        for program, arguments, words in [("/nowhere/photonmill", [], "preferences"), (PROGRAM, ["--photons", "none"], "--photons")]:
            with self.assertRaises(photonmill.Failure) as caught:
                photonmill.render(self.scene, self.folder.name, program, arguments)
            self.assertIn(words, str(caught.exception))
            self.assertNotIn("\n", str(caught.exception))

    def test_lightmaps_come_back(self):
        lamp("AREA", 120, (0, 0, 2.5), size=1)
        reference = blocks(by_cycles(self.scene, self.folder.name))
        kept = self.scene.objects["floor"].data.materials[0]
        links = len(kept.node_tree.links)
        baked = photonmill.bake(self.scene, self.folder.name, PROGRAM, ["--texels-per-metre", "24", "--error", "2%", "--time", "100s"])
        self.assertEqual(len(kept.node_tree.links), links)
        self.assertIn("floor", self.scene.objects)
        baked.render.resolution_x = baked.render.resolution_y = SIZE
        baked.render.resolution_percentage = 100
        bpy.context.window.scene = baked if bpy.context.window else baked
        baked.world = None
        self.agree(blocks(by_cycles(baked, self.folder.name, 32, 0)), reference, 0.03, 0.15)

    def test_a_second_bake_shows_its_own_light(self):
        made = lamp("AREA", 120, (0, 0, 2.5), size=1)
        first = photonmill.bake(self.scene, self.folder.name, PROGRAM, COARSE)
        before = shown(first)
        made.data.energy = 1200
        second = photonmill.bake(self.scene, self.folder.name, PROGRAM, COARSE)
        self.assertEqual(before, shown(first))
        after = shown(second)
        self.assertTrue(before and not before.keys() & after.keys())
        floor = lambda lights: next(light for name, light in lights.items() if name.startswith("floor"))
        self.assertAlmostEqual(floor(after) / floor(before), 10, delta=0.1)

    def test_objects_without_a_material_show_their_light(self):
        lamp("AREA", 120, (0, 0, 2.5), size=1)
        self.scene.objects["floor"].data.materials.clear()
        bpy.ops.mesh.primitive_cube_add(size=0.5, location=(-1, 0, 0.25))
        bpy.context.object.data.materials.append(None)
        baked = photonmill.bake(self.scene, self.folder.name, PROGRAM, COARSE)
        self.assertLessEqual({"floor", "Sphere", "Cube"}, {name.split(".")[0] for name in images(baked)})

    def test_instances_of_one_node_have_light_of_their_own(self):
        mesh = bpy.data.meshes.new("square")
        mesh.from_pydata([(0, 0, 0), (1, 0, 0), (1, 1, 0)], [], [(0, 1, 2)])
        mesh.uv_layers.new(name="first")
        mesh.uv_layers.new(name="second")
        parent = bpy.data.objects.new("parent", None)
        children = [bpy.data.objects.new(f"Node_{k}", mesh) for k in (0, 1, 10, 2)]
        for child in children:
            child.parent = parent
        self.assertEqual(photonmill.lightmaps_of(parent), [])
        parent[photonmill.KEY] = [{"irradiance": f"{k}.exr"} for k in range(3)]
        found = [(thing.name, lightmap["irradiance"]) for thing, lightmap in photonmill.lightmaps_of(parent)]
        self.assertEqual(found, [("Node_1", "0.exr"), ("Node_10", "1.exr"), ("Node_2", "2.exr")])
        parent[photonmill.KEY] = [{"irradiance": f"{k}.exr"} for k in range(5)]
        with self.assertRaisesRegex(photonmill.Failure, "parent has 5 lightmaps but 4 instances"):
            photonmill.lightmaps_of(parent)

    def test_sizes_of_lamps_that_gltf_leaves_out_are_named(self):
        lamp("AREA", 120, (0, 0, 2.5), size=1)
        lamp("POINT", 10, (0, 0, 2), shadow_soft_size=0)
        self.assertEqual(photonmill.warn_of_sharp_lamps(self.scene), [])
        for name, kind, settings in [("bulb", "POINT", {"shadow_soft_size": 0.2}), ("beam", "SPOT", {"shadow_soft_size": 0.1}), ("sun", "SUN", {"angle": 0.01})]:
            lamp(kind, 10, (0, 0, 2), **settings).name = name
        [warning] = photonmill.warn_of_sharp_lamps(self.scene)
        self.assertIn("'beam', 'bulb', 'sun'", warning)

    def test_what_is_finished_is_kept(self):
        lamp("AREA", 120, (0, 0, 2.5), size=1)
        line, result = photonmill.command(self.scene, "render", self.folder.name, PROGRAM, ["--photons", "2000", "--rounds", "1000000"], 16)
        run = photonmill.Run(line)
        while run.share == 0:
            self.assertFalse(run.poll(0.1))
        run.stop()
        photonmill.finish(run)
        self.assertGreater(sum(blocks(photonmill.load_picture(self.scene, result))), 0)
        # At once where it is asked again.
        run = photonmill.Run(line)
        while run.share == 0:
            run.poll(0.1)
        run.stop()
        run.stop()
        self.assertIsNotNone(run.process.poll())

    def test_operators_work_without_a_window(self):
        photonmill.register()
        try:
            lamp("AREA", 120, (0, 0, 2.5), size=1)
            self.scene.photonmill.folder = self.folder.name
            report = os.path.join(self.folder.name, "the report.json")
            self.scene.photonmill.more = f"--photons 5000 --json '{report}'"
            self.scene.photonmill.minutes = 0.2
            os.environ["PATH"] = os.path.dirname(PROGRAM) + os.pathsep + os.environ["PATH"]
            bpy.ops.render.photonmill()
            self.assertIn("photonmill Scene", bpy.data.images)
            self.assertTrue(os.path.exists(report))
            self.scene.photonmill.more = "--json 'open"
            with self.assertRaisesRegex(RuntimeError, "close every quote"):
                bpy.ops.render.photonmill()
        finally:
            photonmill.unregister()


if __name__ == "__main__":
    if len(sys.argv) > 1 and not sys.argv[1].startswith("-"):
        PROGRAM = os.path.abspath(sys.argv.pop(1))
    unittest.main(verbosity=1)
