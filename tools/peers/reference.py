"""What is right: the open box by radiosity in float64, irradiance (W/m2) at the middles of all texels. No photon is in it,
and nothing of photonmill's.

The walls are cut into n x n cells, finer towards the edges (Chebyshev's points), of constant radiosity, which the
exact form factors from a cell's middle to every other cell tie together (collocation). What a lamp gives is a
quadrature over its disc. The error falls with the square of n, so that of two n an extrapolation (Richardson) is
made; its difference from the finer one bounds the error."""
import hashlib
from pathlib import Path

import numpy as np

from peers import box, environment

FINE, QUICK = 40, 24


def irradiance(cells):
    """(5, 64, 64) W/m2, and how well it is known: root mean square over its root mean square. Kept in the cache."""
    key = hashlib.sha256(b"".join(Path(file).read_bytes() for file in (__file__, box.__file__)) + bytes([cells])).hexdigest()[:16]
    kept = environment.cache() / f"reference-{key}.npz"
    if not kept.exists():
        coarse, fine = solve(cells // 2), solve(cells)
        best = (4 * fine - coarse) / 3
        np.savez(kept, irradiance=best, error=root_mean_square(fine - best) / root_mean_square(best))
    with np.load(kept) as known:
        return known["irradiance"], float(known["error"])


def root_mean_square(values):
    return float(np.sqrt(np.mean(values**2)))


def solve(n):
    edges = -box.HALF_EDGE * np.cos(np.pi * np.arange(n + 1) / n)
    middles = (edges[1:] + edges[:-1]) / 2
    walls = range(len(box.WALLS))
    points = [box.grid(wall, middles) for wall in walls]
    pairs = [(wall, other) for wall in walls for other in walls if wall != other]
    transport = {(wall, other): box.ALBEDO * form_factors(points[wall], wall, other, edges) for wall, other in pairs}
    order = [direct(points[wall], wall) for wall in walls]
    cells = [values.copy() for values in order]
    # Neumann's series: light that was reflected once more, until none is left.
    while max(values.max() for values in order) > 1e-10 * max(values.max() for values in cells):
        order = [sum(transport[wall, other] @ order[other] for other in walls if other != wall) for wall in walls]
        cells = [total + values for total, values in zip(cells, order)]
    del transport
    return np.array([at_texels(wall, cells, edges) for wall in walls])


def at_texels(wall, cells, edges):
    found = []
    for points in np.array_split(box.grid(wall, box.texel_coordinates()), 16):
        reflected = sum(form_factors(points, wall, other, edges) @ cells[other] for other in range(len(box.WALLS)) if other != wall)
        found.append(direct(points, wall) + box.ALBEDO * reflected)
    return np.concatenate(found).reshape(box.MESH, box.MESH)


def direct(points, wall):
    """Irradiance straight from the lamps: radiance times both cosines over the squared distance, over the disc, by
    Gauss's points in the squared radius and evenly around."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    angles = 2 * np.pi * (np.arange(32) + 0.5) / 32
    total = np.zeros(len(points))
    for lit_wall in box.LAMPS:
        if lit_wall == wall:
            continue
        for node, weight in zip(nodes, weights):
            radius = box.LAMP_RADIUS * np.sqrt((node + 1) / 2)
            area = np.pi * box.LAMP_RADIUS**2 * weight / 2 / len(angles)
            for source in box.on_wall(lit_wall, radius * np.cos(angles), radius * np.sin(angles)):
                way = points - source
                squared = np.einsum("ij,ij->i", way, way)
                total += box.lamp_radiance(lit_wall) * area * (way @ box.inward(lit_wall)) * -(way @ box.inward(wall)) / squared**2
    return total


def form_factors(points, wall, other, edges):
    """Form factors (points, cells) from points of a wall to the cells of another, u fastest: from the closed ones of
    rectangles with a corner at the foot of the perpendicular (parallel and perpendicular; Howell, B-3 and B-4), as
    differences over the corners of cells."""
    axis = wall // 2
    other_axis, along_u, along_v = box.axes(other)
    if axis == other_axis:
        u, v = ((edges - points[:, k, None]) / (2 * box.HALF_EDGE) for k in (along_u, along_v))
        root_u, root_v = np.sqrt(1 + u * u), np.sqrt(1 + v * v)
        corners = (u / root_u)[:, None, :] * np.arctan(v[:, :, None] / root_u[:, None, :])
        corners += (v / root_v)[:, :, None] * np.arctan(u[:, None, :] / root_v[:, :, None])
    else:
        distance = np.abs(box.side(other) * box.HALF_EDGE - points[:, other_axis])[:, None]
        height = np.abs(edges - box.side(wall) * box.HALF_EDGE)
        slant = np.hypot(distance, height)
        sideways = edges - points[:, 3 - axis - other_axis, None]
        if along_u == axis:
            corners = (distance / slant)[:, None, :] * np.arctan(sideways[:, :, None] / slant[:, None, :])
        else:
            corners = (distance / slant)[:, :, None] * np.arctan(sideways[:, None, :] / slant[:, :, None])
        corners *= box.side(wall)
    cells = corners[:, 1:, 1:] - corners[:, 1:, :-1] - corners[:, :-1, 1:] + corners[:, :-1, :-1]
    return cells.reshape(len(points), -1) / (2 * np.pi)
