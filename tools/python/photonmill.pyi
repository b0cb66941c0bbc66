"""Photon mapping on any Vulkan GPU: pictures, irradiance and lightmaps with the standard error of every value.

Lengths are metres, y is up, angles are degrees. Radiance is in W/m2/sr and irradiance in W/m2, linear, Rec. 709 primaries. Arrays are
float32 and cannot be written to, as all who ask for one share it: ``array.copy()`` is yours. Row 0 of a picture is its uppermost one.
"""

from collections.abc import Callable, Sequence
from os import PathLike
from typing import Any, Literal, TypeAlias, TypedDict, final, type_check_only

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import Unpack, disjoint_base

__all__ = [
    "Error",
    "RunWarning",
    "ArgumentError",
    "__version__",
    "DeviceFacts",
    "Device",
    "Camera",
    "Light",
    "Scene",
    "Run",
    "Film",
    "Irradiance",
    "Lightmap",
    "Lightmaps",
    "devices",
    "scenes",
    "study",
]

__version__: str

_Vector: TypeAlias = Sequence[float] | NDArray[np.floating[Any]]

class Error(Exception):
    """What went wrong, in one line: what, which value, what is allowed."""

class ArgumentError(Error, ValueError):
    """An argument has a value that is not allowed."""

class RunWarning(UserWarning):
    """What the user should know of a scene or a run, in one line."""

@type_check_only
class Settings(TypedDict, total=False):
    """Settings of a run: the program's options of the same names, with its defaults, which None stands for, too.

    Where a picture ends at an error or a time, a pilot chooses photons, caustic_photons, neighbours, caustic_neighbours, samples and
    shadow_rays that are not given. A call of `Scene.render` without error, time, total_photons and rounds ends at an error of 2 %, or after
    45 s on a CPU, 1 s on a discrete GPU and 10 s on another.
    """

    error: float | str | None
    """End once noise and bias together are at most this share of the mean: 0.02, or "2%". More than 0.5 is refused as more likely per cent."""
    measure: Literal["rmse", "relmse"] | None
    """What the error is: the RMSE over the mean, or the root of relMSE."""
    confidence: float | str | None
    """Of bounds of errors; 0.95, or "95%"."""
    time: float | str | None
    """End after rounds of so many seconds, or "2m"; does not include the pilot."""
    total_photons: int | None
    """End once so many photons were traced, in all rounds and maps."""
    bias: bool | None
    """Measure the bias in extra runs where measure is relmse; else it is estimated from the run's own blocks."""
    checkpoint: str | PathLike[str] | None
    """Write all sums into this file from time to time and at the end, so that resume can go on with them."""
    every: float | str | None
    """Seconds between two checkpoints, or "5m"; 30."""
    resume: str | PathLike[str] | None
    """Go on with the blocks of rounds that a checkpoint holds; the result is that of a run without a break, to the bit."""
    shard: str | None
    """Do every N-th block of rounds, from the K-th on: "K/N". `photonmill merge` adds the checkpoints of all of them."""
    map: str | PathLike[str] | None
    """Take the photons from a file of `photonmill map` instead of tracing them."""
    settings: str | PathLike[str] | None
    """Take what a pilot has chosen from a file of save_settings, and run no pilot."""
    save_settings: str | PathLike[str] | None
    """Write what the pilot has chosen for settings. Of pictures only."""
    denoise: bool | None
    """Remove noise from direct light in files of the picture with Open Image Denoise. Of pictures only."""
    eye: Sequence[float] | None
    """Where the camera stands, metres, in place of where the scene has it. This and the next six are of pictures only."""
    look_at: Sequence[float] | None
    """What it looks at, metres."""
    up: Sequence[float] | None
    """What is up in its picture, as a direction."""
    fov: float | None
    """Angle between the picture's lower and upper edge, degrees."""
    orthographic: float | None
    """Height of what the picture shows by parallel rays, metres."""
    aperture: float | None
    """Diameter of the camera's lens, metres; 0, a pinhole."""
    focus: float | None
    """Distance of the plane in focus, metres; that of what the middle of the picture shows."""
    rounds: int | None
    """Independent rounds, of which the result is the mean; 16 of points and texels without a goal."""
    block: int | None
    """Rounds of a block, a power of two; errors come from the spread of blocks."""
    photons: int | None
    """Photons of the global map, per round; 131072."""
    caustic_photons: int | None
    """Photons of the caustic map, per round; as many as photons."""
    bounces: int | None
    """Cut photons off after so many bounces; none, as Russian roulette ends paths."""
    seed: int | None
    """Of the random numbers; 1. The same seed gives the same bits on one device."""
    neighbours: int | None
    """Photons of a round within the first radius of the global map; 24."""
    caustic_neighbours: int | None
    """The same for the caustic map; 6, or a quarter of neighbours."""
    radius: float | None
    """First radius of the global map, metres; what holds the neighbours."""
    caustic_radius: float | None
    """The same for the caustic map."""
    alpha: float | None
    """How fast radii shrink, above 0 and at most 1, which keeps them (Knaus and Zwicker 2011); 2/3."""
    fixed_radius: bool | None
    """Keep the radius, as an alpha of 1 does."""
    kernel: Literal["box", "cone", "epanechnikov"] | None
    """Weight of a photon by its distance."""
    edge_correction: bool | None
    """Divide by the part of the search disc that lies on the surface; True."""
    samples: int | None
    """Camera paths per pixel and round, a power of two; 1. Of pictures only."""
    shadow_rays: int | None
    """Per visible point and round; 4."""
    final_gather: bool | None
    """Take indirect light from one ray to the next surface."""
    aim: bool | None
    """Aim photons at mirrors, glass and openings; True."""
    illumination: Literal["split", "photons"] | None
    """Direct light by shadow rays and caustics from their own map, or everything from one photon map."""
    part: Literal["all", "direct", "specular", "caustic", "indirect"] | None
    """Compute only this part of the light. Of pictures only."""
    filter: Literal["box", "tent", "gaussian"] | None
    """Of the pixels. Of pictures only."""
    variant: Literal["auto", "naive", "atomic", "ballot", "group", "scan", "persistent"] | None
    """Builder of the photon maps; all give the same bits."""
    math: Literal["fast", "strict"] | None
    """strict gives the same bits on every device that rounds to nearest."""
    paranoid: bool | None
    """Look for NaN and infinity; the report says where they come from."""
    chunk: int | None
    """Most photons traced at once; the same bits."""
    group_size: int | None
    """Invocations per work group, a power of two; 128. The same bits."""
    with_: str | Sequence[str] | None
    """Effects to simulate even if the scene does not need them, as `photonmill plan` names them."""
    without: str | Sequence[str] | None
    """Effects to leave out."""

@type_check_only
class Progress(TypedDict):
    """How far a run has come."""

    rounds: int
    seconds: float
    """Since the first round."""
    seconds_left: float | None
    """Predicted until the end."""
    error: float | None
    """Relative error that the result has not more of, with the confidence asked for."""
    photons: int
    """Traced so far."""

@type_check_only
class Ledger(TypedDict):
    """Fates of photons: emitted = absorbed + escaped + cut_off + dropped, and dropped is 0."""

    emitted: int
    absorbed: int
    escaped: int
    cut_off: int
    dropped: int
    stored: int

@disjoint_base
class DeviceFacts:
    """What a Vulkan device is and can."""

    @property
    def index(self) -> int:
        """Its number in the loader's order."""

    @property
    def name(self) -> str:
        """As the driver calls it."""

    @property
    def kind(self) -> str:
        """discrete, integrated, virtual, cpu or other."""

    @property
    def driver(self) -> str:
        """Name and version."""

    @property
    def vulkan(self) -> str:
        """Version."""

    @property
    def memory(self) -> int:
        """Of the device, bytes."""

    @property
    def subgroup_size(self) -> int:
        """Lanes."""

    @property
    def lacks(self) -> list[str]:
        """What it lacks of what photonmill needs; empty if it can be used."""

@final
class Device(DeviceFacts):
    """An open Vulkan device. Calls from several threads run on it one after the other."""

    def __new__(cls, name: str | int | None = None, *, memory: int | None = None, validate: bool = False) -> Device:
        """Opens a device.

        name: its number or a part of its name, as `devices` lists them; a discrete GPU if there is one.
        memory: most bytes that buffers may take; half of the device's. Work is done in smaller pieces, with the same result to the bit.
        validate: turn on the Vulkan validation layer; any message is an error.
        """

def devices() -> list[DeviceFacts]:
    """The Vulkan devices, in the loader's order."""

def scenes() -> list[str]:
    """Names of the built-in scenes."""

@final
class Camera:
    """A pinhole or a thin lens."""

    def __new__(
        cls,
        position: _Vector,
        target: _Vector,
        up: _Vector = (0.0, 1.0, 0.0),
        fov: float = 40.0,
        *,
        aspect: float | None = None,
        aperture: float = 0.0,
        focus: float | None = None,
        name: str = "camera",
    ) -> Camera:
        """A camera in perspective.

        position, target: where it is and what it looks at, metres.
        up: need not be perpendicular to the view.
        fov: angle from the picture's lower to its upper edge, degrees.
        aspect: width over height of the picture if no size is given; 4/3.
        aperture: diameter of the lens, metres; 0 is a pinhole.
        focus: distance of the plane in focus, metres; that of the target.
        """

    @property
    def name(self) -> str:
        """As the file has it."""

    @property
    def position(self) -> tuple[float, float, float]:
        """Metres."""

    @property
    def forward(self) -> tuple[float, float, float]:
        """Unit vector."""

    @property
    def up(self) -> tuple[float, float, float]:
        """Unit vector, perpendicular to the view."""

    @property
    def fov(self) -> float | None:
        """Degrees, from the lower to the upper edge; None if it is orthographic."""

    @property
    def aspect(self) -> float | None:
        """Width over height of the picture that it was set up for."""


@final
class Light:
    """A light that is no mesh."""

    @property
    def name(self) -> str:
        """As the file has it."""

    @property
    def kind(self) -> Literal["point", "spot", "directional", "disc", "environment", "sky"]:
        """What it is."""


@final
class Scene:
    """Meshes with what they are made of and what lights them, ready to be lit."""

    def __new__(
        cls,
        scene: str | PathLike[str],
        *,
        radiometric: bool = False,
        at: float | None = None,
        environment: float | _Vector | str | PathLike[str] | None = None,
        sun: Sequence[float] | None = None,
        environment_rotate: float | None = None,
        environment_strength: float | None = None,
    ) -> Scene:
        """Reads a scene. One that nothing lights gets a sky of 1 W/m2/sr.

        scene: a .gltf or .glb, or the name of a built-in scene (`scenes`).
        radiometric: intensities of the file's lights are W/sr and W/m2, not candela and lux.
        at: seconds into the file's first animation; at rest.
        environment: light from beyond the scene: W/m2/sr, one number or three; or a picture of all directions, .hdr or .exr.
        sun: (azimuth, elevation) of a sun, degrees clockwise from -z as seen from above and above the horizon, with its clear sky.
        environment_rotate: turns the environment's picture, degrees, counter-clockwise as seen from above.
        environment_strength: multiplies the environment's light.
        """

    @property
    def name(self) -> str:
        """As the file has it, or that of a built-in scene."""

    @property
    def cameras(self) -> list[Camera]:
        """In the order of the file."""

    @property
    def lights(self) -> list[Light]:
        """Meshes of an emissive material emit light as well."""

    @property
    def materials(self) -> list[str]:
        """Names."""

    @property
    def meshes(self) -> list[str]:
        """Names."""

    @property
    def triangles(self) -> int:
        """Of all meshes."""

    @property
    def bounds(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Lower and upper corner of the box around all triangles, metres."""

    @property
    def warnings(self) -> list[str]:
        """What its file holds and was not understood; also issued as `RunWarning` when it is read."""

    def render(
        self,
        camera: Camera | str | None = None,
        size: int | Sequence[int] | None = None,
        *,
        device: Device | None = None,
        progress: Callable[[Progress], object] | None = None,
        **settings: Unpack[Settings],
    ) -> Film:
        """Renders what a camera sees.

        camera: one's own, or the name of one of the scene's; its first, or one that sees all of it.
        size: width, or (width, height), pixels; about 307200 pixels in the camera's aspect ratio. In another one the vertical field of
            view is kept.
        device: the usual one, which is opened once and stays open.
        progress: called every few rounds. What it raises ends the run.
        settings: see `Settings`.

        Other threads of Python go on while the device works. Ctrl-C ends the run within a submission to the device, or after the
        pilot.
        """

    def probe(
        self,
        points: ArrayLike,
        normals: ArrayLike,
        *,
        device: Device | None = None,
        progress: Callable[[Progress], object] | None = None,
        **settings: Unpack[Settings],
    ) -> Irradiance:
        """Computes the irradiance at points.

        points: shape (n, 3), metres. An array of float64 is read where it lies.
        normals: of the surfaces there, shape (n, 3), of any length.

        The rest is as of `render`.
        """

    def bake(
        self,
        folder: str | PathLike[str] | None = None,
        *,
        texels_per_metre: float | None = None,
        atlas: int | Literal["off"] | None = None,
        preview: bool = False,
        exposure: float | None = None,
        device: Device | None = None,
        progress: Callable[[Progress], object] | None = None,
        **settings: Unpack[Settings],
    ) -> Lightmaps:
        """Bakes the irradiance of all surfaces that scatter light into lightmaps.

        folder: for the files of `photonmill bake`: lightmaps, and the scene with coordinates for them; without one there are only arrays.
        texels_per_metre: about 65536 texels in all maps together.
        atlas: of the files of a scene from a file: pages of so many texels along a side that objects share, or "off".
        preview: also write a copy that shows the light in any viewer.
        exposure: of the preview, stops; what makes the mean middle grey.

        The rest is as of `render`.
        """

@disjoint_base
class Run:
    """What all results have: how wrong they are, and how they came about."""

    @property
    def relative_error(self) -> float:
        """Standard error of the noise over the mean of what surfaces scatter, RMSE over all pixels, texels or points; inf before two
        blocks of rounds are whole."""

    @property
    def bound(self) -> float:
        """What noise, bias and light that limits kept from the result are together not above, with `confidence`; inf where unknown."""

    @property
    def bias(self) -> float | None:
        """Of the search radius, relative; None where it was not measured."""

    @property
    def confidence(self) -> float:
        """Level of the bound."""

    @property
    def rounds(self) -> int:
        """That the result is the mean of."""

    @property
    def seconds(self) -> float:
        """Wall time of the call on the device, pilot and trial included."""

    @property
    def end(self) -> Literal["rounds", "error", "time", "photons"]:
        """Why it ended."""

    @property
    def seed(self) -> int:
        """Of the random numbers."""

    @property
    def ledger(self) -> Ledger:
        """Fates of the photons of all maps."""

    @property
    def warnings(self) -> list[str]:
        """Also issued as `RunWarning`."""

    @property
    def report(self) -> str:
        """What the program prints of a run: errors, bias, ledger, time of every pass."""

    @property
    def details(self) -> dict[str, Any]:
        """The same as data, as the program's --json has it."""

@final
class Film(Run):
    """What a camera has seen. A notebook shows it."""

    @property
    def width(self) -> int:
        """Pixels."""

    @property
    def height(self) -> int:
        """Pixels."""

    @property
    def radiance(self) -> NDArray[np.float32]:
        """Shape (height, width, 3), W/m2/sr."""

    @property
    def standard_error(self) -> NDArray[np.float32]:
        """Of the radiance, shape (height, width, 3), W/m2/sr; inf where unknown: of fewer than eight blocks of rounds, and where no
        light has reached a pixel though some may."""

    @property
    def unseen(self) -> NDArray[np.float32]:
        """The most that light which was not met may add to any channel, shape (height, width), W/m2/sr. Often there is no such
        light; the standard error does not include it."""

    @property
    def degrees_of_freedom(self) -> int:
        """Of each standard error: the blocks of rounds less one."""

    def interval(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Lower and upper ends, shape (height, width, 3), between which the radiance lies with the run's confidence (95 % by
        default), by Student's distribution; what is `unseen` is not in it."""

    @property
    def parts(self) -> dict[str, NDArray[np.float32]]:
        """Radiance by what it took to the eye: direct, specular, caustic and indirect, which sum to the whole; each of shape
        (height, width, 3), W/m2/sr. Empty where the device had no room to keep them apart."""

    @property
    def albedo(self) -> NDArray[np.float32]:
        """Of what each pixel sees first, its mean, shape (height, width, 3); for denoisers."""

    @property
    def normal(self) -> NDArray[np.float32]:
        """Of what each pixel sees first, its mean, in the scene's axes, shape (height, width, 3)."""

    @property
    def depth(self) -> NDArray[np.float32]:
        """Metres along the ray to what each pixel sees first, its mean, shape (height, width); inf where there is nothing."""

    def save(
        self,
        path: str | PathLike[str],
        *,
        exposure: float | None = None,
        tone: Literal["neutral", "linear"] = "neutral",
        white_balance: float | None = None,
        layers: Sequence[str] | None = None,
    ) -> None:
        """Writes a file, which appears whole or not at all.

        path: ends in .exr, which holds linear radiance and layers, or in .png, which is for the eye.
        exposure: of a PNG, stops; what makes the mean middle grey.
        tone: curve of a PNG.
        white_balance: of a PNG, the colour temperature of light that is shown as white, kelvin; daylight, sRGB's own white.
        layers: of an EXR, some of direct, specular, caustic, indirect, standard_error, unseen, albedo, normal and depth; all.
        """

    def png(
        self, *, exposure: float | None = None, tone: Literal["neutral", "linear"] = "neutral", white_balance: float | None = None
    ) -> bytes:
        """The content of a PNG, as `save` writes it."""

@final
class Irradiance(Run):
    """The light at points."""

    @property
    def irradiance(self) -> NDArray[np.float32]:
        """Shape (n, 3), W/m2."""

    @property
    def standard_error(self) -> NDArray[np.float32]:
        """Shape (n, 3), W/m2; inf where unknown: of fewer than eight blocks of rounds, and where no light has reached a point
        though some may."""

    @property
    def unseen(self) -> NDArray[np.float32]:
        """The most that light which was not met may add to any channel, shape (n,), W/m2. Often there is no such light; the
        standard error does not include it."""

    @property
    def degrees_of_freedom(self) -> int:
        """Of each standard error: the blocks of rounds less one."""

    def interval(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Lower and upper ends, shape (n, 3), between which the irradiance lies with the run's confidence (95 % by default), by
        Student's distribution; what is `unseen` is not in it."""

    def __len__(self) -> int:
        """Points."""


@final
class Lightmap:
    """The light on the surface of an object, texel by texel; v = 0 is the uppermost row, as in glTF."""

    @property
    def name(self) -> str:
        """Of the object."""

    @property
    def irradiance(self) -> NDArray[np.float32]:
        """Shape (height, width, 3), W/m2. What no triangle covers is as the nearest texel that one covers."""

    @property
    def standard_error(self) -> NDArray[np.float32]:
        """Shape (height, width, 3), W/m2; inf where unknown: of fewer than eight blocks of rounds, and where no light has reached
        a texel though some may."""

    @property
    def unseen(self) -> NDArray[np.float32]:
        """The most that light which was not met may add to any channel, shape (height, width), W/m2."""

    @property
    def degrees_of_freedom(self) -> int:
        """Of each standard error: the blocks of rounds less one."""

@final
class Lightmaps(Run):
    """The light on all surfaces."""

    @property
    def maps(self) -> list[Lightmap]:
        """One an object."""

    @property
    def files(self) -> list[str]:
        """Names of the files in the folder that was given."""

    def __len__(self) -> int:
        """Objects."""


def study(
    scene: str | PathLike[str],
    folder: str | PathLike[str],
    *,
    budget: float = 240.0,
    repeats: int = 5,
    side: int | None = None,
    photons: int | None = None,
    rounds: int = 1048576,
    seed: int = 1,
    reference_samples: int = 4096,
    device: Device | None = None,
    progress: Callable[[str], object] | None = None,
) -> dict[str, Any]:
    """Measures error against time for every setting on a device.

    scene: as of `Scene`.
    folder: for index.html, points.csv, study.json and charts. A study that was interrupted goes on with what is there.
    budget: seconds of all measurements together, without a reference that is made.
    repeats: runs of every setting and number of rounds, whose spread gives intervals.
    side: pixels along the longer side, or texels along a wall of open-box; 128 and 64, on a CPU 64 and 24.
    photons: per round; 262144, on a CPU 8192.
    rounds: most of a run.
    seed: of the first run of every setting.
    reference_samples: per pixel of a path-traced reference.
    progress: called with a line for every step.

    Returns what study.json holds.
    """
