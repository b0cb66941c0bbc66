"""materials_board.py OUT.glb: a test scene with one object for each kind of glTF material, on a grey ground, with a camera.

From front to back, left to right:
  plastic of roughness 0.1, 0.3, 0.6, 1
  gold of roughness 0.05, 0.2, 0.5, and metalness 0.5
  clear coat over red, a checker of metalness and roughness, vertex colours, specular colour with ior 1.8
  a plate with a normal map (two places wide), a card with alpha BLEND, a card with alpha MASK

It has no light: add one with with_lamp.py, or use a constant environment. Needs numpy and pillow.
"""

import io
import math
import sys

import numpy as np
from PIL import Image

import glb

STEP, RADIUS = 1.15, 0.48
gltf = {
    "asset": {"version": "2.0", "generator": "materials_board.py"},
    "scene": 0,
    "scenes": [{"nodes": []}],
    "extensionsUsed": ["KHR_materials_clearcoat", "KHR_materials_ior", "KHR_materials_specular"],
}
binary = bytearray()


def texture(pixels):
    """Of an array of rows of colours from 0 to 255, as a PNG inside the file."""
    png = io.BytesIO()
    Image.fromarray(np.asarray(pixels).astype("u1")).save(png, "PNG", optimize=True)
    view = glb.add_bytes(gltf, binary, png.getvalue())
    image = glb.add(gltf, "images", {"mimeType": "image/png", "bufferView": view})
    return {"index": glb.add(gltf, "textures", {"source": image})}


def checker(size, tiles, odd, even):
    y, x = np.mgrid[:size, :size] * tiles // size
    return np.where(((x + y) % 2)[..., None] == 1, odd, even)


def bumps(size, tiles, steepness):
    """Normals of the height -cos(x) - cos(y). A picture's rows run down, glTF's bitangent up."""
    y, x = (np.mgrid[:size, :size] + 0.5) / size * tiles * 2 * math.pi
    normal = np.stack([-steepness * np.sin(x), steepness * np.sin(y), np.ones_like(x)], -1)
    return np.round((normal / np.linalg.norm(normal, axis=-1, keepdims=True) * 0.5 + 0.5) * 255)


def geometry(position, normal, uv, indices, colour=None):
    arrays = {"POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv}
    if colour is not None:
        arrays["COLOR_0"] = colour
    attributes = {name: glb.add_accessor(gltf, binary, array) for name, array in arrays.items()}
    return {"attributes": attributes, "indices": glb.add_accessor(gltf, binary, indices)}


def sphere(around=48, along=24):
    """Position, normal, texture coordinates and indices of a ball. Its poles are rings of no size."""
    v, u = np.mgrid[: along + 1, : around + 1]
    turn, fall = 2 * math.pi * u / around, math.pi * v / along
    normal = np.stack([np.sin(fall) * np.sin(turn), np.cos(fall), np.sin(fall) * np.cos(turn)], -1).reshape(-1, 3)
    row = around + 1
    corner = (np.arange(along)[:, None] * row + np.arange(around)).ravel()
    upper = np.stack([corner, corner + row + 1, corner + 1], 1)[around:]
    lower = np.stack([corner, corner + row, corner + row + 1], 1)[:-around]
    return RADIUS * normal, normal, np.stack([u / around, v / along], -1).reshape(-1, 2), np.concatenate([lower, upper]).ravel()


def rectangle(width, height):
    """Upright, facing the viewer."""
    corners = [[0, 0], [1, 0], [1, 1], [0, 1]]
    position = [[(x - 0.5) * width, (y - 0.5) * height, 0] for x, y in corners]
    return geometry(position, [[0, 0, 1]] * 4, [[x, 1 - y] for x, y in corners], [0, 1, 2, 0, 2, 3])


def put(shape, place, name, factors, rotation=(0, 0, 0, 1), **more):
    """A node with its own mesh and material. `factors` is pbrMetallicRoughness, `more` the rest of the material."""
    material = glb.add(gltf, "materials", {"name": name, "pbrMetallicRoughness": {"metallicFactor": 0} | factors} | more)
    mesh = glb.add(gltf, "meshes", {"name": name, "primitives": [shape | {"material": material}]})
    glb.add_node(gltf, {"name": name, "mesh": mesh, "translation": list(place), "rotation": list(rotation)})


def cell(column, row, height=RADIUS):
    return (column - 1.5) * STEP, height, (1.5 - row) * STEP


def turned(degrees):
    """About the x axis."""
    half = math.radians(degrees) / 2
    return math.sin(half), 0, 0, math.cos(half)


ball_arrays = sphere()
ball = geometry(*ball_arrays)
coloured_ball = ball | {"attributes": ball["attributes"] | {"COLOR_0": glb.add_accessor(gltf, binary, 0.5 + 0.45 * ball_arrays[1])}}

put(rectangle(5.6, 5.6), (0, 0, 0), "ground", {"baseColorFactor": [0.5, 0.5, 0.5, 1], "roughnessFactor": 1}, turned(-90))

for column, roughness in enumerate([0.1, 0.3, 0.6, 1]):
    plastic = {"baseColorFactor": [0.1, 0.35, 0.7, 1], "roughnessFactor": roughness}
    put(ball, cell(column, 0), f"plastic {roughness}", plastic)

for column, roughness in enumerate([0.05, 0.2, 0.5]):
    gold = {"baseColorFactor": [1, 0.77, 0.34, 1], "metallicFactor": 1, "roughnessFactor": roughness}
    put(ball, cell(column, 1), f"gold {roughness}", gold)
put(ball, cell(3, 1), "half metal", {"baseColorFactor": [0.8, 0.45, 0.3, 1], "metallicFactor": 0.5, "roughnessFactor": 0.3})

put(ball, cell(0, 2), "clear coat", {"baseColorFactor": [0.6, 0.04, 0.03, 1], "roughnessFactor": 0.6},
    extensions={"KHR_materials_clearcoat": {"clearcoatFactor": 1, "clearcoatRoughnessFactor": 0.1}})
metal_and_rough, plastic_and_smooth = [0, 140, 255], [0, 60, 0]
put(ball, cell(1, 2), "checker", {"baseColorFactor": [0.7, 0.7, 0.75, 1], "metallicFactor": 1, "roughnessFactor": 1,
    "metallicRoughnessTexture": texture(checker(64, 8, metal_and_rough, plastic_and_smooth))})
put(coloured_ball, cell(2, 2), "vertex colours", {"baseColorFactor": [1, 1, 1, 1], "roughnessFactor": 0.8})
put(ball, cell(3, 2), "specular colour", {"baseColorFactor": [0.05, 0.05, 0.05, 1], "roughnessFactor": 0.25},
    extensions={"KHR_materials_ior": {"ior": 1.8}, "KHR_materials_specular": {"specularFactor": 0.8, "specularColorFactor": [1, 0.6, 0.3]}})

lean = turned(-20)
plate = rectangle(2 * STEP - 0.15, 1)
put(plate, cell(0.5, 3, 0.55), "normal map", {"baseColorFactor": [0.25, 0.5, 0.3, 1], "roughnessFactor": 0.35}, lean,
    doubleSided=True, normalTexture=texture(np.concatenate([bumps(64, 2, 0.6)] * 2, 1)))
card = rectangle(1, 1)
for column, mode, colour, alphas in [(2, "BLEND", [230, 60, 60], (200, 60)), (3, "MASK", [60, 200, 90], (255, 0))]:
    picture = checker(64, 4, [*colour, alphas[0]], [*colour, alphas[1]])
    put(card, cell(column, 3, 0.55), mode, {"roughnessFactor": 0.9, "baseColorTexture": texture(picture)}, lean,
        doubleSided=True, alphaMode=mode)

down = math.radians(42)
back = np.array([0, math.sin(down), math.cos(down)])
camera = np.eye(4)
camera[:3, 1], camera[:3, 2], camera[:3, 3] = [0, back[2], -back[1]], back, [0, 0.2, 0] + 9 * back
perspective = {"yfov": math.radians(35), "aspectRatio": 1, "znear": 0.1, "zfar": 100}
glb.add_node(gltf, {"name": "camera", "matrix": camera.T.ravel().tolist(),
    "camera": glb.add(gltf, "cameras", {"type": "perspective", "perspective": perspective})})
glb.write(sys.argv[1], gltf, binary)
