"""cycles_ref.py SIZE SPP OUTDIR SKY FILE.glb... [--blender]: Cycles' pictures of the files under a constant sky of radiance SKY.

Writes OUTDIR/NAME.npz, where NAME is the file's, with `.sky` behind it if the file has no lamp of with_lamp.py (`.lamp` or `.sun` in
its name). Materials are changed to those of the guide (cycles_materials.py says how); with --blender they stay Blender's, but for
single scattering, and NAME ends in `.blender`.

Each picture is the mean of two renderings with different seeds and SPP paths a pixel each: box filter, 64 bounces, caustics on,
nothing clamped, one thread. The file holds

    image     linear radiance, SIZE x SIZE x 3
    error     half of the renderings' difference: one sample of the image's error
    mask      pixels that some object covers, at least in part
    noise     relative RMS error of: covered pixels; means of 4 x 4 blocks; such blocks in highlights (above twice the mean of the
              covered pixels)

Needs bpy (PyPI; its Python version only) and numpy.
"""

import argparse
import os
import sys
import tempfile
import time

import bpy
import numpy as np

from compare_page import block_means, highlights
from cycles_materials import as_in_the_guide
from with_lamp import NAME as LAMP


def repair(thing):
    """What the importer loses of a mesh. A mesh without a material has glTF's default, not Blender's. Normals of a morphed mesh are the
    file's, as its targets' normals are not read; Blender would turn them with the surface."""
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
    if mesh.shape_keys:
        normals = [normal.vector[:] for normal in mesh.corner_normals]
        keys = mesh.shape_keys.key_blocks
        places = [np.array([point.co[:] for point in key.data]) for key in keys]
        morphed = places[0] + sum(key.value * (place - places[0]) for key, place in zip(keys[1:], places[1:]))
        thing.shape_key_clear()
        mesh.vertices.foreach_set("co", morphed.astype("f4").ravel())
        mesh.update()
        mesh.normals_split_custom_set(normals)


def load(path, sky, size, blender):
    from io_scene_gltf2.blender.imp import pbrMetallicRoughness

    pbrMetallicRoughness.BLENDER_COAT_ROUGHNESS = 0.0  # glTF's default
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=path)
    scene = bpy.context.scene
    scene.frame_set(0)
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
    else:
        place = lamp and lamp.matrix_world @ (sum((v.co for v in lamp.data.vertices[1:]), lamp.data.vertices[0].co) / 4)
        as_in_the_guide(place)
    if lamp:
        lamp.data.materials[0].cycles.emission_sampling = "FRONT"

    world = scene.world = bpy.data.worlds.new("sky")
    world.use_nodes = True
    background = world.node_tree.nodes["Background"].inputs
    background["Color"].default_value, background["Strength"].default_value = (1, 1, 1, 1), sky

    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_x = render.resolution_y = size
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
    parser.add_argument("--blender", action="store_true")
    options = parser.parse_args()
    failed = 0
    for path in options.files:
        start = time.time()
        name = os.path.splitext(os.path.basename(path))[0]
        name += "" if name.endswith((".lamp", ".sun")) else ".sky"
        name += ".blender" if options.blender else ""
        try:
            scene = load(path, options.sky, options.size, options.blender)
            mask = picture(scene, 64, 3, transparent=True)[..., 3] > 0
            one, two = (picture(scene, options.spp, seed)[..., :3] for seed in (1, 2))
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
