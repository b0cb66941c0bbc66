"""Mitsuba 3 on LLVM: path tracer and particle tracer. Each run is a process of its own, this file as a program.

Lamps are discs a hundredth of a millimetre before their walls that reflect as the walls do. Irradiance is the
radiance that a wall reflects times pi / albedo, so that both tracers connect to the lamps by shadow rays or to the
sensor in their usual way. `llvm_ad_mono` is the fastest variant: grey light, one channel. Samplers (multijitter, orthogonal,
ldsampler) and rr_depth 2 and 16 were tried and are no better than `independent` and the default 5."""
import json
import os
import sys
import time

import numpy as np

from peers import box, environment
from peers.run import Run, clocked

LAMP_HEIGHT = 1e-5
# Reflection at the texel itself included: its paths have one edge more than the light's way to the texel, and one to the eye.
MAX_DEPTH = box.BOUNCES + 1
# Samples of one launch, so that memory does not grow with the budget, and kernels are the same for all.
PATHS_A_TEXEL = 64
# The particle tracer's camera, outside the open face: from here the far wall's texels are 8 x 8 pixels each.
FILM, CAMERA_DISTANCE = 1024, 2 * box.HALF_EDGE


class Mitsuba:
    def __init__(self, machine):
        self.machine = machine
        import mitsuba

        self.version = f"Mitsuba {mitsuba.__version__}"
        # The compiled kernels' cache lies in the home folder.
        self.environment = {
            **os.environ,
            "DRJIT_LIBLLVM_PATH": environment.llvm(),
            "HOME": str(environment.cache()),
            "PYTHONPATH": os.path.dirname(os.path.dirname(os.path.abspath(__file__))),
            "PYTHONDONTWRITEBYTECODE": "1",
        }

    def run(self, budget, seed):
        result = self.machine.folder / "mitsuba.npy"
        asked = {"tracer": self.tracer, "launches": budget, "seed": seed, "threads": self.machine.threads, "result": str(result)}
        answer, whole_s = clocked([sys.executable, "-m", "peers.mitsuba3", json.dumps(asked)], env=self.environment)
        reported = json.loads(answer.splitlines()[-1])
        return Run(np.load(result), whole_s, reported["computing_s"], reported["sample_count"], {"start-up and scene": reported["start_s"]})


class MitsubaPath(Mitsuba):
    name = "mitsuba-path"
    method = "path tracing from each texel, next event estimation with multiple importance sampling"
    settings = f"llvm_ad_mono, path, max_depth {MAX_DEPTH}, rr_depth 5, independent sampler, {PATHS_A_TEXEL} paths a texel and launch"
    samples = "paths"
    tracer = "path"

    def budget(self, level):
        return 1 << level


class MitsubaParticle(Mitsuba):
    name = "mitsuba-ptracer"
    method = "light tracing into a picture of the whole box, whose pixels are averaged over texels"
    settings = f"llvm_ad_mono, ptracer, max_depth {MAX_DEPTH}, rr_depth 5, hide_emitters, film {FILM} x {FILM}"
    samples = "photons"
    tracer = "ptracer"

    def budget(self, level):
        return 1 << level


class Tracer:
    """Inside the process that is clocked."""

    def __init__(self, mi):
        self.mi = mi
        wall = {"type": "diffuse", "reflectance": {"type": "uniform", "value": box.ALBEDO}}
        scene = {"type": "scene"}
        for number, name in enumerate(box.WALLS):
            scene[name] = {"type": "rectangle", "to_world": self.placed(number, 0, box.HALF_EDGE), "bsdf": wall}
        for number in box.LAMPS:
            light = {"type": "area", "radiance": {"type": "uniform", "value": box.lamp_radiance(number)}}
            place = self.placed(number, LAMP_HEIGHT, box.LAMP_RADIUS)
            scene[f"lamp{number}"] = {"type": "disk", "to_world": place, "bsdf": wall, "emitter": light}
        self.scene = mi.load_dict(scene)

    def placed(self, wall, height, half_size):
        """Mitsuba's rectangles and discs lie around 0 and look along z."""
        axis, u, v = box.axes(wall)
        matrix = np.zeros((4, 4))
        matrix[u, 0] = half_size
        matrix[v, 1] = -box.side(wall) * half_size
        matrix[:3, 2] = box.inward(wall)
        matrix[:3, 3] = box.on_wall(wall, 0, 0)[0] + height * box.inward(wall)
        matrix[3, 3] = 1
        return self.mi.ScalarTransform4f(matrix)


class PathTracer(Tracer):
    """Rays that meet each texel in its middle, from just before it."""

    def __init__(self, mi, dr):
        super().__init__(mi)
        self.dr = dr
        self.integrator = mi.load_dict({"type": "path", "max_depth": MAX_DEPTH, "rr_depth": 5})
        self.sampler = mi.load_dict({"type": "independent"})
        points, normals = box.texels()
        self.origins = mi.Point3f(*(points + 1e-3 * normals).T.astype("f4"))
        self.directions = mi.Vector3f(*-normals.T.astype("f4"))
        self.texel_count = len(points)
        # What the texels of the lamps emit is seen too, and no irradiance.
        self.emitted = np.concatenate([self.lamp_radiance(wall) for wall in range(len(box.WALLS))])

    def lamp_radiance(self, wall):
        distance = np.linalg.norm(box.grid(wall, box.texel_coordinates()) - box.on_wall(wall, 0, 0), axis=1)
        return np.where(distance < box.LAMP_RADIUS, box.lamp_radiance(wall), 0.0) if wall in box.LAMPS else np.zeros(len(distance))

    def launch(self, seed):
        dr, mi = self.dr, self.mi
        count = self.texel_count * PATHS_A_TEXEL
        self.sampler.seed(seed, count)
        texel = dr.arange(mi.UInt32, count) // PATHS_A_TEXEL
        ray = mi.RayDifferential3f(dr.gather(mi.Point3f, self.origins, texel), dr.gather(mi.Vector3f, self.directions, texel))
        radiance, _, _ = self.integrator.sample(self.scene, self.sampler, ray)
        return dr.block_sum(radiance.x, PATHS_A_TEXEL).numpy().astype(float), count

    def irradiance(self, total, launches):
        return (total / (launches * PATHS_A_TEXEL) - self.emitted) * np.pi / box.ALBEDO


class ParticleTracer(Tracer):
    """A picture of the whole box from before its open face."""

    def __init__(self, mi, dr):
        super().__init__(mi)
        self.integrator = mi.load_dict({"type": "ptracer", "max_depth": MAX_DEPTH, "rr_depth": 5, "hide_emitters": True})
        eye = box.HALF_EDGE + CAMERA_DISTANCE
        film = {"type": "hdrfilm", "width": FILM, "height": FILM, "rfilter": {"type": "box"}}
        self.sensor = mi.load_dict({
            "type": "perspective",
            "to_world": mi.ScalarTransform4f().look_at(origin=[0, 0, eye], target=[0, 0, 0], up=[0, 1, 0]),
            "fov": float(np.degrees(2 * np.arctan(box.HALF_EDGE / CAMERA_DISTANCE))),
            "near_clip": 1e-2,
            "film": {**film, "pixel_format": "luminance", "component_format": "float32"},
            "sampler": {"type": "independent"},
        })
        self.texel, self.area = self.pixels_on_walls()

    def pixels_on_walls(self):
        """Of each pixel the texel that its middle shows, and the wall's area it covers, relative to others of that wall: 0
        where it shows two walls."""
        place = (2 * np.arange(FILM) + 1) / FILM - 1
        right, up = (values.ravel() for values in np.meshgrid(place, -place))
        outward = np.maximum(abs(right), abs(up))
        # Where rays, a step of 1 of which leads to the plane of the open face, meet the far wall or one of the others.
        to_back = 1 + 2 * box.HALF_EDGE / CAMERA_DISTANCE
        step = np.minimum(to_back, 1 / outward)
        points = np.stack([box.HALF_EDGE * right * step, box.HALF_EDGE * up * step, box.HALF_EDGE + CAMERA_DISTANCE * (1 - step)], axis=1)
        is_back = step == to_back
        sideways = np.where(abs(right) > abs(up), np.where(right > 0, 1, 0), np.where(up > 0, 3, 2))
        wall = np.where(is_back, 4, sideways)
        area = np.where(is_back, 1.0, np.where(abs(right) == abs(up), 0.0, step**3))
        texel = np.clip(((points / box.HALF_EDGE + 1) / 2 * box.MESH).astype(int), 0, box.MESH - 1)
        axes = np.array([box.axes(number) for number in range(len(box.WALLS))])[wall]
        column, row = (np.take_along_axis(texel, axes[:, k, None], axis=1)[:, 0] for k in (1, 2))
        return (wall * box.MESH + row) * box.MESH + column, area

    def launch(self, seed):
        picture = self.mi.render(self.scene, sensor=self.sensor, integrator=self.integrator, spp=1, seed=seed)
        return np.asarray(picture, dtype=float).ravel(), FILM * FILM

    def irradiance(self, total, launches):
        texel_count = len(box.WALLS) * box.MESH**2
        summed = [np.bincount(self.texel, weights, texel_count) for weights in (self.area * total, self.area)]
        return summed[0] / summed[1] / launches * np.pi / box.ALBEDO


def started(variant, threads):
    """Mitsuba and Dr.Jit."""
    import drjit
    import mitsuba

    mitsuba.set_variant(variant)
    mitsuba.set_log_level(mitsuba.LogLevel.Error)
    drjit.set_thread_count(threads)
    return mitsuba, drjit


def main(asked):
    start = time.perf_counter()
    mitsuba, drjit = started("llvm_ad_mono", asked["threads"])
    tracer = {"path": PathTracer, "ptracer": ParticleTracer}[asked["tracer"]](mitsuba, drjit)
    begin = time.perf_counter()
    total, sample_count = 0.0, 0
    for number in range(asked["launches"]):
        found, count = tracer.launch(asked["seed"] * 1_000_000 + number)
        total, sample_count = total + found, sample_count + count
    irradiance = tracer.irradiance(total, asked["launches"])
    end = time.perf_counter()
    np.save(asked["result"], irradiance.reshape(len(box.WALLS), box.MESH, box.MESH))
    print(json.dumps({"start_s": begin - start, "computing_s": end - begin, "sample_count": sample_count}))


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
