"""What was found, as a table, as JSON and as a plot."""
import dataclasses
import json
import statistics

from peers.failure import Failure


def of_curve(curve, targets):
    contestant = curve.contestant
    return {
        "name": contestant.name,
        "version": contestant.version,
        "method": contestant.method,
        "settings": contestant.settings,
        "samples": contestant.samples,
        "points": [dataclasses.asdict(point) for point in curve.points],
        "time_to": {f"{target:g}": {clock: curve.time_to(target, clock) for clock in ("computing_s", "whole_s")} for target in targets},
    }


def show(found, targets):
    print(f"{found['scene']}; {found['processor']}, {found['threads']} threads; {found['repeats']} runs each, in turn")
    print(f"the reference is off by {100 * found['reference_error']:.2f} % at most\n")
    columns = ["program", "budget", "computing, s", "whole, s", "error, %", "noise, %", "mean / right", "samples/s", "tracing alone"]
    rows = [row for contestant in found["contestants"] for row in rows_of(contestant)]
    table(columns, rows)
    print()
    columns = ["computing (whole), s, to"] + [f"{100 * target:g} %" for target in targets]
    table(columns, [[contestant["name"]] + [time_to(contestant, target) for target in targets] for contestant in found["contestants"]])
    print()
    for contestant in found["contestants"]:
        print(f"{contestant['name']}: {contestant['version']}; {contestant['method']}; {contestant['settings']}")


def rows_of(contestant):
    for point in contestant["points"]:
        computing_s = statistics.mean(point["computing_s"])
        tracing_s = [parts["tracing"] for parts in point["parts_s"] if "tracing" in parts]
        yield [
            contestant["name"],
            f"{quantity(point['sample_count'])} {contestant['samples']}",
            spread(point["computing_s"], 1, 2),
            f"{statistics.mean(point['whole_s']):.2f}",
            spread(point["error"], 100, 2),
            "-" if point["noise"] is None else f"{100 * point['noise']:.2f}",
            f"{statistics.mean(point['level']):.4f}",
            quantity(point["sample_count"] / computing_s),
            quantity(point["sample_count"] / statistics.mean(tracing_s)) if tracing_s else "-",
        ]


def spread(values, scale, digits):
    """Mean, and the least and the most where they differ."""
    mean, least, most = (f"{scale * value:.{digits}f}" for value in (statistics.mean(values), min(values), max(values)))
    return mean if least == most else f"{mean} ({least} - {most})"


def quantity(number):
    for unit, name in [(1e9, " G"), (1e6, " M"), (1e3, " k")]:
        if number >= unit:
            return f"{number / unit:.3g}{name}"
    return f"{number:.3g}"


def time_to(contestant, target):
    found = contestant["time_to"][f"{target:g}"]
    computing, whole = found["computing_s"], found["whole_s"]
    if computing is None:
        last = contestant["points"][-1]
        best = min(statistics.mean(point["error"]) for point in contestant["points"])
        return f"not reached in {statistics.mean(last['computing_s']):.1f} s (best {100 * best:.1f} %)"
    sign = "below " if computing["is_bound"] else ""
    return f"{sign}{computing['seconds']:.2f} ({whole['seconds']:.2f})"


def table(columns, rows):
    widths = [max(len(row[k]) for row in [columns, *rows]) for k in range(len(columns))]
    for row in [columns, ["-" * width for width in widths], *rows]:
        print("| " + " | ".join(cell.ljust(width) for cell, width in zip(row, widths)) + " |")


def write_json(found, path):
    try:
        path.write_text(json.dumps(found, indent=1, default=str) + "\n")
    except OSError as error:
        raise Failure(f"cannot write {path}: {error.strerror}") from None


def plot(found, targets, path):
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot, ticker

    figure, axes = pyplot.subplots(figsize=(8, 5.5), layout="constrained")
    for contestant in found["contestants"]:
        points = contestant["points"]
        times = [statistics.mean(point["computing_s"]) for point in points]
        errors = [100 * statistics.mean(point["error"]) for point in points]
        least = [error - 100 * min(point["error"]) for error, point in zip(errors, points)]
        most = [100 * max(point["error"]) - error for error, point in zip(errors, points)]
        label = f"{contestant['name']} ({contestant['version']})"
        axes.errorbar(times, errors, yerr=[least, most], marker="o", markersize=4, capsize=2, label=label)
    for target in targets:
        axes.axhline(100 * target, color="grey", linewidth=0.7, linestyle="--")
    axes.set(xscale="log", yscale="log", xlabel="computing, s", ylabel="relative RMSE of irradiance, %")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(ticker.LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(ticker.NullFormatter())
    axes.set_title(f"Open box, 5 x 64 x 64 texels, {found['threads']} threads of {found['processor']}", fontsize=10)
    axes.grid(True, which="both", alpha=0.25)
    axes.legend(fontsize=8)
    try:
        figure.savefig(path)
    except OSError as error:
        raise Failure(f"cannot write {path}: {error.strerror}") from None
