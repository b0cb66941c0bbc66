"""photonmill's CPU builder: all light by density estimation from the photon map."""
import json
import os

import numpy as np

from peers import box
from peers.failure import Failure
from peers.run import Run, clocked

# Everything that decides how fast and how right photonmill is, and what the report says of it. The radius shrinks with
# the fifth root of the number of photons: squared bias is that of a strip along the edges, where light changes fastest
# (radius^3), and so falls together with the variance (1 / (photons radius^2)).
FIRST_PHOTONS = 62_500
ROUND_PHOTONS = 500_000
SETTINGS = f"--variant cpu --rng sobol, {ROUND_PHOTONS} photons a round at most, --radius 0.025 (N / 5 10^6)^(-1/5), all else by default"


def radius(photons):
    return 0.025 * (photons / 5e6) ** (-1 / 5)


def options(photons):
    rounds = max(1, photons // ROUND_PHOTONS)
    chosen = ["--variant", "cpu", "--rng", "sobol", "--photons", photons // rounds, "--rounds", rounds]
    return [*chosen, "--radius", f"{radius(photons):.5f}"]


# Parts of a run and what photonmill's report calls them.
PARTS = {"tracing": "round/build", "gather": "round/gather"}


class Photonmill:
    name = "photonmill"
    method = "photon map on the CPU, density estimation of all light"
    settings = SETTINGS
    samples = "photons"

    def __init__(self, machine, program):
        self.machine, self.program = machine, program
        if not os.access(program, os.X_OK):
            raise Failure(f"no photonmill at {program}; build it with `cargo build --release`, or name it with --photonmill FILE")
        self.version = clocked([program, "--version"])[0].decode().strip()

    def budget(self, level):
        return FIRST_PHOTONS << level

    def run(self, photons, seed):
        folder = self.machine.folder / "photonmill"
        report = self.machine.folder / "photonmill.json"
        scene = ["--emission", "cosine", "--reflectance", box.ALBEDO, "--light-radius", box.LAMP_RADIUS]
        scene += ["--light-power", ",".join(map(str, box.LAMPS.values())), "--bounces", box.BOUNCES, "--mesh", box.MESH]
        places = ["--irradiance", folder, "--json", report, "-o", self.machine.folder / "photonmill.png"]
        threads = ["--threads", self.machine.threads, "--seed", seed]
        _, whole_s = clocked([self.program, *options(photons), *scene, *threads, *places])
        wall_s = {pass_["name"]: pass_["wall_ms"] / 1e3 for pass_ in json.loads(report.read_text())["timings"]}
        parts_s = {part: wall_s[name] for part, name in PARTS.items() if name in wall_s}
        return Run(irradiance(folder), whole_s, wall_s["run"], photons, parts_s)


def irradiance(folder):
    import mitsuba  # reads EXR

    mitsuba.set_variant("scalar_rgb")
    walls = [np.array(mitsuba.Bitmap(str(folder / f"{wall}.exr")), dtype=float) for wall in box.WALLS]
    return np.array([wall.reshape(box.MESH, box.MESH, -1)[:, :, 0] for wall in walls])
