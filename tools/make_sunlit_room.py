#!/usr/bin/env python3
"""tools/make_sunlit_room.py ROOM.gltf: a room of 5 x 4 x 3 m whose only light comes in through a window, 1 % of its walls.

Needs nothing but Python. Light it with --sun or --environment; the sun of --sun 100,33 falls on the ball of glass on the floor.
"""

import base64
import json
import math
import struct
import sys

WALL, FLOOR, RED, GLASS, METAL = range(5)


def material(name, colour, roughness=1.0, metallic=0.0, **extensions):
    pbr = {"baseColorFactor": [*colour, 1], "roughnessFactor": roughness, "metallicFactor": metallic}
    return {"name": name, "pbrMetallicRoughness": pbr, "doubleSided": True, "extensions": extensions}


MATERIALS = [
    material("wall", (0.8, 0.78, 0.74)),
    material("floor", (0.45, 0.3, 0.18), 0.6),
    material("red", (0.65, 0.12, 0.08)),
    material("glass", (1, 1, 1), 0.0, KHR_materials_transmission={"transmissionFactor": 1}, KHR_materials_volume={"thicknessFactor": 1}),
    material("metal", (0.95, 0.75, 0.4), 0.25, 1.0),
]


def box(low, high):
    """Quads around a box, counter-clockwise as seen from outside."""
    corner = lambda i, j, k: [(low, high)[s][axis] for axis, s in enumerate((i, j, k))]
    sides = ["000 010 110 100", "001 101 111 011", "000 001 011 010", "100 110 111 101", "000 100 101 001", "010 011 111 110"]
    return [[corner(*map(int, name)) for name in side.split()] for side in sides]


def sphere(centre, radius, count=64):
    at = lambda i, j: [
        centre[0] + radius * math.sin(math.pi * i / count) * math.cos(2 * math.pi * j / count),
        centre[1] + radius * math.cos(math.pi * i / count),
        centre[2] - radius * math.sin(math.pi * i / count) * math.sin(2 * math.pi * j / count),
    ]
    return [[at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)] for i in range(count) for j in range(count)]


def meshes():
    """Name, material, quads, and the centre of smooth normals."""
    # The wall at x = 2.5, 0.2 m thick, around the window.
    low, high = (1.1, -0.6), (1.9, 0.6)
    frame = [
        ((2.5, 0, -2), (2.7, low[0], 2)),
        ((2.5, high[0], -2), (2.7, 3, 2)),
        ((2.5, low[0], -2), (2.7, high[0], low[1])),
        ((2.5, low[0], high[1]), (2.7, high[0], 2)),
    ]
    yield "wall with window", WALL, [quad for part in frame for quad in box(*part)], None
    yield "ceiling and back", WALL, box((-2.7, 3, -2.2), (2.7, 3.2, 2.2)) + box((-2.7, 0, -2.2), (2.7, 3, -2)), None
    yield "front", WALL, box((-2.7, 0, 2), (2.7, 3, 2.2)), None
    yield "red wall", RED, box((-2.7, 0, -2), (-2.5, 3, 2)), None
    yield "floor", FLOOR, box((-2.7, -0.2, -2.2), (2.7, 0, 2.2)), None
    yield "table", WALL, box((-1.9, 0, -1.8), (-0.9, 0.7, -0.9)), None
    yield "glass ball", GLASS, sphere((0.55, 0.35, -0.6), 0.35), (0.55, 0.35, -0.6)
    yield "metal ball", METAL, sphere((-1.4, 1.0, -1.35), 0.3), (-1.4, 1.0, -1.35)


def main():
    scene = {
        "asset": {"version": "2.0"}, "scene": 0, "materials": MATERIALS, "buffers": [], "bufferViews": [], "accessors": [], "meshes": [],
        "extensionsUsed": ["KHR_materials_transmission", "KHR_materials_volume"],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 1.0, "aspectRatio": 1.5, "znear": 0.01}}],
    }
    data = bytearray()

    def accessor(rows, kind, component, code):
        flat = [value for row in rows for value in row]
        scene["bufferViews"].append({"buffer": 0, "byteOffset": len(data), "byteLength": 4 * len(flat)})
        data.extend(struct.pack(f"<{len(flat)}{code}", *flat))
        found = {"bufferView": len(scene["bufferViews"]) - 1, "componentType": component, "count": len(rows), "type": kind}
        if kind == "VEC3":
            found.update(min=[min(row[axis] for row in rows) for axis in range(3)], max=[max(row[axis] for row in rows) for axis in range(3)])
        scene["accessors"].append(found)
        return len(scene["accessors"]) - 1

    for name, number, quads, centre in meshes():
        positions = [corner for quad in quads for corner in quad]
        attributes = {"POSITION": accessor(positions, "VEC3", 5126, "f")}
        if centre:
            towards = [[a - b for a, b in zip(place, centre)] for place in positions]
            attributes["NORMAL"] = accessor([[x / math.hypot(*w) for x in w] for w in towards], "VEC3", 5126, "f")
        # Triangles at the poles have no area.
        triangles = [[4 * q + k for k in corners] for q in range(len(quads)) for corners in ((0, 1, 2), (0, 2, 3))]
        flat = lambda corners: len({tuple(round(x, 9) for x in positions[k]) for k in corners}) < 3
        indices = accessor([[k] for corners in triangles if not flat(corners) for k in corners], "SCALAR", 5125, "I")
        scene["meshes"].append({"name": name, "primitives": [{"attributes": attributes, "indices": indices, "material": number}]})
    # In a corner, towards the other side.
    turn, lean = 0.62, -0.28
    rotation = [math.cos(turn / 2) * math.sin(lean / 2), math.sin(turn / 2) * math.cos(lean / 2), -math.sin(turn / 2) * math.sin(lean / 2),
                math.cos(turn / 2) * math.cos(lean / 2)]
    scene["nodes"] = [{"mesh": k} for k in range(len(scene["meshes"]))]
    scene["nodes"].append({"name": "camera", "camera": 0, "translation": [2.1, 1.6, 1.8], "rotation": rotation})
    scene["scenes"] = [{"nodes": list(range(len(scene["nodes"])))}]
    scene["buffers"] = [{"byteLength": len(data), "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode()}]
    with open(sys.argv[1], "w", encoding="utf-8") as file:
        json.dump(scene, file)


if __name__ == "__main__":
    main()
