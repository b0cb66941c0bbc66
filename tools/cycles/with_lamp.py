"""with_lamp.py IN.glb OUT.glb lamp|sun: the scene with one emissive square added, so that Cycles and photonmill have the same light.
with_lamp.py IN.glb OUT.glb sky: the scene without its own lights.

lamp: a twentieth of the scene's size, at 1.1 scene sizes from its centre, up, left and in front as the camera sees it.
sun: 2 degrees wide as seen from the centre, at 20 scene radii, up, right and behind the camera.

Radiance is such that a white diffuse surface at the centre that faces the square has radiance 1. The square is black, has no
specular reflection, emits from one side, and lies outside the picture. The scene needs a camera. Its own lights stay.
Needs numpy.
"""

import math
import sys

import numpy as np

import glb

NAME = "reference lamp"
# Direction from the centre in the camera's axes (right, up, back), distance and side in scene radii.
KINDS = {
    "lamp": ((-1.0, 1.0, 1.0), 2.2, 0.1),
    "sun": ((0.6, 1.0, 0.9), 20.0, 2 * 20.0 * math.tan(math.radians(1))),
}


def add_lamp(gltf, binary, kind):
    direction, distance, side = KINDS[kind]
    centre, radius = glb.bounding_sphere(gltf)
    axes = glb.camera_matrix(gltf)[:3, :3]
    axes = axes / np.linalg.norm(axes, axis=0)
    back = axes @ direction / np.linalg.norm(direction)  # from the centre to the square
    right = np.cross(axes[:, 1], back)
    right /= np.linalg.norm(right)
    up = np.cross(back, right)
    half = side * radius / 2
    place = centre + distance * radius * back
    # Seen from the centre the corners run anticlockwise, so that the front faces it.
    corners = [place + half * (x * right + y * up) for x, y in [(-1, -1), (-1, 1), (1, 1), (1, -1)]]
    radiance = math.pi * (distance / side) ** 2
    material = {
        "name": NAME,
        "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0, "roughnessFactor": 1},
        "emissiveFactor": [1, 1, 1],
        "doubleSided": False,
        "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": radiance},
            "KHR_materials_specular": {"specularFactor": 0},
        },
    }
    primitive = {
        "attributes": {
            "POSITION": glb.add_accessor(gltf, binary, corners),
            "NORMAL": glb.add_accessor(gltf, binary, [-back] * 4),
        },
        "indices": glb.add_accessor(gltf, binary, [0, 1, 2, 0, 2, 3]),
        "material": glb.add(gltf, "materials", material),
    }
    glb.add_node(gltf, {"name": NAME, "mesh": glb.add(gltf, "meshes", {"name": NAME, "primitives": [primitive]})})
    gltf["extensionsUsed"] = sorted({*gltf.get("extensionsUsed", []), *material["extensions"]})


def take_lights_out(gltf):
    for thing in (gltf, *gltf["nodes"]):
        thing.get("extensions", {}).pop("KHR_lights_punctual", None)
    for key in ("extensionsUsed", "extensionsRequired"):
        gltf[key] = [name for name in gltf.get(key, []) if name != "KHR_lights_punctual"]
        if not gltf[key]:
            del gltf[key]
    for material in gltf.get("materials", []):
        material.pop("emissiveFactor", None)
        material.pop("emissiveTexture", None)


if __name__ == "__main__":
    if len(sys.argv) != 4 or sys.argv[3] not in (*KINDS, "sky"):
        raise SystemExit("usage: with_lamp.py IN.glb OUT.glb lamp|sun|sky")
    scene, data = glb.read(sys.argv[1])
    if sys.argv[3] == "sky":
        take_lights_out(scene)
    else:
        add_lamp(scene, data, sys.argv[3])
    glb.write(sys.argv[2], scene, data)
