"""The paper's open box, described once for all programs: walls, lamps, and the points whose irradiance is asked for.

Wall 2 * axis + (1 on the positive side) is perpendicular to its axis; u and v are the two axes after it, cyclically.
The face at +z is open."""
import numpy as np

WALLS = ["left", "right", "floor", "ceiling", "back"]
# Half the edge of the cube, metres.
HALF_EDGE = 0.25
ALBEDO = 0.75
# Discs in the middle of two walls, which neither block nor change them; watts, by the cosine law.
LAMPS = {2: 1.0, 0: 1.0}
LAMP_RADIUS = 0.05
# Arrivals of a photon at a wall that count: photonmill's default of 15 bounces. Light that comes after is 0.07 % of all.
BOUNCES = 15
# Texels along each side of a wall.
MESH = 64


def axes(wall):
    return wall // 2, (wall // 2 + 1) % 3, (wall // 2 + 2) % 3


def side(wall):
    return 1.0 if wall % 2 else -1.0


def inward(wall):
    normal = np.zeros(3)
    normal[wall // 2] = -side(wall)
    return normal


def on_wall(wall, u, v):
    """Points (n, 3) of a wall at the coordinates u, v along its axes."""
    axis, along_u, along_v = axes(wall)
    points = np.empty((np.size(u), 3))
    points[:, axis], points[:, along_u], points[:, along_v] = side(wall) * HALF_EDGE, u, v
    return points


def grid(wall, coordinates):
    """The points of a wall at all pairs of coordinates, u fastest."""
    v, u = np.meshgrid(coordinates, coordinates, indexing="ij")
    return on_wall(wall, u.ravel(), v.ravel())


def texel_coordinates():
    return ((np.arange(MESH) + 0.5) / MESH * 2 - 1) * HALF_EDGE


def texels():
    """Middles of all texels (5 * 64 * 64, 3), wall by wall, and the normals there, into the box."""
    points = np.concatenate([grid(wall, texel_coordinates()) for wall in range(len(WALLS))])
    normals = np.repeat([inward(wall) for wall in range(len(WALLS))], MESH * MESH, axis=0)
    return points, normals


def lamp_radiance(wall):
    """W/m2/sr, of the disc on this wall."""
    return LAMPS[wall] / (np.pi * np.pi * LAMP_RADIUS**2)
