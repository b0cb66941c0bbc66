"""Blender add-on: renders and bakes the open scene with photonmill, and loads what comes out.

Install it with Edit > Preferences > Add-ons > Install from Disk, and say there where `photonmill` lies. Its panel is in the
properties of the render. From a script, without a window:

    import photonmill
    photonmill.render(bpy.context.scene, folder, program="photonmill", arguments=["--error", "2%"])

What glTF leaves out is added: area lamps become panels that emit the same power to the same side, and the world becomes a colour or a
picture of all directions. The scene itself stays as it is.
"""

import json
import math
import os
import queue
import shlex
import signal
import subprocess
import threading

import bpy
import mathutils

bl_info = {
    "name": "photonmill",
    "author": "photonmill",
    "version": (0, 1, 0),
    "blender": (4, 2, 0),
    "category": "Render",
    "description": "Render and bake by photon mapping, with the error of every pixel",
    "location": "Properties > Render > photonmill",
}

KEY = "photonmill_lightmap"
# Sides of the polygon that stands for a round lamp; its area is that of the lamp.
ROUND = 64


class Failure(Exception):
    """One line for the user."""


# Export


def emitted_radiance(lamp, matrix):
    """W/m2/sr of an area lamp, per channel, and its area in m2. Blender's watts leave by one side."""
    corners = [matrix @ mathutils.Vector(corner) for corner in outline(lamp)]
    # Fans of triangles around the first corner.
    area = 0.5 * sum((b - corners[0]).cross(c - corners[0]).length for b, c in zip(corners[1:], corners[2:]))
    power = lamp.energy * 2 ** getattr(lamp, "exposure", 0.0)
    if not getattr(lamp, "normalize", True):
        power *= area
    colour = list(lamp.color)
    if getattr(lamp, "use_temperature", False):
        colour = [a * b for a, b in zip(colour, lamp.temperature_color)]
    return [power * c / (math.pi * area) if area > 0 else 0.0 for c in colour], area


def outline(lamp):
    """Corners of a lamp's surface in its own plane, counter-clockwise as seen from the side that it lights (-z)."""
    x = lamp.size / 2
    y = lamp.size_y / 2 if lamp.shape in {"RECTANGLE", "ELLIPSE"} else x
    if lamp.shape in {"SQUARE", "RECTANGLE"}:
        return [(-x, -y, 0), (-x, y, 0), (x, y, 0), (x, -y, 0)]
    # A polygon of the same area as the ellipse.
    grow = math.sqrt(2 * math.pi / (ROUND * math.sin(2 * math.pi / ROUND)))
    angles = [-2 * math.pi * k / ROUND for k in range(ROUND)]
    return [(grow * x * math.cos(a), grow * y * math.sin(a), 0) for a in angles]


def add_panel(scene, name, matrix, lamp, made):
    """A mesh that emits what the lamp does, into `scene`; what is made is listed in `made`."""
    radiance, area = emitted_radiance(lamp, matrix)
    most = max(radiance)
    if most <= 0 or area <= 0:
        return
    material = bpy.data.materials.new(name)
    made.append((bpy.data.materials, material))
    material.use_nodes = True
    # One-sided, and black where it emits nothing.
    material.use_backface_culling = True
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = (0, 0, 0, 1)
    shader.inputs["Specular IOR Level"].default_value = 0
    shader.inputs["Emission Color"].default_value = (*[c / most for c in radiance], 1)
    shader.inputs["Emission Strength"].default_value = most
    mesh = bpy.data.meshes.new(name)
    made.append((bpy.data.meshes, mesh))
    corners = outline(lamp)
    mesh.from_pydata(corners, [], [list(range(len(corners)))])
    mesh.materials.append(material)
    panel = bpy.data.objects.new(name, mesh)
    made.append((bpy.data.objects, panel))
    panel.matrix_world = matrix
    scene.collection.objects.link(panel)


def world_radiance(world):
    """The colour of a world that is the same all around, or None."""
    if world is None:
        return (0.0, 0.0, 0.0)
    if not world.use_nodes or world.node_tree is None:
        return tuple(world.color)
    output = world.node_tree.get_output_node("CYCLES") or world.node_tree.get_output_node("ALL")
    if output is None or not output.inputs["Surface"].is_linked:
        return (0.0, 0.0, 0.0)
    node = output.inputs["Surface"].links[0].from_node
    if node.type == "BACKGROUND" and not any(socket.is_linked for socket in node.inputs):
        strength = node.inputs["Strength"].default_value
        return tuple(strength * c for c in node.inputs["Color"].default_value[:3])
    return None


def render_world(world, path, height, made):
    """Cycles renders the world alone, as a picture of all directions with +x in its middle."""
    scene = bpy.data.scenes.new("photonmill world")
    made.append((bpy.data.scenes, scene))
    camera = bpy.data.cameras.new("photonmill world")
    made.append((bpy.data.cameras, camera))
    eye = bpy.data.objects.new("photonmill world", camera)
    made.append((bpy.data.objects, eye))
    camera.type = "PANO"
    # A member of the camera since 5.0.
    settings = camera if hasattr(camera, "panorama_type") else camera.cycles
    settings.panorama_type = "EQUIRECTANGULAR"
    eye.rotation_euler = (math.pi / 2, 0, -math.pi / 2)
    scene.collection.objects.link(eye)
    scene.camera = eye
    scene.world = world
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y, render.resolution_percentage = 2 * height, height, 100
    render.film_transparent = False
    render.use_compositing = render.use_sequencer = False
    render.filepath = path
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_depth = "32"
    scene.cycles.samples = 4
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    scene.cycles.sample_clamp_direct = 0
    scene.cycles.pixel_filter_type = "BOX"
    bpy.ops.render.render(write_still=True, scene=scene.name)


def sharp_lamps(scene):
    """Names of the lamps whose size glTF leaves out."""
    with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
        objects = {instance.object.original for instance in bpy.context.evaluated_depsgraph_get().object_instances}
    lamps = [(thing.name, thing.data) for thing in objects if thing.type == "LIGHT" and not thing.hide_render]
    size = lambda lamp: {"AREA": 0, "SUN": getattr(lamp, "angle", 0)}.get(lamp.type, getattr(lamp, "shadow_soft_size", 0))
    return sorted(name for name, lamp in lamps if size(lamp) > 0)


def warn_of_sharp_lamps(scene):
    names = sharp_lamps(scene)
    if not names:
        return []
    listed = ", ".join(f"'{name}'" for name in names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")
    return [f"glTF has no size of point lamps, spots and suns: the shadows of {listed} are sharp; use area lamps for soft ones"]


def export(scene, folder, sky_height=1024):
    """Writes scene.glb and, where the world is a picture, world.exr; gives photonmill's arguments."""
    os.makedirs(folder, exist_ok=True)
    path = os.path.join(folder, "scene.glb")
    made = []
    try:
        with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
            graph = bpy.context.evaluated_depsgraph_get()
        lamps = [
            (instance.object.name, instance.matrix_world.copy(), instance.object.data)
            for instance in graph.object_instances
            if instance.object.type == "LIGHT" and instance.object.data.type == "AREA" and not instance.object.hide_render
        ]
        for name, matrix, lamp in lamps:
            add_panel(scene, name, matrix, lamp, made)
        arguments = [path]
        colour = world_radiance(scene.world)
        if colour is None:
            picture = os.path.join(folder, "world.exr")
            render_world(scene.world, picture, sky_height, made)
            arguments += ["--environment", picture]
        else:
            arguments += ["--environment", ",".join(repr(c) for c in colour)]
        with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
            bpy.context.view_layer.update()
            bpy.ops.export_scene.gltf(
                filepath=path,
                export_format="GLB",
                export_cameras=True,
                export_lights=True,
                export_apply=True,
                export_extras=True,
                export_animations=False,
                export_import_convert_lighting_mode="SPEC",
                use_renderable=True,
                use_active_scene=True,
            )
    finally:
        for owner, thing in reversed(made):
            owner.remove(thing)
    return arguments


# Running


def command(scene, what, folder, program, arguments, sky_height):
    """Exports the scene; the command that does the work, and the place of its result."""
    own = export(scene, folder, sky_height)
    if what == "bake":
        result = os.path.join(folder, "baked")
    else:
        result = os.path.join(folder, "picture.exr")
        scale = scene.render.resolution_percentage / 100
        size = [max(1, round(scale * side)) for side in (scene.render.resolution_x, scene.render.resolution_y)]
        own += ["--size", "{}x{}".format(*size)]
        if scene.camera:
            own += ["--camera", scene.camera.name]
    return [program, what, *own, "-o", result, "--progress", "json", *arguments], result


class Run:
    """photonmill in the background; `poll` says how far it is. `warnings` is what is to be said besides its own."""

    def __init__(self, line, warnings=()):
        # On Windows only a group of its own can be interrupted alone.
        flags = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)
        pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True, "encoding": "utf-8", "errors": "replace"}
        try:
            self.process = subprocess.Popen(line, creationflags=flags, **pipes)
        except OSError as error:
            raise Failure(f"{line[0]} cannot be started ({error.strerror}); set its path in the add-on's preferences") from None
        self.lines = queue.Queue()
        self.warnings = list(warnings)
        self.is_ending = False
        self.last = "photonmill ended without a word"
        self.share, self.status, self.error = 0.0, "", ""
        threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        with self.process.stderr as lines:
            for line in lines:
                self.lines.put(line.strip())
        self.lines.put(None)

    def take(self, line):
        if line.startswith("{"):
            said = json.loads(line)
            if "done" in said:
                self.share = said["done"] / max(1, said["total"])
                self.error = "" if said["error"] is None else f", error {100 * said['error']:.2f} %"
                self.status = f"{100 * self.share:.0f} %{self.error}"
            else:
                self.status = said.get("message", self.status)
        elif line:
            line = line.removeprefix("photonmill: ")
            if line.startswith("warning: "):
                self.warnings.append(line.removeprefix("warning: "))
            else:
                self.last = line

    def poll(self, wait=0.0):
        """True when it has ended well; raises a Failure when it has not."""
        while True:
            try:
                line = self.lines.get(timeout=wait) if wait else self.lines.get_nowait()
            except queue.Empty:
                return False
            if line is None:
                # Interrupted, it says of what the results are; before the first one it ends with an error.
                is_partial = self.is_ending and self.last.startswith("ended early")
                if self.process.wait() != 0 and not is_partial:
                    raise Failure(self.last)
                return True
            self.take(line)

    def stop(self):
        """Ends it with what it has; the second time, at once."""
        if self.is_ending:
            self.process.kill()
            self.process.wait()
        else:
            self.is_ending = True
            self.process.send_signal(getattr(signal, "CTRL_BREAK_EVENT", signal.SIGTERM))


def finish(run):
    while not run.poll(0.2):
        pass
    return run


def render(scene, folder, program="photonmill", arguments=(), sky_height=1024):
    """Renders the scene, waits, and gives the picture (linear, W/m2/sr)."""
    line, result = command(scene, "render", folder, program, arguments, sky_height)
    for warning in finish(Run(line, warn_of_sharp_lamps(scene))).warnings:
        print(f"photonmill: warning: {warning}")
    return load_picture(scene, result)


def bake(scene, folder, program="photonmill", arguments=(), sky_height=1024):
    """Bakes the scene, waits, and gives the new scene that shows its lightmaps."""
    line, result = command(scene, "bake", folder, program, arguments, sky_height)
    for warning in finish(Run(line, warn_of_sharp_lamps(scene))).warnings:
        print(f"photonmill: warning: {warning}")
    return load_lightmaps(scene, result)


# Loading


def load_picture(scene, path):
    name = f"photonmill {scene.name}"
    image = bpy.data.images.get(name)
    if image is None:
        image = bpy.data.images.load(path)
        image.name = name
    image.filepath = path
    image.reload()
    return image


def load_lightmaps(scene, folder):
    """A new scene with the objects of the baked file, whose materials show the light that was baked: base colour times irradiance over
    pi, and what they emit."""
    baked = bpy.data.scenes.new(f"{scene.name} baked")
    before = set(bpy.data.objects)
    with bpy.context.temp_override(scene=baked, view_layer=baked.view_layers[0], collection=baked.collection):
        bpy.ops.import_scene.gltf(filepath=os.path.join(folder, "scene.glb"))
    new = [thing for thing in bpy.data.objects if thing not in before]
    pictures = {}
    for thing in new:
        for collection in list(thing.users_collection):
            if collection != baked.collection and collection.name not in {c.name for c in baked.collection.children_recursive}:
                collection.objects.unlink(thing)
        if not thing.users_collection:
            baked.collection.objects.link(thing)
        for shown, lightmap in lightmaps_of(thing):
            show_lightmap(shown, lightmap, folder, pictures)
        if thing.type == "LIGHT":
            # Its light is in the maps.
            thing.hide_render = True
        if thing.type == "CAMERA" and baked.camera is None:
            baked.camera = thing
    return baked


def lightmaps_of(thing):
    """The objects whose light an object names, each with its lightmap."""
    if KEY not in thing:
        return []
    lightmaps = thing[KEY]
    if not isinstance(lightmaps, (list, tuple)):
        return [(thing, lightmaps)] if thing.type == "MESH" else []
    # Of EXT_mesh_gpu_instancing: one for each instance, which are children, the last ones that were made.
    instances = sorted((child for child in thing.children if child.type == "MESH"), key=lambda child: child.session_uid)
    if len(instances) < len(lightmaps):
        raise Failure(f"{thing.name} has {len(lightmaps)} lightmaps but {len(instances)} instances; make them objects of their own and bake again")
    return list(zip(instances[len(instances) - len(lightmaps):], lightmaps))


def picture_of(path, pictures):
    """A picture of this bake: one of an earlier bake may have had the same name, and is kept."""
    if path not in pictures:
        pictures[path] = bpy.data.images.load(path, check_existing=False)
        # The next bake may write over the file.
        pictures[path].pack()
    return pictures[path]


def usual_material(pictures):
    """That of surfaces without one, as glTF has it."""
    if None not in pictures:
        material = bpy.data.materials.new("photonmill default")
        material.use_nodes = True
        shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
        shader.inputs["Base Color"].default_value = (1, 1, 1, 1)
        pictures[None] = material
    return pictures[None]


def show_lightmap(thing, lightmap, folder, pictures):
    image = picture_of(os.path.join(folder, lightmap["irradiance"]), pictures)
    layer = thing.data.uv_layers[int(lightmap["texCoord"])].name
    if not thing.material_slots:
        thing.data.materials.append(None)
    for slot in thing.material_slots:
        # Objects that share a mesh have light of their own.
        material = (slot.material or usual_material(pictures)).copy()
        slot.link = "OBJECT"
        slot.material = material
        nodes, link = material.node_tree.nodes, material.node_tree.links.new
        shader = next((node for node in nodes if node.type == "BSDF_PRINCIPLED"), None)
        output = material.node_tree.get_output_node("ALL")
        if shader is None or output is None:
            continue

        def value_of(name, target):
            socket = shader.inputs[name]
            if socket.is_linked:
                link(socket.links[0].from_socket, target)
            else:
                target.default_value = socket.default_value

        uv = nodes.new("ShaderNodeUVMap")
        uv.uv_map = layer
        mapping = nodes.new("ShaderNodeMapping")
        scale, offset = list(lightmap["scale"]), list(lightmap["offset"])
        # glTF counts v from above, Blender from below.
        mapping.inputs["Location"].default_value = (offset[0], 1 - offset[1] - scale[1], 0)
        mapping.inputs["Scale"].default_value = (*scale, 1)
        texture = nodes.new("ShaderNodeTexImage")
        texture.image, texture.extension, texture.label = image, "EXTEND", "photonmill"
        product = nodes.new("ShaderNodeMix")
        product.data_type, product.blend_type = "RGBA", "MULTIPLY"
        product.inputs["Factor"].default_value = 1
        a, b = [socket for socket in product.inputs if socket.name in "AB" and socket.type == "RGBA"]
        reflected, emitted, both = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeAddShader")
        reflected.inputs["Strength"].default_value = 1 / math.pi
        value_of("Base Color", a)
        value_of("Emission Color", emitted.inputs["Color"])
        value_of("Emission Strength", emitted.inputs["Strength"])
        link(uv.outputs["UV"], mapping.inputs["Vector"])
        link(mapping.outputs["Vector"], texture.inputs["Vector"])
        link(texture.outputs["Color"], b)
        link(next(socket for socket in product.outputs if socket.type == "RGBA"), reflected.inputs["Color"])
        link(reflected.outputs[0], both.inputs[0])
        link(emitted.outputs[0], both.inputs[1])
        seen = both
        if material.use_backface_culling:
            # As photonmill has it, nothing is seen from behind; Cycles asks for it by nodes.
            side, nothing, seen = nodes.new("ShaderNodeNewGeometry"), nodes.new("ShaderNodeBsdfTransparent"), nodes.new("ShaderNodeMixShader")
            link(side.outputs["Backfacing"], seen.inputs[0])
            link(both.outputs[0], seen.inputs[1])
            link(nothing.outputs[0], seen.inputs[2])
        link(seen.outputs[0], output.inputs["Surface"])


# Interface


class Preferences(bpy.types.AddonPreferences):
    bl_idname = __name__

    program: bpy.props.StringProperty(name="Program", subtype="FILE_PATH", default="photonmill", description="Where photonmill lies")

    def draw(self, context):
        self.layout.prop(self, "program")


class Settings(bpy.types.PropertyGroup):
    folder: bpy.props.StringProperty(name="Folder", subtype="DIR_PATH", default="//photonmill", description="For all that is written")
    error: bpy.props.FloatProperty(name="Error", default=2.0, min=0.01, max=100, subtype="PERCENTAGE", description="Stop at this error")
    minutes: bpy.props.FloatProperty(name="Minutes", default=5.0, min=0.01, description="Stop after this time even so")
    density: bpy.props.FloatProperty(name="Texels per Metre", default=0.0, min=0.0, description="Of lightmaps; 0: photonmill chooses")
    atlas: bpy.props.IntProperty(name="Atlas", default=0, min=0, max=16384, description="Texels of a side of a page; 0: photonmill chooses")
    sky: bpy.props.IntProperty(name="Height of the World", default=1024, min=16, max=4096, description="Of its picture, in pixels")
    more: bpy.props.StringProperty(name="More", description="Further options of photonmill")

    def arguments(self, what):
        own = ["--error", f"{self.error:g}%", "--time", f"{60 * self.minutes:g}s"]
        if what == "bake":
            own += ["--texels-per-metre", f"{self.density:g}"] if self.density > 0 else []
            own += ["--atlas", str(self.atlas)] if self.atlas > 0 else []
        try:
            # Windows separates the parts of paths by what escapes elsewhere.
            more = [part.strip("\"'") for part in shlex.split(self.more, posix=False)] if os.name == "nt" else shlex.split(self.more)
        except ValueError as error:
            raise Failure(f"More {self.more}: cannot be split into options ({error}); close every quote") from None
        return own + more


class Work:
    """Runs photonmill; with a window in the background, Esc ends it, with what it has."""

    bl_options = {"REGISTER"}
    what = ""

    def begin(self, context):
        settings = context.scene.photonmill
        folder = bpy.path.abspath(settings.folder)
        if folder.startswith("//") or not os.path.isabs(folder):
            raise Failure(f"the folder {settings.folder} belongs to a file that has not been saved; save it, or choose another folder")
        addon = context.preferences.addons.get(__name__)
        program = bpy.path.abspath(addon.preferences.program) if addon else "photonmill"
        line, self.result = command(context.scene, self.what, folder, program, settings.arguments(self.what), settings.sky)
        self.scene = context.scene
        self.run = Run(line, warn_of_sharp_lamps(context.scene))

    def end(self, context):
        for warning in self.run.warnings:
            self.report({"WARNING"}, warning)
        loaded = self.load(context)
        early = ", ended early" if self.run.is_ending else ""
        self.report({"INFO"}, f"photonmill: {loaded.name}{self.run.error}{early}")
        return {"FINISHED"}

    def execute(self, context):
        try:
            self.begin(context)
            finish(self.run)
            return self.end(context)
        except Failure as failure:
            self.report({"ERROR"}, str(failure))
            return {"CANCELLED"}

    def invoke(self, context, event):
        try:
            self.begin(context)
        except Failure as failure:
            self.report({"ERROR"}, str(failure))
            return {"CANCELLED"}
        self.timer = context.window_manager.event_timer_add(0.2, window=context.window)
        context.window_manager.progress_begin(0, 1)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC" and event.value == "PRESS":
            was_ending = self.run.is_ending
            self.run.stop()
            return self.leave(context, {"CANCELLED"}) if was_ending else {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        try:
            if not self.run.poll():
                context.window_manager.progress_update(self.run.share)
                hint = "ending; Esc again gives up what it has" if self.run.is_ending else "Esc ends it with what it has"
                context.workspace.status_text_set(f"photonmill: {self.run.status} ({hint})")
                return {"PASS_THROUGH"}
            return self.leave(context, self.end(context))
        except Failure as failure:
            self.report({"ERROR"}, str(failure))
            return self.leave(context, {"CANCELLED"})

    def leave(self, context, result):
        context.window_manager.event_timer_remove(self.timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)
        return result


class RENDER_OT_photonmill(Work, bpy.types.Operator):
    """Render the active camera's view with photonmill"""

    bl_idname = "render.photonmill"
    bl_label = "Render with photonmill"
    what = "render"

    def load(self, context):
        image = load_picture(self.scene, self.result)
        areas = context.screen.areas if context.screen else []
        for area in areas:
            if area.type == "IMAGE_EDITOR":
                area.spaces.active.image = image
        return image


class RENDER_OT_photonmill_bake(Work, bpy.types.Operator):
    """Bake lightmaps with photonmill, and show them in a new scene"""

    bl_idname = "render.photonmill_bake"
    bl_label = "Bake with photonmill"
    what = "bake"

    def load(self, context):
        return load_lightmaps(self.scene, self.result)


class RENDER_PT_photonmill(bpy.types.Panel):
    bl_label = "photonmill"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"

    def draw(self, context):
        settings = context.scene.photonmill
        self.layout.use_property_split = True
        for name in ("folder", "error", "minutes", "sky", "more"):
            self.layout.prop(settings, name)
        self.layout.operator("render.photonmill")
        for name in ("density", "atlas"):
            self.layout.prop(settings, name)
        self.layout.operator("render.photonmill_bake")


CLASSES = (Preferences, Settings, RENDER_OT_photonmill, RENDER_OT_photonmill_bake, RENDER_PT_photonmill)


def register():
    for of in CLASSES:
        bpy.utils.register_class(of)
    bpy.types.Scene.photonmill = bpy.props.PointerProperty(type=Settings)


def unregister():
    del bpy.types.Scene.photonmill
    for of in reversed(CLASSES):
        bpy.utils.unregister_class(of)
