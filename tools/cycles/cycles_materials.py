"""Turns the materials that Blender's glTF importer made into those of photonmill's guide (materials.md), for cycles_ref.py.

Cycles' own GGX, diffuse, refraction, textures, normal maps and light transport stay. What changes is how a material mixes them:

    Blender's Principled BSDF                          here, as in the guide
    GGX with multiple scattering                       single scattering
    exact Fresnel reflectance of dielectrics           Schlick's, but for solids that transmit
    diffuse times 1 - E(n.v)                           times K
    clear coat dims by 1 - C(n.v)                      by the smaller one of 1 - C(n.v) and 1 - C(n.l)
    clear coat without a roughness has 0.03            0
    clear coat dims emission                           does not
    transmission without a volume refracts             goes straight on
    transmission takes the root of the base colour     the base colour
    a volume absorbs (1 - colour) / distance           -ln(colour) / distance
    backs are shown                                    not to the camera if single-sided, and black to all other rays
    sheen by fitted linear cosines                     Estevez and Kulla's
    unlit surfaces let light pass                      stop it
    normals are bent where they reflect into the       light that would go there is lost, but for what mirrors and clear
    surface                                            glass without normal maps reflect
    8-bit colours are filtered before decoding         after

Cycles gives a material no direction of the light. So n.l of K and of the coat is that of the reference lamp of with_lamp.py. The
sky's and the indirect light get the lamp's factor too, where they should get one that is 1 in the mean. It is at most 1.1, and falls
to 0 where the lamp's light grazes. Without a reference lamp it is 1.

Sheen where the lamp shines is a diffuse closure that has its value towards the lamp, for indirect light too. Other sheen and rough thin
walls are ray portals with a direction by chance: only paths find lamps there, no shadow rays.

What stays different: mirrors show the backs of single-sided surfaces black. The importer ignores iridescence and dispersion.
"""

import math

import bpy
import numpy as np

TABLE = 64  # steps of n.v and of roughness in the tables


# ---- Directional albedo of single-scattering GGX


def albedos():
    """A[roughness, cosine] and B: albedo of D V (1 - (1 - v.h)^5) and of D V (1 - v.h)^5, by a grid of visible normals (Heitz 2018)."""
    steps = np.arange(TABLE + 1) / TABLE
    u1, u2 = ((np.mgrid[:64, :64] + 0.5) / 64).reshape(2, -1)
    a = np.zeros((TABLE + 1, TABLE + 1))
    b = np.zeros_like(a)
    for row, roughness in enumerate(steps):
        alpha = max(roughness**2, 1e-4)
        for column, cosine in enumerate(steps):
            cosine = max(cosine, 1e-3)
            sine = np.sqrt(1 - cosine**2)
            length = np.hypot(alpha * sine, cosine)
            x, z = alpha * sine / length, cosine / length  # the stretched eye
            r, phi = np.sqrt(u1), 2 * np.pi * u2
            p, q = r * np.cos(phi), r * np.sin(phi)  # across the eye's plane, and up in it
            q = (1 - (1 + z) / 2) * np.sqrt(1 - p**2) + (1 + z) / 2 * q
            w = np.sqrt(np.maximum(0, 1 - p**2 - q**2))
            h = np.stack([alpha * (x * w - z * q), alpha * p, np.maximum(0, z * w + x * q)])
            h /= np.linalg.norm(h, axis=0)
            dot = h[0] * sine + h[2] * cosine
            light = 2 * dot * h[2] - cosine
            smith = lambda c: (np.sqrt(1 + alpha**2 * (1 / np.maximum(c, 1e-9) ** 2 - 1)) - 1) / 2
            weight = np.where(light > 0, (1 + smith(cosine)) / (1 + smith(cosine) + smith(light)), 0)
            schlick = (1 - np.minimum(dot, 1)) ** 5
            a[row, column], b[row, column] = (weight * (1 - schlick)).mean(), (weight * schlick).mean()
    return a, b


def sheens():
    """l[roughness, cosine] of the guide's masking, the albedo of white sheen, and 2 * integral over c of the larger one of the albedo, at
    most 1, at c and at the cosine, times c."""
    steps = np.arange(TABLE + 1) / TABLE
    height, turn = np.meshgrid((np.arange(256) + 0.5) / 256, (np.arange(128) + 0.5) / 128 * np.pi, indexing="ij")
    masking = np.zeros((TABLE + 1, TABLE + 1))
    albedo = np.zeros_like(masking)
    for row, roughness in enumerate(steps):
        s = max(roughness**2, 0.01)
        p = np.array([25.3245, 3.32435, 0.16801, -1.27393, -4.85967]) * (1 - s) ** 2
        p += np.array([21.5473, 3.82987, 0.19823, -1.97760, -4.32054]) * (1 - (1 - s) ** 2)
        small = lambda x: p[0] / (1 + p[1] * x ** p[2]) + p[3] * x + p[4]
        l = lambda x: np.where(x < 0.5, small(x), 2 * small(0.5) - small(1 - x))
        masking[row] = l(steps)
        for column, cosine in enumerate(np.maximum(steps, 1e-3)):
            half = height + cosine, np.sqrt(1 - height**2) * np.cos(turn) + np.sqrt(1 - cosine**2), np.sqrt(1 - height**2) * np.sin(turn)
            aside = np.clip(1 - half[0] ** 2 / (half[0] ** 2 + half[1] ** 2 + half[2] ** 2), 0, 1)
            d = (2 + 1 / s) * aside ** (0.5 / s) / (2 * np.pi)
            v = 1 / ((1 + np.exp(l(height)) + np.exp(l(cosine))) * 4 * cosine)  # times n.l
            albedo[row, column] = (d * v).mean() * 2 * np.pi
    weight = 2 * steps / TABLE
    weight[-1] /= 2
    least = np.minimum(albedo, 1)
    return masking, albedo, np.maximum(least[:, :, None], least[:, None, :]) @ weight


def image_of(name, *channels):
    """A float image that holds the arrays as its red, green and blue."""
    height, width = channels[0].shape
    pixels = np.ones((height, width, 4), "f4")
    for i, channel in enumerate(channels):
        pixels[..., i] = channel
    image = bpy.data.images.new(name, width, height, float_buffer=True, is_data=True)
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    return image


def tables():
    """Images: (A, B) by cosine and roughness; their means (2 * integral of A c, of B c) by roughness; and the means of A A', A B',
    B B' by both roughnesses."""
    a, b = albedos()
    cosine = np.arange(TABLE + 1) / TABLE
    weight = 2 * cosine / TABLE
    weight[-1] /= 2
    mean = [np.repeat((table @ weight)[:, None], TABLE + 1, 1) for table in (a, b)]
    pairs = [np.einsum("ic,jc,c->ij", one, other, weight) for one, other in ((a, a), (a, b), (b, b))]
    return {"AB": image_of("AB", a, b), "mean": image_of("mean", *mean), "pairs": image_of("pairs", *pairs),
            "sheen": image_of("sheen", *sheens())}


# ---- Node trees as arithmetic


class Value:
    """A number or colour of a node tree, with arithmetic: numbers by Math nodes, colours (and a colour and a number) by Vector Math."""

    def __init__(self, graph, socket):
        self.graph = graph
        if isinstance(socket, bpy.types.NodeSocket):
            self.plain, self.wide = None, socket.type in ("RGBA", "VECTOR")
        else:
            self.plain, self.wide = socket, not isinstance(socket, (int, float))
        self.socket = socket

    def into(self, target):
        if self.plain is None:
            self.graph.tree.links.new(target, self.socket)
        elif self.wide or not hasattr(target.default_value, "__len__"):
            target.default_value = [*self.plain, 1][: len(target.default_value)] if self.wide else self.plain
        else:
            target.default_value = ([self.plain] * 3 + [1])[: len(target.default_value)]

    def operate(self, operation, *others):
        others = [other if isinstance(other, Value) else Value(self.graph, other) for other in others]
        wide = any(value.wide for value in (self, *others))
        node = self.graph.node("ShaderNodeVectorMath" if wide else "ShaderNodeMath", operation=operation)
        for value, target in zip((self, *others), node.inputs):
            value.into(target)
        return Value(self.graph, node.outputs["Value" if operation == "DOT_PRODUCT" else 0])

    __add__ = __radd__ = lambda self, other: self.operate("ADD", other)
    __mul__ = __rmul__ = lambda self, other: self.operate("MULTIPLY", other)
    __sub__ = lambda self, other: self.operate("SUBTRACT", other)
    __rsub__ = lambda self, other: Value(self.graph, other).operate("SUBTRACT", self)
    __truediv__ = lambda self, other: self.operate("DIVIDE", other)
    __rtruediv__ = lambda self, other: Value(self.graph, other).operate("DIVIDE", self)
    least = lambda self, other: self.operate("MINIMUM", other)
    most = lambda self, other: self.operate("MAXIMUM", other)
    power = lambda self, other: self.operate("POWER", other)
    size = lambda self: self.operate("ABSOLUTE")

    def parts(self):
        if not self.wide:
            return self, self, self
        node = self.graph.node("ShaderNodeSeparateXYZ")
        self.into(node.inputs[0])
        return [Value(self.graph, output) for output in node.outputs]

    def largest(self):
        red, green, blue = self.parts()
        return red.most(green).most(blue)


class Graph:
    def __init__(self, tree, images):
        self.tree, self.images = tree, images

    def node(self, kind, **settings):
        made = self.tree.nodes.new(kind)
        for key, value in settings.items():
            setattr(made, key, value)
        return made

    def read(self, kind, output):
        """Of a node without inputs."""
        return Value(self, self.node(kind).outputs[output])

    def input(self, socket):
        """What a socket of the imported material is linked to, or its number or colour."""
        if socket.is_linked:
            return Value(self, socket.links[0].from_socket)
        value = socket.default_value
        return Value(self, tuple(value)[:3] if hasattr(value, "__len__") else float(value))

    def shader(self, kind, settings={}, **inputs):
        """A closure. Inputs are named as the sockets are, with _ for blanks; None leaves a socket alone."""
        node = self.node(kind, **settings)
        for key, value in inputs.items():
            if value is not None:
                (value if isinstance(value, Value) else Value(self, value)).into(node.inputs[key.replace("_", " ")])
        return node.outputs[0]

    def mix(self, share, at_1, at_0=None):
        """Closures by share; None is black."""
        node = self.node("ShaderNodeMixShader")
        (share if isinstance(share, Value) else Value(self, share)).into(node.inputs[0])
        for target, closure in zip(node.inputs[1:], (at_0, at_1)):
            if closure is not None:
                self.tree.links.new(target, closure)
        return node.outputs[0]

    def add(self, *closures):
        total = closures[0]
        for closure in closures[1:]:
            node = self.node("ShaderNodeAddShader")
            self.tree.links.new(node.inputs[0], total)
            self.tree.links.new(node.inputs[1], closure)
            total = node.outputs[0]
        return total

    def look_up(self, table, x, y):
        """Channels of one of the tables, linear between its entries."""
        place = self.node("ShaderNodeCombineXYZ")
        for value, target in zip((x, y), place.inputs):
            ((value * TABLE + 0.5) / (TABLE + 1)).into(target)
        node = self.node("ShaderNodeTexImage", image=self.images[table], interpolation="Linear", extension="EXTEND")
        self.tree.links.new(node.inputs["Vector"], place.outputs[0])
        return Value(self, node.outputs["Color"]).parts()


# ---- Materials


def backs(graph, closure):
    """Seen from behind: not there for the camera, black for all other rays."""
    light_path = graph.read("ShaderNodeLightPath", "Is Camera Ray")
    hidden = graph.mix(light_path, graph.shader("ShaderNodeBsdfTransparent", Color=(1.0, 1.0, 1.0)))
    return graph.mix(graph.read("ShaderNodeNewGeometry", "Backfacing"), hidden, closure)


def chance(graph):
    """Three numbers by chance: a hash of the place that a ray meets."""
    noise = graph.node("ShaderNodeTexWhiteNoise", noise_dimensions="3D")
    graph.read("ShaderNodeNewGeometry", "Position").into(noise.inputs["Vector"])
    return Value(graph, noise.outputs["Color"]).parts()


def around(normal, turn, height):
    """The direction of that height over a plane; turn from 0 to 1."""
    across = normal.operate("CROSS_PRODUCT", (0.36, 0.48, 0.8)).operate("NORMALIZE")
    up = normal.operate("CROSS_PRODUCT", across)
    sine, turn = (1.0 - height * height).most(0.0).power(0.5), turn * (2 * math.pi)
    return across * (sine * turn.operate("COSINE")) + up * (sine * turn.operate("SINE")) + normal * height


def portal(graph, colour, roughness, normal, eye, f0, specular):
    """A rough thin wall: a half vector out of those that the eye sees (Dupuy and Benyoub 2023), and the direction that it sends light to."""
    u1, u2, _ = chance(graph)
    dot = lambda a, b: a.operate("DOT_PRODUCT", b)
    alpha = roughness * roughness
    stretched = lambda v: v * alpha + normal * (dot(v, normal) * (1.0 - alpha))
    seen = stretched(eye).operate("NORMALIZE")
    cap = around(normal, u1, (1.0 - u2) * (1.0 + dot(seen, normal)) - dot(seen, normal))
    half = stretched(cap + seen).operate("NORMALIZE")
    cosine = dot(eye, half)
    light = half * (cosine * 2.0) - eye
    height = dot(light, normal)
    smith = lambda c: ((1.0 + alpha * alpha * (1.0 / (c * c).most(1e-12) - 1.0)).power(0.5) - 1.0) * 0.5
    one = 1.0 + smith(dot(eye, normal))
    kept = height.operate("GREATER_THAN", 0.0) * one / (one + smith(height))
    schlick = f0 + (1.0 - f0) * (1.0 - cosine).most(0.0).power(5.0)
    return graph.shader("ShaderNodeBsdfRayPortal", Color=colour * (1.0 - specular * schlick) * kept,
                        Direction=light - normal * (height * 2.0))


def principled(graph, node, solid, single_sided, lamp):
    """The closure of the guide's lobes for an imported Principled BSDF. `lamp` is as in as_in_the_guide."""
    get = lambda name: graph.input(node.inputs[name])
    colour, metal, roughness, t = get("Base Color"), get("Metallic"), get("Roughness"), get("Transmission Weight")
    coat, coat_roughness, specular = get("Coat Weight"), get("Coat Roughness"), get("Specular IOR Level") * 2.0
    ior = node.inputs["IOR"].default_value
    has = lambda name: node.inputs[name].is_linked or node.inputs[name].default_value > 0
    has_coat, transmits, has_sheen = has("Coat Weight"), has("Transmission Weight"), has("Sheen Weight")

    normal_of = lambda name: get(name) if node.inputs[name].is_linked else None
    plain_normal = graph.read("ShaderNodeNewGeometry", "Normal")
    eye = graph.read("ShaderNodeNewGeometry", "Incoming")
    normal, coat_normal = normal_of("Normal"), normal_of("Coat Normal")
    facing = lambda n, direction: (n or plain_normal).operate("DOT_PRODUCT", direction)

    f0 = (get("Specular Tint") * ((ior - 1) / (ior + 1)) ** 2).least((1.0, 1.0, 1.0))  # times specular is F0d; F90d is specular

    def under_reflection(cosine):
        """1 - E"""
        a, b, _ = graph.look_up("AB", cosine, roughness)
        return 1.0 - specular * (f0.largest() * a + b)

    def under_coat(cosine):
        """1 - C"""
        a, b, _ = graph.look_up("AB", cosine, coat_roughness)
        return 1.0 - coat * (a * 0.04 + b)

    view, coat_view = facing(normal, eye).size(), facing(coat_normal, eye).size()
    kept = under_reflection(view)
    dimmed = under_coat(coat_view) if has_coat else None
    if has_coat:
        kept = kept * dimmed
    if lamp is not None:
        towards = Value(graph, tuple(lamp)[:3])
        if len(lamp) == 3:
            towards = (towards - graph.read("ShaderNodeNewGeometry", "Position")).operate("NORMALIZE")
        light, coat_light = facing(normal, towards), facing(coat_normal, towards)
        lit = light.operate("GREATER_THAN", 0.0)
        factor = under_reflection(light.most(0.0))
        a, b, _ = graph.look_up("mean", Value(graph, 0.5), roughness)
        mean = 1.0 - specular * (f0.largest() * a + b)
        if has_coat:
            coat_dimmed = under_coat(coat_light.most(0.0))
            # Where the lamp does not shine, what comes from elsewhere is dimmed by the eye's angle alone.
            factor, dimmed = factor * coat_dimmed, dimmed + lit * (dimmed.least(coat_dimmed) - dimmed)
            a1, b1, _ = graph.look_up("mean", Value(graph, 0.5), coat_roughness)
            aa, ab, bb = graph.look_up("pairs", coat_roughness, roughness)
            _, ba, _ = graph.look_up("pairs", roughness, coat_roughness)
            both = f0.largest() * (aa * 0.04 + ab) + ba * 0.04 + bb
            mean = mean - coat * (a1 * 0.04 + b1) + coat * specular * both
        kept = kept * (1.0 + lit * (factor / mean - 1.0))

    if has_sheen:
        cloth, cloth_roughness = get("Sheen Tint") * get("Sheen Weight"), get("Sheen Roughness")
        masking, albedo, largest = graph.look_up("sheen", view, cloth_roughness)

        def sheen(direction, cosine):
            """Without its colour, and what is left of its albedo."""
            masking_there, albedo_there, _ = graph.look_up("sheen", cosine, cloth_roughness)
            s = (cloth_roughness * cloth_roughness).most(0.01)
            half = facing(normal, (eye + direction).operate("NORMALIZE"))
            d = (2.0 + 1.0 / s) * (1.0 - half * half).most(0.0).power(0.5 / s) * (0.5 / np.pi)
            exp = lambda value: Value(graph, math.e).power(value)
            f = d / ((1.0 + exp(masking) + exp(masking_there)) * view * cosine.most(1e-3) * 4.0)
            return f / albedo.most(albedo_there).most(1.0), 1.0 - cloth.largest() * albedo.most(albedo_there).least(1.0)

        u1, u2, _ = chance(graph)
        direction = around(normal or plain_normal, u1, u2)
        f, _ = sheen(direction, u2)
        under_sheen = 1.0 - cloth.largest() * largest
        shining = graph.shader("ShaderNodeBsdfRayPortal", Color=cloth * (f * u2 * (2 * math.pi)), Direction=direction)
        if lamp is not None:
            f, under_lamp = sheen(towards, light.most(0.0))
            under_sheen = under_sheen + lit * (under_lamp - under_sheen)
            shining = graph.mix(lit, graph.shader("ShaderNodeBsdfDiffuse", Color=cloth * (f * math.pi), Normal=normal), shining)

    ggx = {"distribution": "GGX"}
    metallic = {"distribution": "GGX", "fresnel_type": "F82"}  # with a white edge this is Schlick's
    white = (1.0, 1.0, 1.0)
    reflect = lambda f0, roughness, normal: graph.shader(
        "ShaderNodeBsdfMetallic", metallic, Base_Color=f0, Edge_Tint=white, Roughness=roughness, Normal=normal)

    dielectric = graph.mix(specular, reflect(f0, roughness, normal))
    if transmits and solid:
        # Blender tints by the root of the colour at each crossing, the guide by the colour.
        glass = graph.shader("ShaderNodeBsdfPrincipled", ggx, Base_Color=colour * colour, Roughness=roughness, IOR=ior,
                             Transmission_Weight=1.0, Normal=normal)
        dielectric = graph.mix(t, glass, dielectric)
    elif transmits and has("Roughness") and (node.inputs["Roughness"].is_linked or node.inputs["Roughness"].default_value >= 0.01):
        dielectric = graph.add(dielectric, graph.mix(t, portal(graph, colour, roughness, normal or plain_normal, eye, f0, specular)))
    elif transmits:
        schlick = f0 + (1.0 - f0) * (1.0 - view).most(0.0).power(5.0)
        passing = graph.shader("ShaderNodeBsdfTransparent", Color=colour * (1.0 - specular * schlick))
        dielectric = graph.add(dielectric, graph.mix(t, passing))
    mirrors = graph.mix(metal, reflect(colour, roughness, normal), dielectric)
    if has_coat:
        mirrors = graph.mix(dimmed, mirrors)
    diffuse = graph.shader("ShaderNodeBsdfDiffuse", Color=colour * kept, Normal=normal)
    layers = [mirrors, graph.mix((1.0 - metal) * (1.0 - t), diffuse)]
    if has_sheen:
        layers = [graph.mix(under_sheen, graph.add(*layers)), graph.mix(dimmed, shining) if has_coat else shining]
    if has_coat:
        layers.append(graph.mix(coat, reflect((0.04, 0.04, 0.04), coat_roughness, coat_normal)))
    if has("Emission Strength"):
        layers.append(graph.shader("ShaderNodeEmission", Color=get("Emission Color"), Strength=get("Emission Strength")))
    closure = graph.add(*layers)
    if single_sided and not transmits:
        closure = backs(graph, closure)
    if has("Alpha") and (node.inputs["Alpha"].is_linked or node.inputs["Alpha"].default_value < 1):
        closure = graph.mix(get("Alpha"), closure, graph.shader("ShaderNodeBsdfTransparent", Color=white))
    return closure


def unlit(graph, emission, mix, single_sided):
    """Shows its colour to the camera, in mirrors and through glass; black for all other rays."""
    colour = graph.shader("ShaderNodeEmission", Color=graph.input(emission.inputs["Color"]))
    path = graph.node("ShaderNodeLightPath").outputs
    seen = Value(graph, path["Is Camera Ray"]).most(Value(graph, path["Is Singular Ray"])).most(Value(graph, path["Is Transmission Ray"]))
    closure = graph.mix(seen, colour)
    if single_sided:
        closure = backs(graph, closure)
    if mix is not None:
        closure = graph.mix(graph.input(mix.inputs[0]), closure, graph.shader("ShaderNodeBsdfTransparent", Color=(1.0, 1.0, 1.0)))
    return closure


def as_in_the_guide(lamp):
    """Changes all materials. `lamp` is the place of the lamp, or the direction to it and a 0, or None."""
    images = tables()
    for image in list(bpy.data.images):
        if image.colorspace_settings.name == "sRGB" and not image.is_float and image.users and image.size[0]:
            decode(image)
    for material in [m for m in bpy.data.materials if m.use_nodes and m.users]:
        tree = material.node_tree
        graph = Graph(tree, images)
        output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
        if not output.inputs["Surface"].is_linked:
            continue
        top = output.inputs["Surface"].links[0].from_node
        emission = next((node for node in tree.nodes if node.type == "EMISSION"), None)
        volume = output.inputs["Volume"].links[0].from_node if output.inputs["Volume"].is_linked else None
        if top.type == "BSDF_PRINCIPLED":
            closure = principled(graph, top, volume is not None, material.use_backface_culling, lamp)
        elif top.type == "MIX_SHADER" and emission:
            has_alpha = top.inputs[2].links[0].from_node.type == "MIX_SHADER"
            closure = unlit(graph, emission, top if has_alpha else None, material.use_backface_culling)
            material.cycles.emission_sampling = "NONE"
        else:
            raise ValueError(f"material {material.name} is of no known kind")
        tree.links.new(output.inputs["Surface"], closure)
        if volume is not None:
            colour, density = volume.inputs["Color"], volume.inputs["Density"]
            absorbed = -np.log(np.maximum(colour.default_value[:3], 1e-6))
            density.default_value *= absorbed.max()
            colour.default_value = (*(1 - absorbed / max(absorbed.max(), 1e-9)), 1)
        material.use_backface_culling = False
        material.cycles.use_bump_map_correction = top.type == "BSDF_PRINCIPLED" and keeps_light(top)


def keeps_light(node):
    """Whether what its shading normals reflect into the surface is to go on outside of it, as the guide has it for mirrors and clear
    glass. Without Cycles' correction the inside of clear glass with smooth normals is black where they lean, as at the rim of a vase."""
    plain = lambda name: not node.inputs[name].is_linked
    smooth = lambda name: plain(name) and node.inputs[name].default_value < 0.01
    has_coat = not smooth("Coat Weight")
    return smooth("Roughness") and plain("Normal") and (not has_coat or smooth("Coat Roughness") and plain("Coat Normal"))


def decode(image):
    """Replaces the 8-bit sRGB image by its linear values, so that texels are decoded before they are filtered."""
    width, height = image.size
    pixels = np.empty(width * height * 4, "f4")
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(-1, 4)
    colour = pixels[:, :3]
    pixels[:, :3] = np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)
    made = bpy.data.images.new(image.name + " linear", width, height, alpha=True, float_buffer=True, is_data=True)
    made.alpha_mode = "CHANNEL_PACKED"
    made.pixels.foreach_set(pixels.ravel())
    made.pack()
    image.user_remap(made)
