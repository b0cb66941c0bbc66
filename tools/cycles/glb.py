"""Reads and writes binary glTF files (.glb), and finds where things are in them: for the scripts beside this one."""

import copy
import json
import struct

import numpy as np

FLOAT, USHORT, UINT = 5126, 5123, 5125


def read(path):
    """The JSON part as a dictionary, and the binary part."""
    data = open(path, "rb").read()
    if data[:4] != b"glTF":
        raise SystemExit(f"{path} is not a binary glTF file (.glb)")
    length = struct.unpack_from("<I", data, 12)[0]
    rest = data[20 + length :]
    binary = rest[8 : 8 + struct.unpack_from("<I", rest)[0]] if rest else b""
    return json.loads(data[20 : 20 + length]), bytearray(binary)


def write(path, gltf, binary):
    gltf["buffers"] = [{"byteLength": len(binary)}]
    text = json.dumps(gltf, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    binary = bytes(binary) + b"\0" * (-len(binary) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    with open(path, "wb") as out:
        out.write(b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks)


def add(gltf, key, value):
    """Appends to one of the file's lists; the index of the new entry."""
    gltf.setdefault(key, []).append(value)
    return len(gltf[key]) - 1


def add_bytes(gltf, binary, data):
    """A new buffer view."""
    binary += b"\0" * (-len(binary) % 4)
    view = add(gltf, "bufferViews", {"buffer": 0, "byteOffset": len(binary), "byteLength": len(data)})
    binary += data
    return view


def add_accessor(gltf, binary, array):
    """A new accessor of float vectors, or of indices where the array has one dimension."""
    array = np.asarray(array)
    if array.ndim == 1:
        kind, array = "SCALAR", array.astype("<u2" if array.max() < 65535 else "<u4")
    else:
        kind, array = f"VEC{array.shape[1]}", array.astype("<f4")
    component = {"u2": USHORT, "u4": UINT, "f4": FLOAT}[array.dtype.str[1:]]
    view = add_bytes(gltf, binary, array.tobytes())
    accessor = {"bufferView": view, "componentType": component, "count": len(array), "type": kind}
    if kind == "VEC3":
        accessor |= {"min": array.min(0).tolist(), "max": array.max(0).tolist()}
    return add(gltf, "accessors", accessor)


def read_accessor(gltf, binary, index):
    """The numbers of an accessor, a row each, as floats. Normalized whole numbers become what they stand for."""
    accessor = gltf["accessors"][index]
    width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}[accessor["type"]]

    def rows(part, component, count, width):
        kind = np.dtype({5120: "i1", 5121: "u1", 5122: "<i2", USHORT: "<u2", UINT: "<u4", FLOAT: "<f4"}[component])
        view = gltf["bufferViews"][part["bufferView"]]
        start, step = view.get("byteOffset", 0) + part.get("byteOffset", 0), view.get("byteStride", width * kind.itemsize)
        return np.ndarray((count, width), kind, bytes(binary), start, (step, kind.itemsize))

    component, count = accessor["componentType"], accessor["count"]
    values = np.zeros((count, width)) if "bufferView" not in accessor else rows(accessor, component, count, width).astype(float)
    if sparse := accessor.get("sparse"):
        places = rows(sparse["indices"], sparse["indices"]["componentType"], sparse["count"], 1)[:, 0]
        values[places] = rows(sparse["values"], component, sparse["count"], width)
    if accessor.get("normalized"):
        values = np.maximum(values / {5120: 127, 5121: 255, 5122: 32767, USHORT: 65535}[component], -1)
    return values


def put_at_rest(gltf, binary):
    """Adds the morph targets to all meshes by their weights at rest, and takes them out: positions, normals and tangents."""
    for node in gltf["nodes"]:
        if "mesh" not in node or not any("targets" in p for p in gltf["meshes"][node["mesh"]]["primitives"]):
            continue
        mesh = copy.deepcopy(gltf["meshes"][node["mesh"]])  # other nodes may have other weights
        weights = node.pop("weights", mesh.pop("weights", []))
        for primitive in mesh["primitives"]:
            targets = primitive.pop("targets", [])
            for name in {name for target in targets for name in target}:
                own = read_accessor(gltf, binary, primitive["attributes"][name])
                for weight, target in zip(weights, targets):
                    if name in target:
                        own[:, :3] += weight * read_accessor(gltf, binary, target[name])
                if name != "POSITION":
                    own[:, :3] /= np.maximum(np.linalg.norm(own[:, :3], axis=1, keepdims=True), 1e-30)
                primitive["attributes"][name] = add_accessor(gltf, binary, own)
        node["mesh"] = add(gltf, "meshes", mesh)


def add_node(gltf, node):
    """A new root node of the first scene that is shown."""
    index = add(gltf, "nodes", node)
    gltf["scenes"][gltf.get("scene", 0)]["nodes"].append(index)
    return index


def local_matrix(node):
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    x, y, z, w = node.get("rotation", [0, 0, 0, 1])
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] *= node.get("scale", [1, 1, 1])
    matrix[:3, 3] = node.get("translation", [0, 0, 0])
    return matrix


def world_matrices(gltf):
    """(node, its matrix to the world), for all nodes of the scene."""
    todo = [(index, np.eye(4)) for index in gltf["scenes"][gltf.get("scene", 0)]["nodes"]]
    while todo:
        index, parent = todo.pop()
        node = gltf["nodes"][index]
        matrix = parent @ local_matrix(node)
        yield node, matrix
        todo += [(child, matrix) for child in node.get("children", [])]


def bounding_sphere(gltf):
    """Centre and radius of the sphere around the box around all meshes. Skinned meshes count as they are stored."""
    corners = []
    for node, matrix in world_matrices(gltf):
        for primitive in gltf["meshes"][node["mesh"]]["primitives"] if "mesh" in node else []:
            position = gltf["accessors"][primitive["attributes"]["POSITION"]]
            ends = np.array([position["min"], position["max"]], float)
            box = [[*(ends[k >> d & 1][d] for d in range(3)), 1.0] for k in range(8)]
            corners += [(np.eye(4) if "skin" in node else matrix) @ corner for corner in box]
    low, high = np.min(corners, 0)[:3], np.max(corners, 0)[:3]
    return (low + high) / 2, np.linalg.norm(high - low) / 2


def camera_matrix(gltf):
    """The first camera's: columns are right, up, back, place."""
    return next(matrix for node, matrix in world_matrices(gltf) if "camera" in node)
