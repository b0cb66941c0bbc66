"""Writes tests/scenes/blender.glb with Blender, as any user's exporter would: a room with a textured
floor, a mirror ball, a glass ball, an emissive panel, a point, a spot and a sun light, a camera; and in
front, from left to right, something with each further part of glTF's materials: a clear coat, sheen, a
normal map with textures of metalness and roughness, amber that absorbs, a frosted pane, a leaf with
gaps, a net that is half there, and vertex colours with a tinted highlight.

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


def solid(made, attenuation=None):
    """Glass with an inside: Blender writes a volume only where a thickness is given. `attenuation`: colour and density."""
    group = bpy.data.node_groups.new("glTF Material Output", "ShaderNodeTree")
    group.interface.new_socket("Thickness", in_out="INPUT", socket_type="NodeSocketFloat")
    node = made.node_tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    node.inputs["Thickness"].default_value = 1.0
    if attenuation:
        volume = made.node_tree.nodes.new("ShaderNodeVolumeAbsorption")
        volume.inputs["Color"].default_value = (*attenuation[0], 1)
        volume.inputs["Density"].default_value = attenuation[1]
        made.node_tree.links.new(volume.outputs["Volume"], made.node_tree.nodes["Material Output"].inputs["Volume"])
    return made


def image(name, size, pixel, colours=True):
    """`pixel` gives red, green, blue and alpha at a column and a row; packed into the file."""
    picture = bpy.data.images.new(name, size, size, alpha=True)
    picture.colorspace_settings.name = "sRGB" if colours else "Non-Color"
    picture.pixels = [c for j in range(size) for i in range(size) for c in pixel(i, j)]
    picture.pack()
    return picture


def node(made, kind, **settings):
    new = made.node_tree.nodes.new(kind)
    for key, value in settings.items():
        setattr(new, key, value)
    return new


def link(made, output, name):
    made.node_tree.links.new(output, made.node_tree.nodes["Principled BSDF"].inputs[name])
    return made


def worn(made):
    """Metal beside paint, from one picture, over bumps."""
    is_metal = lambda i, j: (i // 8 + j // 8) % 2
    rough_metal = image("rough metal", 32, lambda i, j: (1, 0.3 if is_metal(i, j) else 0.8, is_metal(i, j), 1), colours=False)
    texture = node(made, "ShaderNodeTexImage", image=rough_metal)
    channels = node(made, "ShaderNodeSeparateColor")
    made.node_tree.links.new(texture.outputs["Color"], channels.inputs["Color"])
    link(made, channels.outputs["Green"], "Roughness")
    link(made, channels.outputs["Blue"], "Metallic")

    def bump(i, j):
        x, y = (-0.5 * math.sin(2 * math.pi * (k + 0.5) / 16) for k in (i, j))
        length = math.sqrt(x * x + y * y + 1)
        return 0.5 + 0.5 * x / length, 0.5 + 0.5 * y / length, 0.5 + 0.5 / length, 1

    normals = node(made, "ShaderNodeTexImage", image=image("bumps", 32, bump, colours=False))
    turned = node(made, "ShaderNodeNormalMap")
    made.node_tree.links.new(normals.outputs["Color"], turned.inputs["Color"])
    return link(made, turned.outputs["Normal"], "Normal")


def with_gaps(made, alpha, is_cut):
    """Alpha of a picture's own; `is_cut`: there or not, else by so much."""
    texture = node(made, "ShaderNodeTexImage", image=image(made.name, 32, alpha))
    link(made, texture.outputs["Color"], "Base Color")
    output = texture.outputs["Alpha"]
    if is_cut:
        whole = node(made, "ShaderNodeMath", operation="GREATER_THAN")
        whole.inputs[1].default_value = 0.5
        made.node_tree.links.new(output, whole.inputs[0])
        output = whole.outputs["Value"]
    return link(made, output, "Alpha")


def by_vertices(made):
    return link(made, node(made, "ShaderNodeVertexColor", layer_name="Color").outputs["Color"], "Base Color")


def colour_vertices(thing):
    colours = thing.data.color_attributes.new("Color", "FLOAT_COLOR", "POINT")
    for vertex, colour in zip(thing.data.vertices, colours.data):
        colour.color = (*(0.5 + 1.6 * c for c in vertex.co), 1)


def ball(place, radius, made, segments=32):
    bpy.ops.mesh.primitive_uv_sphere_add(radius=radius, location=(*place, radius), segments=segments, ring_count=segments // 2)
    bpy.ops.object.shade_smooth()
    return assign(bpy.context.object, made)


def card(place, made):
    """Upright, half a metre high, a little turned."""
    bpy.ops.mesh.primitive_plane_add(size=0.5, location=(*place, 0.27), rotation=(math.pi / 2, 0, 0.3))
    return assign(bpy.context.object, made)


def assign(thing, made):
    thing.data.materials.append(made)
    thing.name = made.name + " object"
    return thing


def checker():
    """A floor of 8 x 8 tiles."""
    tile = lambda i, j: 0.9 if (i // 8 + j // 8) % 2 else 0.25
    made = material("tiles", Roughness=1.0)
    texture = node(made, "ShaderNodeTexImage", image=image("tiles", 64, lambda i, j: (tile(i, j), tile(i, j), 0.6 * tile(i, j), 1)))
    return link(made, texture.outputs["Color"], "Base Color")


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
ball((-0.8, 0.4), 0.6, material("mirror", (0.9, 0.9, 0.9), Metallic=1.0, Roughness=0.0))
ball((0.7, -0.4), 0.5, solid(material("glass", (1, 1, 1), Transmission_Weight=1.0, IOR=1.45, Roughness=0.0)))
primitives.primitive_plane_add(size=0.5, location=(0, 0, 2.5), rotation=(math.pi, 0, 0))
assign(bpy.context.object, material("panel", Emission_Color=(1, 0.8, 0.6, 1), Emission_Strength=12.0))

ball((-1.25, -1.2), 0.2, material("lacquer", (0.6, 0.03, 0.03), Roughness=0.6, Coat_Weight=1.0, Coat_Roughness=0.05), 16)
ball((-0.8, -1.2), 0.2, material("velvet", (0.1, 0.1, 0.4), Roughness=1.0, Sheen_Weight=1.0, Sheen_Roughness=0.5), 16)
ball((-0.35, -1.2), 0.2, worn(material("worn", (0.8, 0.6, 0.4))), 16)
amber = material("amber", (1, 1, 1), Transmission_Weight=1.0, IOR=1.55, Roughness=0.0)
ball((0.1, -1.2), 0.2, solid(amber, ((1, 0.5, 0.1), 4.0)), 16)
card((0.55, -1.2), material("frosted", (0.8, 0.9, 1), Transmission_Weight=1.0, Roughness=0.4))
card((0.85, -1.4), with_gaps(material("leaf", Roughness=0.7), lambda i, j: (0.2, 0.6, 0.1, float(math.hypot(i - 15.5, j - 15.5) < 14)), True))
card((1.25, -0.9), with_gaps(material("net", Roughness=0.9), lambda i, j: (0.9, 0.8, 0.6, 0.25 + 0.5 * (i // 4 % 2)), False))
colour_vertices(ball((1.2, -1.5), 0.2, by_vertices(material("shell", Roughness=0.3, Specular_Tint=(1, 0.6, 0.4, 1))), 16))

light("bulb", "POINT", 40, (-1.5, -1, 2))
light("beam", "SPOT", 60, (1.5, -1.5, 2.5), (0.6, 0.3, 0), spot_size=0.7, spot_blend=0.3)
light("sun", "SUN", 1.5, (0, 0, 4), (0.4, 0.2, 0))

eye = bpy.data.objects.new("eye", bpy.data.cameras.new("eye"))
eye.location, eye.rotation_euler = (0, -5, 1.8), (math.radians(72), 0, 0)
bpy.context.collection.objects.link(eye)
bpy.context.scene.camera = eye

bpy.ops.export_scene.gltf(filepath=sys.argv[1], export_format="GLB", export_lights=True, export_cameras=True)
