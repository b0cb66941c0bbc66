"""cycles_ref.py WIDTH SPP OUTDIR SKY FILE.glb... [--own] [--blender]: Cycles' pictures of the files under a constant sky of radiance SKY.

Writes OUTDIR/NAME.npz, where NAME is the file's, with `.sky` behind it if no `.lamp`, `.sun` or `.sky` of with_lamp.py is in its
name. Materials are changed to those of the guide (cycles_materials.py says how); with --blender they stay Blender's, but for
single scattering, and NAME ends in `.blender`.

With --own the light is that of the file: the sum of a picture for each lamp, as materials are made for one, and NAME ends in `.own`.
Point and spot lights have a radius of a fiftieth of the scene's, suns are 2 degrees wide, as paths do not find caustics of points
otherwise; they do not show in mirrors. Spots fade between their cones as in glTF, not as in Blender.

Each picture is the mean of two renderings with different seeds and SPP paths per pixel each: box filter, 64 bounces, caustics on,
nothing clamped, one thread. The file holds

    image     linear radiance, SIZE x SIZE x 3
    error     half of the renderings' difference: one sample of the image's error
    mask      pixels that some object covers, at least in part
    noise     relative RMS error of: covered pixels; means of 4 x 4 blocks; such blocks in highlights (above twice the mean of the
              covered pixels)

Needs bpy (PyPI; its Python version only) and numpy.
"""

import argparse
import math
import os
import sys
import tempfile
import time

import bpy
import mathutils
import numpy as np

import glb
from compare_page import LIGHTS, block_means, highlights
from cycles_materials import Graph, Value, as_in_the_guide
from with_lamp import NAME as LAMP


def repair(thing):
    """A mesh without a material has glTF's default, not Blender's."""
    mesh = thing.data
    if not all(mesh.materials) or not mesh.materials:
        material = bpy.data.materials.new("default")
        material.use_nodes = True
        inputs = material.node_tree.nodes["Principled BSDF"].inputs
        inputs["Base Color"].default_value = (1, 1, 1, 1)
        inputs["Metallic"].default_value = inputs["Roughness"].default_value = 1
        material.use_backface_culling = True
        for slot, present in enumerate(mesh.materials):
            mesh.materials[slot] = present or material
        if not mesh.materials:
            mesh.materials.append(material)


def own_lamps(scene):
    """Lights, and meshes that emit."""
    emits = lambda node: node.type == "BSDF_PRINCIPLED" and node.inputs["Emission Strength"].default_value > 0
    of_mesh = lambda thing: any(emits(node) for material in thing.data.materials for node in material.node_tree.nodes)
    return [thing for thing in scene.objects if thing.type == "LIGHT" or (thing.type == "MESH" and of_mesh(thing))]


def only(scene, number):
    """Puts all lamps out but one: itself, and where it is, or the direction to it and a 0."""
    chosen = own_lamps(scene)[number]
    for thing in own_lamps(scene):
        if thing != chosen and thing.type == "LIGHT":
            bpy.data.objects.remove(thing)
        elif thing != chosen:
            for material in thing.data.materials:
                for node in material.node_tree.nodes:
                    if node.type == "BSDF_PRINCIPLED":
                        node.inputs["Emission Strength"].default_value = 0
    if chosen.type == "MESH":
        corners = [chosen.matrix_world @ vertex.co for vertex in chosen.data.vertices]
        return chosen, sum(corners, mathutils.Vector()) / len(corners)
    is_sun = chosen.data.type == "SUN"
    return chosen, (*axis_of(chosen), 0) if is_sun else chosen.matrix_world.translation.copy()


def axis_of(thing):
    """Against the direction that a light emits in."""
    return thing.matrix_world.to_quaternion() @ mathutils.Vector((0, 0, 1))


def as_mesh(thing, centre, radius):
    """A mesh instead of a light, as Cycles lets meshes know which rays meet them. `centre` and `radius` are the scene's."""
    light, axis = thing.data, axis_of(thing)
    if light.type == "SUN":
        far = 1000 * radius
        turn = axis.to_track_quat("-Z", "Y").to_euler()  # its front faces the scene
        place = mathutils.Vector(centre) + far * axis
        bpy.ops.mesh.primitive_circle_add(radius=far * math.tan(math.radians(1)), fill_type="NGON", location=place, rotation=turn)
    else:
        bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=3, radius=radius / 50, location=thing.matrix_world.translation)
    mesh = bpy.context.object.data
    area = sum(face.area for face in mesh.polygons)
    radiance = light.energy * (far**2 / area if light.type == "SUN" else 1 / (math.pi * area))
    material = bpy.data.materials.new("lamp")
    material.use_nodes = True
    material.cycles.emission_sampling = "FRONT"
    mesh.materials.append(material)
    graph = Graph(material.node_tree, {})
    path = graph.node("ShaderNodeLightPath").outputs
    mirrored = Value(graph, path["Is Singular Ray"]) * (1.0 - Value(graph, path["Diffuse Depth"]).least(1.0))
    strength = (1.0 - mirrored) * (1.0 - graph.read("ShaderNodeNewGeometry", "Backfacing")) * radiance
    if light.type == "SPOT":
        outer, inner = (math.cos(light.spot_size / 2 * share) for share in (1, 1 - light.spot_blend))
        cosine = graph.read("ShaderNodeNewGeometry", "Incoming").operate("DOT_PRODUCT", tuple(-axis))
        share = ((cosine - outer) * (1 / (inner - outer))).most(0.0).least(1.0)
        strength = strength * share * share
    closure = graph.add(graph.shader("ShaderNodeEmission", Color=tuple(light.color), Strength=strength),
                        graph.shader("ShaderNodeBsdfTransparent", Color=(1.0, 1.0, 1.0)))
    output = next(node for node in material.node_tree.nodes if node.type == "OUTPUT_MATERIAL")
    material.node_tree.links.new(output.inputs["Surface"], closure)
    bpy.data.objects.remove(thing)


def load_plain(path):
    """Imports a file; its JSON part."""
    from io_scene_gltf2.blender.imp import pbrMetallicRoughness

    pbrMetallicRoughness.BLENDER_COAT_ROUGHNESS = 0.0  # glTF's default
    bpy.ops.wm.read_factory_settings(use_empty=True)
    # Blender would turn the file's normals with a morphed surface, and does not read the targets' own.
    gltf, binary = glb.read(path)
    gltf.pop("animations", None)
    glb.put_at_rest(gltf, binary)
    with tempfile.TemporaryDirectory() as folder:
        glb.write(folder + "/rest.glb", gltf, binary)
        bpy.ops.import_scene.gltf(filepath=folder + "/rest.glb")
    return gltf


def load(path, sky, size, blender, own=None):
    gltf = load_plain(path)
    scene = bpy.context.scene
    scene.camera = next(thing for thing in scene.objects if thing.type == "CAMERA")
    lamp = next((thing for thing in scene.objects if thing.name == LAMP), None)
    for thing in scene.objects:
        if thing.type == "MESH":
            repair(thing)
        thing.cycles.shadow_terminator_geometry_offset = thing.cycles.shadow_terminator_offset = 0
    if blender:
        for material in bpy.data.materials:
            for node in material.node_tree.nodes:
                if getattr(node, "distribution", "") == "MULTI_GGX":
                    node.distribution = "GGX"
    elif own is not None:
        thing, place = only(scene, own)
        as_in_the_guide(place)
        if thing.type == "LIGHT":
            (x, y, z), radius = glb.bounding_sphere(gltf)
            as_mesh(thing, (x, -z, y), float(radius))
    else:
        place = lamp and lamp.matrix_world @ (sum((v.co for v in lamp.data.vertices[1:]), lamp.data.vertices[0].co) / 4)
        as_in_the_guide(place)
    if lamp:
        lamp.data.materials[0].cycles.emission_sampling = "FRONT"

    world = scene.world = bpy.data.worlds.new("sky")
    world.use_nodes = True
    background = world.node_tree.nodes["Background"].inputs
    background["Color"].default_value, background["Strength"].default_value = (1, 1, 1, 1), sky

    if not lamp and own is None:
        world.cycles.sampling_method = "NONE"  # light that portals let in would count by half

    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_x = size
    render.resolution_y = round(size / gltf["cameras"][0]["perspective"].get("aspectRatio", 1))
    render.resolution_percentage = 100
    render.threads_mode, render.threads = "FIXED", 1
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    render.image_settings.color_mode = "RGBA"
    scene.view_settings.view_transform = "Raw"
    cycles.use_denoising = cycles.use_adaptive_sampling = False
    cycles.pixel_filter_type = "BOX"
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = 64
    cycles.transmission_bounces = cycles.transparent_max_bounces = 64
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.light_sampling_threshold = cycles.blur_glossy = 0
    cycles.caustics_reflective = cycles.caustics_refractive = True
    return scene


def picture(scene, spp, seed, transparent=False):
    scene.render.film_transparent, scene.cycles.samples, scene.cycles.seed = transparent, spp, seed
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = os.path.join(folder, "picture.exr")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        pixels = np.array(image.pixels[:], "f4").reshape(image.size[1], image.size[0], 4)[::-1]
        bpy.data.images.remove(image)
    return pixels


def main():
    parser = argparse.ArgumentParser(usage=__doc__)
    parser.add_argument("size", type=int)
    parser.add_argument("spp", type=int)
    parser.add_argument("folder")
    parser.add_argument("sky", type=float)
    parser.add_argument("files", nargs="+")
    parser.add_argument("--own", action="store_true")
    parser.add_argument("--blender", action="store_true")
    options = parser.parse_args()
    failed = 0
    for path in options.files:
        start = time.time()
        name = os.path.splitext(os.path.basename(path))[0]
        name += ".own" if options.own else "" if name.endswith(LIGHTS) else ".sky"
        name += ".blender" if options.blender else ""
        try:
            load_file = lambda lamp: load(path, options.sky, options.size, options.blender, lamp)
            scene = load_file(0 if options.own else None)
            mask = picture(scene, 64, 3, transparent=True)[..., 3] > 0
            one = two = 0
            for lamp in range(len(own_lamps(load_plain(path) and bpy.context.scene)) if options.own else 1):
                scene = load_file(lamp if options.own else None)
                one, two = (sum_ + picture(scene, options.spp, seed)[..., :3] for seed, sum_ in ((1, one), (2, two)))
        except Exception as problem:  # one bad file must not end a night's work
            print(name, "FAILED:", repr(problem), flush=True)
            failed += 1
            continue
        image, error = (one + two) / 2, (one - two) / 2
        rms = lambda values: np.sqrt((values.astype(float) ** 2).mean()) if values.size else 0.0
        blocks, bright = highlights(image, mask)
        means, errors = block_means(image), block_means(error)
        noise = [rms(e[m]) / max(i[m].mean(), 1e-30) if m.any() else 0.0 for i, e, m in
                 ((image, error, mask), (means, errors, blocks), (means, errors, bright))]
        np.savez_compressed(os.path.join(options.folder, name + ".npz"), image=image, error=error.astype("f2"), mask=mask,
                            noise=noise, spp=options.spp, sky=options.sky)
        print(f"{name:34s} mean {image[mask].mean():.4f}, covered {mask.mean():.2f}, noise of pixels {noise[0]:.4f}, of blocks "
              f"{noise[1]:.4f}, in highlights {noise[2]:.4f}, {time.time() - start:.0f} s", flush=True)
    sys.exit(failed > 0)


if __name__ == "__main__":
    main()
