"""Writes tests/scenes/blender.glb with Blender, as any user's exporter would: a room with a textured
floor, a mirror ball, a glass ball, an emissive panel, a point, a spot and a sun light, a camera.

    pip install bpy && python tools/make_blender_scene.py tests/scenes/blender.glb
"""

import math
import sys

import bpy


def material(name, colour=(0.8, 0.8, 0.8), **inputs):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    shader = made.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*colour, 1)
    for key, value in inputs.items():
        shader.inputs[key.replace("_", " ")].default_value = value
    return made


def solid(made):
    """Glass with an inside: Blender writes a volume only where a thickness is given."""
    group = bpy.data.node_groups.new("glTF Material Output", "ShaderNodeTree")
    group.interface.new_socket("Thickness", in_out="INPUT", socket_type="NodeSocketFloat")
    node = made.node_tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    node.inputs["Thickness"].default_value = 1.0
    return made


def assign(thing, made):
    thing.data.materials.append(made)
    thing.name = made.name + " object"
    return thing


def checker():
    """A floor of 8 x 8 tiles, 64 x 64 pixels, packed into the file."""
    picture = bpy.data.images.new("tiles", 64, 64)
    tile = lambda i, j: 0.9 if (i // 8 + j // 8) % 2 else 0.25
    picture.pixels = [c for j in range(64) for i in range(64) for c in (tile(i, j), tile(i, j), 0.6 * tile(i, j), 1)]
    picture.pack()
    made = material("tiles", Roughness=1.0)
    node = made.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = picture
    made.node_tree.links.new(node.outputs["Color"], made.node_tree.nodes["Principled BSDF"].inputs["Base Color"])
    return made


def light(name, kind, energy, location, rotation=(0, 0, 0), **settings):
    made = bpy.data.lights.new(name, kind)
    made.energy = energy
    for key, value in settings.items():
        setattr(made, key, value)
    thing = bpy.data.objects.new(name, made)
    thing.location, thing.rotation_euler = location, rotation
    bpy.context.collection.objects.link(thing)


bpy.ops.wm.read_factory_settings(use_empty=True)
primitives = bpy.ops.mesh

primitives.primitive_plane_add(size=4)
assign(bpy.context.object, checker())
primitives.primitive_plane_add(size=4, location=(0, 2, 2), rotation=(math.pi / 2, 0, 0))
assign(bpy.context.object, material("wall", (0.7, 0.3, 0.2), Roughness=1.0))
primitives.primitive_uv_sphere_add(radius=0.6, location=(-0.8, 0.4, 0.6), segments=32, ring_count=16)
bpy.ops.object.shade_smooth()
assign(bpy.context.object, material("mirror", (0.9, 0.9, 0.9), Metallic=1.0, Roughness=0.0))
primitives.primitive_uv_sphere_add(radius=0.5, location=(0.7, -0.4, 0.5), segments=32, ring_count=16)
bpy.ops.object.shade_smooth()
assign(bpy.context.object, solid(material("glass", (1, 1, 1), Transmission_Weight=1.0, IOR=1.45, Roughness=0.0)))
primitives.primitive_plane_add(size=0.5, location=(0, 0, 2.5), rotation=(math.pi, 0, 0))
assign(bpy.context.object, material("panel", Emission_Color=(1, 0.8, 0.6, 1), Emission_Strength=12.0))

light("bulb", "POINT", 40, (-1.5, -1, 2))
light("beam", "SPOT", 60, (1.5, -1.5, 2.5), (0.6, 0.3, 0), spot_size=0.7, spot_blend=0.3)
light("sun", "SUN", 1.5, (0, 0, 4), (0.4, 0.2, 0))

eye = bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
eye.location, eye.rotation_euler = (0, -5, 1.8), (math.radians(78), 0, 0)
bpy.context.collection.objects.link(eye)
bpy.context.scene.camera = eye

bpy.ops.export_scene.gltf(filepath=sys.argv[1], export_format="GLB", export_lights=True, export_cameras=True)
