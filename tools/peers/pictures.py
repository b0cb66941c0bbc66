"""Pictures of two scenes with glass: photonmill with its defaults, and Mitsuba 3's path tracer on LLVM.

Both render the same triangles, with the normals of true balls: photonmill from glTF, Mitsuba from PLY. Each run is a process of its
own, Mitsuba's is this file as a program. What is right is a long run of the same path tracer with other random numbers, whose own
error, estimated from its halves, is taken out of all errors (in squares, as both are independent). Of one thing the two think differently:
a metal of glTF reflects more at grazing angles (Schlick), a conductor of Mitsuba does not, which is 0.2 % of error in the box.

Settings of Mitsuba were chosen by trying: samplers (independent takes 1.6 to 2.5 times as long to the same error as multijitter;
stratified, orthogonal and ldsampler are no better), rr_depth 2, 5 and 16."""
import hashlib
import json
import os
import sys
import tempfile
import time
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import numpy as np

from peers import environment, report
from peers.bench import SAME, first_below, prepare, print_progress, processor
from peers.failure import Failure
from peers.mitsuba3 import Mitsuba, started
from peers.photonmill import Photonmill
from peers.reference import root_mean_square
from peers.run import Machine, clocked

TARGETS, QUICK_TARGETS = [0.2, 0.1, 0.05], [0.5, 0.3]
# Settings that photonmill's pilot chooses.
CHOSEN = ["photons", "caustic_photons", "neighbours", "samples", "shadow_rays"]
# Mitsuba's first budget, samples of a pixel.
FIRST_SAMPLES = 16
# Paths of one launch of Mitsuba at most, so that memory does not grow with the budget: four times as many are no better.
PATHS = 1 << 20
# Triangles of a ball: 20 * 4^5.
SUBDIVISIONS = 5


@dataclass
class Material:
    gltf: dict
    # What a shape of Mitsuba has besides its triangles.
    mitsuba: dict


def rgb(values):
    return {"type": "rgb", "value": list(values)}


def matt(*colour):
    surface = {"baseColorFactor": [*colour, 1], "metallicFactor": 0, "roughnessFactor": 1}
    gltf = {"pbrMetallicRoughness": surface, "extensions": {"KHR_materials_specular": {"specularFactor": 0}}}
    return Material(gltf, {"bsdf": {"type": "diffuse", "reflectance": rgb(colour)}})


def lamp(radiance):
    """Black, and emits to its front, W/m2/sr."""
    material = matt(0, 0, 0)
    material.gltf["emissiveFactor"] = [1, 1, 1]
    material.gltf["extensions"]["KHR_materials_emissive_strength"] = {"emissiveStrength": radiance}
    material.mitsuba["emitter"] = {"type": "area", "radiance": rgb([radiance] * 3)}
    return material


def mirror(share):
    surface = {"baseColorFactor": [share, share, share, 1], "metallicFactor": 1, "roughnessFactor": 0}
    bsdf = {"type": "conductor", "material": "none", "specular_reflectance": rgb([share] * 3)}
    return Material({"pbrMetallicRoughness": surface}, {"bsdf": bsdf})


def glass(index):
    extensions = {
        "KHR_materials_transmission": {"transmissionFactor": 1},
        "KHR_materials_ior": {"ior": index},
        "KHR_materials_volume": {"thicknessFactor": 1},
    }
    gltf = {"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0}, "extensions": extensions}
    return Material(gltf, {"bsdf": {"type": "dielectric", "int_ior": index, "ext_ior": 1.0}})


@dataclass
class Rectangle:
    """Its front is where right x up points to."""

    corner: tuple
    right: tuple
    up: tuple

    def mesh(self):
        import trimesh

        corner, right, up = np.array([self.corner, self.right, self.up], dtype=float)
        front = np.cross(right, up) / np.linalg.norm(np.cross(right, up))
        points = [corner, corner + right, corner + right + up, corner + up]
        return trimesh.Trimesh(points, [[0, 1, 2], [0, 2, 3]], vertex_normals=[front] * 4, process=False)


@dataclass
class Ball:
    centre: tuple
    radius: float

    def mesh(self):
        import trimesh

        unit = trimesh.creation.icosphere(subdivisions=SUBDIVISIONS)
        points = np.array(self.centre) + self.radius * unit.vertices
        return trimesh.Trimesh(points, unit.faces, vertex_normals=unit.vertices, process=False)


@dataclass
class Scene:
    eye: tuple
    target: tuple
    # Degrees from edge to edge of the picture.
    field: float
    # Shape and material of each thing; metres.
    things: dict

    def write(self, folder):
        """The scene as one glTF file, whose path is given back, and each thing as PLY."""
        import trimesh

        meshes = {name: shape.mesh() for name, (shape, _) in self.things.items()}
        for name, mesh in meshes.items():
            (folder / f"{name}.ply").write_bytes(trimesh.exchange.ply.export_ply(mesh, vertex_normal=True))
        whole = trimesh.Scene(meshes)
        whole.camera = trimesh.scene.Camera(resolution=(1, 1), fov=(self.field, self.field))
        whole.camera_transform = self.camera_to_world()
        path = folder / "scene.glb"
        path.write_bytes(trimesh.exchange.gltf.export_glb(whole, include_normals=True, tree_postprocessor=self.add_materials))
        return path

    def add_materials(self, tree):
        tree["materials"] = [{"name": name, **material.gltf} for name, (_, material) in self.things.items()]
        for mesh in tree["meshes"]:
            mesh["primitives"][0]["material"] = list(self.things).index(mesh["name"])
        tree["extensionsUsed"] = sorted({name for material in tree["materials"] for name in material.get("extensions", {})})

    def camera_to_world(self):
        """glTF's cameras look along -z."""
        back = np.subtract(self.eye, self.target) / np.linalg.norm(np.subtract(self.eye, self.target))
        right = np.cross([0, 1, 0], back) / np.linalg.norm(np.cross([0, 1, 0], back))
        matrix = np.eye(4)
        matrix[:3] = np.stack([right, np.cross(back, right), back, self.eye], axis=1)
        return matrix


WHITE = matt(0.7, 0.7, 0.7)
SCENES = {
    "box": Scene(
        eye=(0, 1, 4.2),
        target=(0, 1, 0),
        field=28.6,
        things={
            "floor": (Rectangle((-1, 0, -1), (0, 0, 2), (2, 0, 0)), WHITE),
            "ceiling": (Rectangle((-1, 2, -1), (2, 0, 0), (0, 0, 2)), WHITE),
            "back": (Rectangle((-1, 0, -1), (2, 0, 0), (0, 2, 0)), WHITE),
            "left": (Rectangle((-1, 0, -1), (0, 2, 0), (0, 0, 2)), matt(0.63, 0.06, 0.05)),
            "right": (Rectangle((1, 0, -1), (0, 0, 2), (0, 2, 0)), matt(0.14, 0.45, 0.09)),
            "lamp": (Rectangle((-0.25, 1.98, -0.25), (0.5, 0, 0), (0, 0, 0.5)), lamp(15)),
            "mirror": (Ball((-0.4, 0.4, -0.3), 0.4), mirror(0.95)),
            "glass": (Ball((0.4, 0.35, 0.3), 0.35), glass(1.5)),
        },
    ),
    "ball": Scene(
        eye=(1.5, 2.2, 4.5),
        target=(0.1, 0.4, 0),
        field=37.2,
        things={
            "floor": (Rectangle((-3, 0, -3), (0, 0, 6), (6, 0, 0)), matt(0.6, 0.6, 0.6)),
            "lamp": (Rectangle((-1.2, 3, -0.2), (0.4, 0, 0), (0, 0, 0.4)), lamp(80)),
            "glass": (Ball((0, 0.75, 0), 0.7), glass(1.5)),
        },
    ),
}


@dataclass
class Image:
    pixels: np.ndarray  # (size, size, 3), W/m2/sr
    whole_s: float
    computing_s: float
    # What the program says of the run.
    reported: dict


class PhotonmillPicture(Photonmill):
    method = "photon maps and shadow rays, divided as a pilot chooses"
    settings = "render --size NxN --error E, all else by default"

    def run(self, file, size, target):
        picture, reported = self.machine.folder / "photonmill.exr", self.machine.folder / "photonmill.json"
        places = ["-o", picture, "--json", reported, "-q"]
        _, whole_s = clocked([self.program, "render", file, "--size", f"{size}x{size}", "--error", f"{100 * target:g}%", *places])
        reported = json.loads(reported.read_text())
        wall_s = {pass_["name"]: pass_["wall_ms"] / 1e3 for pass_ in reported["timings"] if pass_["wall_ms"] is not None}
        return Image(pixels_of(picture), whole_s, wall_s["round"], {**reported, "wall_s": wall_s})


class MitsubaPicture(Mitsuba):
    name = "mitsuba-path"
    method = "path tracing, next event estimation with multiple importance sampling"
    settings = f"llvm_ad_rgb, path, max_depth -1, rr_depth 5, multijitter sampler, box filter, {PATHS} paths a launch at most"

    def run(self, scene, size, seed, **budget):
        """Of so many `samples` of a pixel, or as many as fit into `seconds`."""
        result = self.machine.folder / "mitsuba.npz"
        asked = {"scene": scene, "folder": str(self.machine.folder / scene), "size": size, "result": str(result)}
        asked.update(seed=seed, threads=self.machine.threads, budget=budget, together=samples_together(size, **budget))
        answer, whole_s = clocked([sys.executable, "-m", "peers.pictures", json.dumps(asked)], env=self.environment)
        reported = json.loads(answer.splitlines()[-1])
        with np.load(result) as found:
            return Image(found["pixels"], whole_s, reported["computing_s"], {**reported, **found})


def samples_together(size, samples=None, seconds=None):
    """Samples of a pixel in one launch: a power of 4, which this sampler spreads best."""
    most = max(1, PATHS // size**2)
    return 4 ** ((min(most, samples or most).bit_length() - 1) // 2)


def pixels_of(file):
    import mitsuba  # reads EXR

    mitsuba.set_variant("scalar_rgb")
    return np.array(mitsuba.Bitmap(str(file)), dtype=float)[:, :, :3]


@dataclass
class Reference:
    pixels: np.ndarray
    # Pixels that see no lamp straight.
    counts: np.ndarray
    # Its own, from its halves.
    error: float
    samples: int

    def mean(self):
        return float(self.pixels[self.counts].mean())

    def error_of(self, pixels):
        if not np.isfinite(pixels).all():
            raise Failure("a pixel is no number")
        apart = root_mean_square((pixels - self.pixels)[self.counts]) / self.mean()
        # The reference's own error is known to some 10 %: below twice it others are known roughly, and far below not at all.
        return float(np.sqrt(max(apart**2 - self.error**2, (self.error / 10) ** 2)))

    def level_of(self, pixels):
        return float(pixels[self.counts].mean()) / self.mean()


def reference(mitsuba, scene, size, seconds):
    """Kept in the cache."""
    asked = json.dumps([scene, size, seconds, mitsuba.version]).encode()
    key = hashlib.sha256(Path(__file__).read_bytes() + asked).hexdigest()[:16]
    kept = environment.cache() / f"picture-{key}.npz"
    if not kept.exists():
        found = mitsuba.run(scene, size, seed=1, seconds=seconds).reported
        np.savez(kept, **{name: found[name] for name in ("pixels", "halves_apart", "shining", "samples")})
    with np.load(kept) as known:
        counts = ~(known["shining"] > 0).any(axis=2)
        right = Reference(known["pixels"], counts, 0.0, int(known["samples"]))
        right.error = root_mean_square(known["halves_apart"][counts]) / right.mean()
    return right


def measure(asked):
    targets = QUICK_TARGETS if asked.quick else TARGETS
    size = asked.size or (32 if asked.quick else 128)
    limit_s = asked.limit or (3.0 if asked.quick else 60.0)
    reference_s = asked.reference_seconds or (10.0 if asked.quick else 300.0)
    load = prepare(asked)
    with tempfile.TemporaryDirectory(prefix="bench_peers-") as folder:
        machine = Machine(asked.threads, Path(folder))
        photonmill, mitsuba = PhotonmillPicture(machine, asked.photonmill.absolute()), MitsubaPicture(machine)
        scenes = [compare(scene, size, targets, limit_s, reference_s, photonmill, mitsuba) for scene in SCENES]
    found = {
        "size": size,
        "processor": processor(),
        "threads": asked.threads,
        "limit_s": limit_s,
        "reference_s": reference_s,
        "load_before": load,
        "command": ["tools/bench_peers", *sys.argv[1:]],
        "programs": [{key: getattr(one, key) for key in ("name", "version", "method", "settings")} for one in (photonmill, mitsuba)],
        "scenes": scenes,
    }
    show(found)
    if asked.json:
        report.write_json(found, asked.json)


def compare(scene, size, targets, limit_s, reference_s, photonmill, mitsuba):
    """All runs of one scene."""
    folder = mitsuba.machine.folder / scene
    folder.mkdir()
    file = SCENES[scene].write(folder)
    right = reference(mitsuba, scene, size, reference_s)
    print_progress(f"{scene}: reference of {right.samples} paths a pixel, off by {100 * right.error:.2f} %")
    photonmill.run(file, size, targets[0])
    ours = []
    for target in targets:
        picture = photonmill.run(file, size, target)
        point = {"asked": target, "claimed": picture.reported["total_bound"], **judge(photonmill, scene, picture, right)}
        chosen = {key: picture.reported["settings"][key] for key in CHOSEN}
        ours.append({**point, "chosen": chosen, **{key: picture.reported[key] for key in ("rounds", "error_bound", "end", "device", "wall_s")}})
    best = min(point["error"] for point in ours)
    if right.error > best / 2:
        print_progress(f"warning: the reference of {scene} is too coarse for an error of {100 * best:.2f} %; try a longer --reference-seconds")
    for samples in {FIRST_SAMPLES, samples_together(size)}:
        mitsuba.run(scene, size, seed=2, samples=samples)
    theirs = []
    for level in count():
        picture = mitsuba.run(scene, size, seed=3 + level, samples=FIRST_SAMPLES << level)
        theirs.append({"samples": picture.reported["samples"], **judge(mitsuba, scene, picture, right)})
        if theirs[-1]["error"] <= best or 2 * picture.computing_s > limit_s:
            break
    errors = [point["error"] for point in theirs]
    clocks = {clock: [point[clock] for point in theirs] for clock in ("computing_s", "whole_s")}
    for point in ours:
        point["mitsuba"] = {clock: first_below(point["error"], errors, times) for clock, times in clocks.items()}
    return {
        "name": scene,
        "reference": {"samples": right.samples, "error": right.error, "mean": right.mean(), "pixels": int(right.counts.sum())},
        "photonmill": ours,
        "mitsuba-path": theirs,
    }


def judge(program, scene, picture, right):
    error, level = right.error_of(picture.pixels), right.level_of(picture.pixels)
    print_progress(f"{scene}: {program.name}, {picture.computing_s:.2f} s, error {100 * error:.2f} %")
    # Few samples may be off by chance.
    if abs(level - 1) > max(SAME, 3 * error / np.sqrt(right.counts.sum())):
        print_progress(f"warning: the mean of {program.name} is {level:.3f} of the right one")
    return {"error": error, "level": level, "computing_s": picture.computing_s, "whole_s": picture.whole_s}


def show(found):
    size = found["size"]
    print(f"pictures of {size} x {size} pixels; {found['processor']}, {found['threads']} threads; one run each")
    print(f"photonmill's device: {found['scenes'][0]['photonmill'][0]['device']}")
    for scene in found["scenes"]:
        right = scene["reference"]
        print(f"the reference of {scene['name']} has {right['samples']} paths a pixel and is off by {100 * right['error']:.2f} %")
    print()
    columns = ["scene", "program", "asked, %", "claimed, %", "error, %", "mean / right", "computing, s", "whole, s", "times as long (whole)"]
    report.table(columns, [row for scene in found["scenes"] for row in rows_of(scene)])
    print()
    for program in found["programs"]:
        print(f"{program['name']}: {program['version']}; {program['method']}; {program['settings']}")


def rows_of(scene):
    """Each run of photonmill, and Mitsuba at the same error."""
    name, last = scene["name"], scene["mitsuba-path"][-1]
    for point in scene["photonmill"]:
        error = ("about " if point["error"] < 2 * scene["reference"]["error"] else "") + f"{100 * point['error']:.2f}"
        claimed = "-" if point["claimed"] is None else f"{100 * point['claimed']:.1f}"
        reported = [f"{100 * point['asked']:g}", claimed, error, f"{point['level']:.4f}"]
        yield [name, "photonmill", *reported, f"{point['computing_s']:.2f}", f"{point['whole_s']:.2f}", "1"]
        computing = point["mitsuba"]["computing_s"]
        sign = "above " if not computing else "below " if computing["is_bound"] else ""
        seconds = {clock: times["seconds"] if times else last[clock] for clock, times in point["mitsuba"].items()}
        times = {clock: seconds[clock] / point[clock] for clock in seconds}
        clocks = [sign + f"{seconds['computing_s']:.2f}", sign + f"{seconds['whole_s']:.2f}"]
        yield [name, "mitsuba-path", "-", "-", error, "-", *clocks, sign + f"{times['computing_s']:.3g} ({times['whole_s']:.3g})"]


class Painter:
    """Inside Mitsuba's process that is clocked."""

    def __init__(self, mi, scene, folder, size, together):
        self.mi, self.together = mi, together
        film = {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}}
        parts = {
            name: {"type": "ply", "filename": os.path.join(folder, f"{name}.ply"), **material.mitsuba}
            for name, (_, material) in scene.things.items()
        }
        parts["sensor"] = {
            "type": "perspective",
            "to_world": mi.ScalarTransform4f().look_at(origin=list(scene.eye), target=list(scene.target), up=[0, 1, 0]),
            "fov": scene.field,
            "film": {**film, "pixel_format": "rgb", "component_format": "float32"},
            "sampler": {"type": "multijitter", "sample_count": together},
        }
        self.scene = mi.load_dict({"type": "scene", **parts})
        self.integrator = mi.load_dict({"type": "path", "max_depth": -1, "rr_depth": 5})

    def launch(self, seed):
        return np.asarray(self.mi.render(self.scene, integrator=self.integrator, spp=self.together, seed=seed), dtype=float)

    def shining(self):
        """What of lamps is seen straight."""
        only_emission = self.mi.load_dict({"type": "path", "max_depth": 1})
        return np.asarray(self.mi.render(self.scene, integrator=only_emission, spp=self.together, seed=0), dtype=float)


def main(asked):
    start = time.perf_counter()
    mitsuba, _ = started("llvm_ad_rgb", asked["threads"])
    painter = Painter(mitsuba, SCENES[asked["scene"]], asked["folder"], asked["size"], asked["together"])
    budget, together = asked["budget"], asked["together"]
    begin = time.perf_counter()
    halves, launches = [0.0, 0.0], 0
    while True:
        halves[launches % 2] += painter.launch(asked["seed"] * 1_000_000 + launches)
        launches += 1
        if "samples" in budget and launches * together >= budget["samples"]:
            break
        if "seconds" in budget and launches % 2 == 0 and time.perf_counter() >= begin + budget["seconds"]:
            break
    end = time.perf_counter()
    found = {"pixels": sum(halves) / launches}
    if "seconds" in budget:
        found.update(halves_apart=(halves[0] - halves[1]) / launches, shining=painter.shining())
    np.savez(asked["result"], **found)
    print(json.dumps({"start_s": begin - start, "computing_s": end - begin, "samples": launches * together}))


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
