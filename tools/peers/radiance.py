"""Radiance: photon map by mkpmap, looked at with rtrace at the middles of the texels.

Its map holds indirect light only; rtrace adds the lamps by shadow rays (-dj 0: to fixed points; -ds 0.1: off by 0.04 %).
A Radiance lamp is a surface that swallows what meets it, and the paper's are not. So photons start from lamps under
a patch that lets them through from behind (-bv-) and reflects as the wall does from before, and rtrace sees lamps of
illum, which rays pass. Without the two, 1.8 % of all light is lost.

Settings were chosen by trying: bandwidth 20 to 400 photons, -ad 16 to 1024, -aa 0 to 0.4, with precomputed
irradiance (-app) and without; at the same error -app with the irradiance cache took a fourth of the time of gathering at each
texel (-aa 0)."""
import importlib.util
import os
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from peers import box
from peers.run import Run, clocked

# Heights of lamps and patches above their walls, metres.
LAMP_HEIGHT, PATCH_HEIGHT = 1e-5, 2e-5
LAMP_RAYS = ["-dj", "0", "-ds", "0.1"]


def polygon(wall):
    """Seen counter-clockwise from inside."""
    u, v = np.array([-1, 1, 1, -1]) * box.HALF_EDGE, np.array([-1, -1, 1, 1]) * box.HALF_EDGE
    return box.on_wall(wall, u, v)[:: int(-box.side(wall))]


def numbers(values):
    return f"{len(values)} " + " ".join(f"{value:.9g}" for value in values)


def disc(modifier, wall, height):
    ring = [*(box.on_wall(wall, 0, 0)[0] + height * box.inward(wall)), *box.inward(wall), 0, box.LAMP_RADIUS]
    return f"{modifier} ring {modifier}-{wall}\n0\n0\n{numbers(ring)}"


def walls():
    plastic = f"void plastic wall\n0\n0\n{numbers([box.ALBEDO] * 3 + [0, 0])}"
    return [plastic] + [f"wall polygon {name}\n0\n0\n{numbers(polygon(wall).ravel())}" for wall, name in enumerate(box.WALLS)]


def lamps(kind, strings):
    for wall in box.LAMPS:
        yield f"void {kind} lamp-{wall}\n{strings}\n0\n{numbers([box.lamp_radiance(wall)] * 3)}"
        yield disc(f"lamp-{wall}", wall, LAMP_HEIGHT)


def patches():
    yield f"void plasfunc patch\n2 0 .\n0\n{numbers([box.ALBEDO] * 3 + [0])}"
    yield from (disc("patch", wall, PATCH_HEIGHT) for wall in box.LAMPS)


class Radiance:
    """What both ways of looking at the map have in common."""

    samples = "photons stored"

    def __init__(self, machine):
        self.machine = machine
        package = Path(importlib.util.find_spec("pyradiance").origin).parent
        self.programs = package / "bin"
        self.environment = {**os.environ, "PATH": f"{self.programs}:{os.environ['PATH']}", "RAYPATH": f".:{package / 'lib'}"}
        self.folder = machine.folder / self.name
        self.folder.mkdir()
        self.version = self.call("rtrace", "-version")[0].decode().strip()
        points, normals = box.texels()
        self.texels = []
        for part in np.array_split(np.hstack([points, normals]).astype("f4"), machine.threads):
            self.texels.append(self.folder / f"texels-{len(self.texels)}")
            self.texels[-1].write_bytes(part.tobytes())
        (self.folder / "emit.rad").write_text("\n".join([*walls(), *lamps("light", "0"), *patches(), ""]))
        (self.folder / "look.rad").write_text("\n".join([*walls(), *lamps("illum", "1 void"), ""]))
        self.scene_s = 0.0
        for scene in ("emit", "look"):
            octree, seconds = self.call("oconv", f"{scene}.rad")
            (self.folder / f"{scene}.oct").write_bytes(octree)
            self.scene_s += seconds
        # rtrace takes no map that is not younger than its octree, in whole seconds.
        time.sleep(1.1)

    def call(self, program, *words, **streams):
        return clocked([self.programs / program, *words], cwd=self.folder, env=self.environment, **streams)

    def run(self, budget, seed):
        map_words, look_words = self.words(budget)
        map_words = ["-n", self.machine.threads, "-fo+", "-bv-", "-apr", seed, *map_words, "emit.oct"]
        # Its parent process looks for the end of its workers once a second; the signal that asks for a report wakes it.
        _, map_s = self.call("mkpmap", *map_words, nudge=signal.SIGCONT)
        start = time.perf_counter()
        with ThreadPoolExecutor() as pool:
            found = b"".join(pool.map(lambda texels: self.look(texels, look_words), self.texels))
        look_s = time.perf_counter() - start
        irradiance = np.frombuffer(found, "f4").astype(float).reshape(len(box.WALLS), box.MESH, box.MESH, 3).mean(axis=3)
        computing_s = map_s + look_s
        return Run(irradiance, self.scene_s + computing_s, computing_s, self.photons(budget), {"tracing": map_s, "gather": look_s})

    def look(self, texels, words):
        """A process for each core, with points that lie together: with rtrace's own -n, neighbours fall to different
        processes, which then fill their irradiance caches twice."""
        with open(texels, "rb") as points:
            return self.call("rtrace", "-w", "-h", "-fff", "-I", *LAMP_RAYS, *words, "look.oct", stdin=points)[0]


class RadianceDensity(Radiance):
    name = "radiance-density"
    method = "photon map, indirect light by density estimation, lamps by shadow rays"
    settings = "mkpmap -apg; rtrace -I -ab -1, bandwidth 300 (N / 10^6)^(1/3) photons, -dj 0 -ds 0.1"

    def budget(self, level):
        return 250_000 << level

    def photons(self, budget):
        return budget

    def words(self, photons):
        # The error is that of edges, where half the disc lies beyond the wall: its square grows with the radius, and so the
        # best radius falls with the third root of the photons, and the bandwidth grows with it.
        bandwidth = round(300 * (photons / 1e6) ** (1 / 3))
        return ["-apg", "map", photons], ["-ab", -1, "-ap", "map", bandwidth]


class RadianceGather(Radiance):
    name = "radiance-gather"
    method = "photon map with precomputed irradiance, final gathering over an irradiance cache, lamps by shadow rays"
    settings = "mkpmap -app (bandwidth 50, -apP 0.1); rtrace -I -ab 1 -ar 0 -lw 1e-7 -dj 0 -ds 0.1, with photons, -ad and -aa by budget"
    # Photons, gather rays (-ad), accuracy of the irradiance cache (-aa).
    budgets = [
        (25_000, 16, 0.8),
        (50_000, 32, 0.6),
        (100_000, 64, 0.5),
        (200_000, 64, 0.4),
        (400_000, 128, 0.3),
        (800_000, 256, 0.25),
        (800_000, 256, 0.2),
        (1_600_000, 512, 0.15),
        (3_200_000, 1024, 0.12),
        (6_400_000, 1024, 0.1),
    ]

    def budget(self, level):
        return self.budgets[level] if level < len(self.budgets) else None

    def photons(self, budget):
        return budget[0]

    def words(self, budget):
        photons, rays, accuracy = budget
        return ["-apP", 0.1, "-app", "map", photons, 50], ["-ab", 1, "-ad", rays, "-aa", accuracy, "-ar", 0, "-lw", 1e-7, "-ap", "map"]
