"""All programs in turn, budget by budget, and what comes of it."""
import os
import platform
import statistics
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from peers import reference, report
from peers.failure import Failure
from peers.mitsuba3 import MitsubaParticle, MitsubaPath
from peers.photonmill import Photonmill
from peers.radiance import RadianceDensity, RadianceGather
from peers.run import Machine, confine

CLASSES = [Photonmill, RadianceDensity, RadianceGather, MitsubaPath, MitsubaParticle]
TARGETS = [0.04, 0.02, 0.01]
QUICK_LEVELS = 2
# Load of the machine, in processes, above which somebody else is at work on it.
IDLE = 0.5
# What the mean of all texels may be off before it must be doubted that the same is computed; edges cost Radiance 2 %.
SAME = 0.03


@dataclass
class Point:
    """All runs of a program at one budget."""

    budget: object
    sample_count: int
    error: list
    # Of the mean of all texels, over the reference's: 1 unless something else is computed than what is asked.
    level: list
    computing_s: list
    whole_s: list
    parts_s: list
    # Root of the mean variance of texels between runs, over the reference's root mean square.
    noise: float

    def mean_error(self):
        return statistics.mean(self.error)


@dataclass
class Curve:
    contestant: object
    points: list = field(default_factory=list)
    is_done: bool = False

    def time_to(self, error, clock):
        """Seconds in which the mean over runs comes to an error, with the least and the most of single runs where all do."""
        times = [getattr(point, clock) for point in self.points]
        found = first_below(error, [point.mean_error() for point in self.points], [statistics.mean(seconds) for seconds in times])
        if found and not found["is_bound"]:
            runs = range(len(self.points[0].error))
            each = [first_below(error, [point.error[run] for point in self.points], [seconds[run] for seconds in times]) for run in runs]
            if all(each):
                seconds = [one["seconds"] for one in each]
                found.update(least=min(seconds), most=max(seconds))
        return found


def first_below(error, errors, times):
    """Seconds to an error along straight lines between points on logarithmic scales; a bound where the first point has it
    already, and None where no point has."""
    before = None
    for found, seconds in zip(errors, times):
        if found <= error:
            if before is None:
                return {"seconds": seconds, "is_bound": True}
            share = np.log(before[0] / error) / np.log(before[0] / found)
            return {"seconds": float(before[1] * (seconds / before[1]) ** share), "is_bound": False}
        before = found, seconds
    return None


def measure(asked):
    repeats = asked.repeats or (2 if asked.quick else 3)
    limit_s = asked.limit or (3.0 if asked.quick else 60.0)
    chosen = choose(asked.only)
    if asked.plot and asked.plot.suffix not in (".svg", ".png"):
        raise Failure(f"--plot {asked.plot}: the name must end in .svg or .png")
    load = prepare(asked)
    right, right_error = reference.irradiance(reference.QUICK if asked.quick else reference.FINE)
    with tempfile.TemporaryDirectory(prefix="bench_peers-") as folder:
        machine = Machine(asked.threads, Path(folder))
        curves = [Curve(cls(machine, asked.photonmill.absolute()) if cls is Photonmill else cls(machine)) for cls in chosen]
        for curve in curves:
            curve.contestant.run(curve.contestant.budget(0), 1)
        level = 0
        while active := [curve for curve in curves if not curve.is_done]:
            step(active, level, repeats, limit_s, right)
            level += 1
            if asked.quick and level == QUICK_LEVELS:
                break
    found = {
        "scene": "the paper's open box, lamps of 1 W by the cosine law; irradiance at 5 x 64 x 64 texels",
        "reference_error": right_error,
        "processor": processor(),
        "threads": asked.threads,
        "repeats": repeats,
        "limit_s": limit_s,
        "load_before": load,
        "command": ["tools/bench_peers", *sys.argv[1:]],
        "contestants": [report.of_curve(curve, TARGETS) for curve in curves],
    }
    report.show(found, TARGETS)
    if asked.json:
        report.write_json(found, asked.json)
    if asked.plot:
        report.plot(found, TARGETS, asked.plot)


def prepare(asked):
    """Looks for the folders of the results, and leaves this process its cores; the load of the machine before."""
    for path in filter(None, (asked.json, asked.plot)):
        if not path.absolute().parent.is_dir():
            raise Failure(f"{path}: there is no folder {path.absolute().parent}; make it first")
    load = os.getloadavg()[0]
    if load > IDLE:
        print_progress(f"warning: {load:.1f} processes are already at work on this machine; the times below are worth little")
    confine(asked.threads)
    return load


def choose(only):
    names = {cls.name: cls for cls in CLASSES}
    wanted = only.split(",") if only else list(names)
    for name in wanted:
        if name not in names:
            raise Failure(f"--only {name}: there is no such program; there are {', '.join(names)}")
    return [names[name] for name in wanted]


def step(curves, level, repeats, limit_s, right):
    """One budget of all programs in turn."""
    runs = [[] for _ in curves]
    for repeat in range(repeats):
        for curve, own in zip(curves, runs):
            own.append(curve.contestant.run(curve.contestant.budget(level), 2 + repeat))
    for curve, own in zip(curves, runs):
        point = judge(curve.contestant.budget(level), own, right)
        curve.points.append(point)
        computing_s = statistics.mean(point.computing_s)
        asked = f"{point.sample_count} {curve.contestant.samples}"
        print_progress(f"{curve.contestant.name}: {asked}, {computing_s:.2f} s, error {100 * point.mean_error():.2f} %")
        if abs(statistics.mean(point.level) - 1) > SAME:
            print_progress(f"warning: the mean of {curve.contestant.name} is {statistics.mean(point.level):.3f} of the right one")
        longer = 2.0 if len(curve.points) < 2 else max(2.0, computing_s / statistics.mean(curve.points[-2].computing_s))
        is_enough = point.mean_error() < 0.98 * min(TARGETS)
        curve.is_done = is_enough or longer * computing_s > limit_s or curve.contestant.budget(level + 1) is None


def judge(budget, runs, right):
    scale = reference.root_mean_square(right)
    values = np.array([run.irradiance for run in runs])
    if not np.isfinite(values).all():
        raise Failure(f"a texel is no number at budget {budget}")
    return Point(
        budget=budget,
        sample_count=runs[0].sample_count,
        error=[reference.root_mean_square(one - right) / scale for one in values],
        level=[float(one.mean() / right.mean()) for one in values],
        computing_s=[run.computing_s for run in runs],
        whole_s=[run.whole_s for run in runs],
        parts_s=[run.parts_s for run in runs],
        noise=float(np.sqrt(values.var(axis=0, ddof=1).mean()) / scale) if len(runs) > 1 else None,
    )


def print_progress(line):
    print(f"bench_peers: {line}", file=sys.stderr, flush=True)


def processor():
    try:
        with open("/proc/cpuinfo") as lines:
            return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()
