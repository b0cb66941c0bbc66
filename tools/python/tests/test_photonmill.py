"""The module as a user has it, installed from the wheel."""

from __future__ import annotations

import inspect
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR  # type: ignore[import-not-found]
import pytest

import photonmill as pm

QUICK: pm.Settings = {"rounds": 32, "photons": 4096, "seed": 7}
SIZE = (24, 24)
SOURCE = Path(os.environ.get("PHOTONMILL_SOURCE", Path(__file__).parents[3]))


@pytest.fixture(scope="module")
def spheres() -> pm.Scene:
    return pm.Scene("cornell-spheres")


@pytest.fixture(scope="module")
def film(spheres: pm.Scene) -> pm.Film:
    return spheres.render(size=SIZE, **QUICK)


def test_a_film_is_arrays_with_their_errors(film: pm.Film) -> None:
    width, height = SIZE
    assert (film.width, film.height) == SIZE
    for array in [film.radiance, film.standard_error, film.albedo, film.normal]:
        assert array.shape == (height, width, 3) and array.dtype == np.float32
    assert film.depth.shape == (height, width)
    assert np.all(film.radiance >= 0.0) and film.radiance.mean() > 0.0
    known = np.isfinite(film.standard_error)
    assert known.mean() > 0.9 and np.all(film.standard_error[known] >= 0.0)
    assert set(film.parts) == {"direct", "specular", "caustic", "indirect"}
    assert all(part.mean() > 0.0 for part in film.parts.values())
    np.testing.assert_allclose(sum(film.parts.values()), film.radiance, rtol=1e-5, atol=1e-6)
    lengths = np.linalg.norm(film.normal, axis=2)
    assert np.isclose(lengths, 1.0, rtol=1e-5).mean() > 0.7 and lengths.max() < 1.00001
    assert np.isfinite(film.depth).all() and film.depth.min() > 1.0


def test_a_run_says_how_wrong_it_is(film: pm.Film) -> None:
    assert 0.0 < film.relative_error < film.bound < np.inf
    assert (film.confidence, film.rounds, film.end, film.seed) == (0.95, 32, "rounds", 7)
    assert film.seconds > 0.0 and film.bias is not None
    ledger = film.ledger
    assert ledger["emitted"] == ledger["absorbed"] + ledger["escaped"] + ledger["cut_off"] + ledger["dropped"] > 0
    assert ledger["dropped"] == 0
    assert "noise:" in film.report and "photons stored" in film.report
    details = film.details
    assert details["relative_error"] == film.relative_error and details["total_bound"] == film.bound
    assert repr(film).startswith("Film('cornell-spheres', 32 rounds")


def test_arrays_are_made_once_and_cannot_be_written_to(film: pm.Film) -> None:
    assert film.radiance is film.radiance and film.parts["caustic"] is film.parts["caustic"]
    # The memory that the values were written to, and no copy of it.
    assert film.radiance.flags.c_contiguous and not film.radiance.flags.writeable
    with pytest.raises(ValueError, match="read-only"):
        film.radiance[0, 0, 0] = 1.0
    mine = film.radiance.copy()
    mine[0, 0, 0] = 1.0


def test_an_array_outlives_its_film(spheres: pm.Scene) -> None:
    radiance = spheres.render(size=8, rounds=1, photons=1024).radiance
    assert radiance.shape[1] == 8 and np.isfinite(radiance.sum())


def test_the_same_bits_as_the_program(spheres: pm.Scene, film: pm.Film, tmp_path: Path) -> None:
    program = os.environ.get("PHOTONMILL_PROGRAM")
    if not program:
        pytest.skip("PHOTONMILL_PROGRAM names no program")

    def run(name: str, *options: str) -> dict[str, Any]:
        command = [program, "render", "cornell-spheres", "--output", str(tmp_path / name), "--quiet", *options]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        return channels(tmp_path / name)

    ours = tmp_path / "ours.exr"
    film.save(ours)
    theirs, saved = run("theirs.exr", "--size", "24x24", "--rounds", "32", "--photons", "4096", "--seed", "7"), channels(ours)
    assert theirs.keys() == saved.keys() and len(theirs) == 28
    for name in theirs:
        np.testing.assert_array_equal(theirs[name].view(np.uint32), saved[name].view(np.uint32), err_msg=name)
    layers = {"": film.radiance, "standard_error.": film.standard_error, "albedo.": film.albedo}
    layers |= {f"{name}.": part for name, part in film.parts.items()}
    for layer, array in layers.items():
        for number, letter in enumerate("RGB"):
            np.testing.assert_array_equal(theirs[layer + letter].view(np.uint32), array[..., number].view(np.uint32))
    # Defaults and what a pilot chooses are the same, too.
    theirs, found = run("defaults.exr", "--size", "16", "--error", "60%"), spheres.render(size=16, error="60%")
    for number, letter in enumerate("RGB"):
        np.testing.assert_array_equal(theirs[letter].view(np.uint32), found.radiance[..., number].view(np.uint32))


def channels(path: Path) -> dict[str, Any]:
    """Values of an OpenEXR by channel."""
    return {name: channel.pixels for name, channel in OpenEXR.File(str(path), separate_channels=True).channels().items()}


def test_a_run_ends_at_an_error(spheres: pm.Scene) -> None:
    reported: list[pm.Progress] = []
    film = spheres.render(size=16, error=0.5, progress=reported.append)
    assert film.end == "error" and film.bound <= 0.5
    assert all(now["rounds"] >= 0 and now["seconds"] >= 0.0 for now in reported)
    timed = spheres.render(size=16, time=0.2)
    assert timed.end == "time" and timed.rounds > 0


def test_pictures_are_written(film: pm.Film, tmp_path: Path) -> None:
    film.save(str(tmp_path / "picture.png"), exposure=1, tone="linear")
    film.save(tmp_path / "picture.exr", layers=["caustic"])
    assert (tmp_path / "picture.png").read_bytes().startswith(b"\x89PNG")
    assert set(channels(tmp_path / "picture.exr")) == {"R", "G", "B", "caustic.R", "caustic.G", "caustic.B"}
    assert film.png() == film._repr_png_() != film.png(exposure=3) != film.png(exposure=3, white_balance=3000)  # type: ignore[attr-defined]


def test_points_have_the_irradiance_of_a_closed_form() -> None:
    # A closed cube whose walls emit 1 W/m2/sr and scatter half of what arrives.
    scene = pm.Scene("furnace")
    points = np.array([[0.5, 0.001, 0.5], [0.3, 0.001, 0.4]])
    found = scene.probe(points, [[0, 2, 0], [0, 1, 0]], rounds=32, photons=8192)
    assert found.irradiance.shape == found.standard_error.shape == (2, 3) and len(found) == 2
    assert np.all(found.standard_error < 0.5) and found.degrees_of_freedom == 7 and found.unseen.shape == (2,)
    low, high = found.interval()
    np.testing.assert_allclose(high - low, 2 * 2.3646 * found.standard_error, rtol=1e-3)
    assert np.all(np.abs(found.irradiance - 2 * np.pi) < 4 * found.standard_error + 0.02)
    # Whatever the points come in.
    again = scene.probe(points.tolist(), [[0, 1, 0]] * 2, rounds=32, photons=8192)
    np.testing.assert_array_equal(found.irradiance, again.irradiance)


def test_lightmaps_are_arrays_and_files(tmp_path: Path) -> None:
    scene = pm.Scene("cornell")
    baked = scene.bake(tmp_path, texels_per_metre=4, rounds=32, photons=4096)
    assert len(baked) == len(baked.maps) > 0
    for lightmap in baked.maps:
        assert lightmap.irradiance.shape == lightmap.standard_error.shape and lightmap.irradiance.shape[2] == 3
    largest = max(baked.maps, key=lambda lightmap: lightmap.irradiance.size)
    assert largest.irradiance.mean() > 0.0 and np.isfinite(largest.standard_error).mean() > 0.9
    assert baked.files and all((tmp_path / name).is_file() for name in baked.files)
    stem = next(name for name in baked.files if name.endswith("_irradiance.exr"))
    written = channels(tmp_path / stem)
    shapes = {lightmap.irradiance.shape[:2]: lightmap for lightmap in baked.maps}
    assert written["R"].shape in shapes
    without = scene.bake(texels_per_metre=4, rounds=32, photons=4096)
    assert without.files == []
    np.testing.assert_array_equal(without.maps[0].irradiance, baked.maps[0].irradiance)


def test_a_camera_of_ones_own_sees_what_it_looks_at(spheres: pm.Scene) -> None:
    own = spheres.cameras[0]
    target = [eye + ahead for eye, ahead in zip(own.position, own.forward)]
    assert own.fov is not None
    same = pm.Camera(own.position, np.array(target), own.up, own.fov)
    picture = spheres.render(same, SIZE, **QUICK)
    np.testing.assert_allclose(picture.depth, spheres.render(size=SIZE, **QUICK).depth, rtol=1e-4)
    other = spheres.render(pm.Camera((0.5, 0.6, 0.5), (0.5, 0, 0.4), fov=60), SIZE, rounds=1, photons=1024)
    assert other.depth.max() < picture.depth.max()
    assert same.position == own.position and abs(same.fov - own.fov) < 1e-9 if same.fov else False
    assert spheres.render(own.name, 8, rounds=1, photons=1024).width == 8


def test_a_scene_says_what_it_holds() -> None:
    scene = pm.Scene("cornell-spheres", sun=(135, 40))
    assert {light.kind for light in scene.lights} >= {"sky", "directional"} and scene.triangles > 100
    assert len(scene.meshes) > 5 and len(scene.materials) > 3 and len(scene.cameras) == 1
    (x, y, z), (u, v, w) = scene.bounds
    assert x < u and y < v and z < w
    assert {"cornell", "cornell-spheres", "open-box"} <= set(pm.scenes())


def test_warnings_are_warnings(tmp_path: Path) -> None:
    scene = tmp_path / "dark.gltf"
    scene.write_text('{"asset": {"version": "2.0"}}')
    path = SOURCE / "tests" / "scenes" / "blender.glb"
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        read = pm.Scene(path)
    assert [str(warning.message) for warning in caught if warning.category is pm.RunWarning] == read.warnings
    with pytest.raises(pm.Error, match="dark.gltf"):
        pm.Scene(scene)


def test_devices_have_facts() -> None:
    facts = pm.devices()
    device = pm.Device(facts[0].index, memory=1 << 28)
    assert isinstance(device, pm.DeviceFacts) and device.name == facts[0].name
    assert device.kind in {"discrete", "integrated", "virtual", "cpu", "other"} and device.memory > 0 and device.lacks == []
    film = pm.Scene("cornell").render(size=8, rounds=2, photons=1024, device=device)
    # Less memory, or another device of its kind: the same bits.
    np.testing.assert_array_equal(film.radiance, pm.Scene("cornell").render(size=8, rounds=2, photons=1024, device=pm.Device(facts[0].name)).radiance)


WRONG: list[tuple[type[Exception], str, dict[str, Any]]] = [
    (pm.ArgumentError, "error=5: did you mean 5% or 500%?", {"error": 5}),
    (pm.ArgumentError, "confidence=1: must be from 50 %", {"confidence": 1.0}),
    (pm.ArgumentError, "time=0: must be from 1ms", {"time": 0}),
    (pm.ArgumentError, "time=NaN: must be from 1ms", {"time": float("nan")}),
    (pm.ArgumentError, "rounds=0: must be from 1", {"rounds": 0}),
    (pm.ArgumentError, "rounds=-1: must be 0 or more, and at most 4294967295", {"rounds": -1}),
    (pm.ArgumentError, "photons=18446744073709551616: must be 0 or more", {"photons": 2**64}),
    (pm.ArgumentError, "samples=3: must be a power of two", {"samples": 3}),
    (pm.ArgumentError, "radius=0: must be a number of metres above 0", {"radius": 0.0}),
    (pm.ArgumentError, "kernel='cube': must be one of box, cone, epanechnikov", {"kernel": "cube"}),
    (pm.ArgumentError, "without=['lamps']: must be among direct, indirect", {"without": ["lamps"]}),
    (pm.ArgumentError, "without=bvh: is also in with_=", {"with_": "bvh", "without": "bvh"}),
    (pm.ArgumentError, "camera=nobody: must be one of", {"camera": "nobody"}),
    (pm.ArgumentError, "size=0: must be WIDTH or WIDTHxHEIGHT", {"size": 0}),
    (pm.ArgumentError, "size=4x-4: must be", {"size": (4, -4)}),
    (TypeError, "got an unexpected keyword argument 'eror'. Did you mean 'error'?", {"eror": 0.1}),
    (TypeError, "got an unexpected keyword argument 'xyz'; the settings are denoise, ", {"xyz": 0.1}),
    (pm.ArgumentError, "error='0.02': did you mean 2% or 0.02%?", {"error": "0.02"}),
    (TypeError, "error must be a number, or a str such as '2%', not list", {"error": [2]}),
    (TypeError, "photons must be an int, not float", {"photons": 1000.5}),
    (TypeError, "photons must be an int, not bool", {"photons": True}),
    (TypeError, "aim must be a bool, not str", {"aim": "on"}),
    (TypeError, "size must be a width or", {"size": "24x16"}),
    (TypeError, "camera must be a Camera or the name of one", {"camera": 3}),
]


@pytest.mark.parametrize(("category", "message", "arguments"), WRONG, ids=[re.sub(r"\W+", "_", message)[:30] for _, message, _ in WRONG])
def test_wrong_arguments_are_refused_in_one_line(spheres: pm.Scene, category: type[Exception], message: str, arguments: dict[str, Any]) -> None:
    with pytest.raises(category, match=re.escape(message)) as caught:
        spheres.render(**{"size": 8, **arguments})
    assert "\n" not in str(caught.value) and "--" not in str(caught.value)


def test_other_wrong_arguments_are_refused(film: pm.Film, spheres: pm.Scene, tmp_path: Path) -> None:
    assert issubclass(pm.ArgumentError, ValueError) and issubclass(pm.ArgumentError, pm.Error)
    wrong: list[tuple[type[Exception], str, Callable[[], object]]] = [
        (pm.ArgumentError, "scene=cornel: did you mean cornell", lambda: pm.Scene("cornel")),
        (pm.Error, "absent.glb", lambda: pm.Scene(tmp_path / "absent.glb")),
        (TypeError, "scene must be a str or a path", lambda: pm.Scene(3)),  # type: ignore[arg-type]
        (pm.ArgumentError, "sun", lambda: pm.Scene("cornell", sun=(0, 100))),
        (pm.ArgumentError, "environment=-1", lambda: pm.Scene("cornell", environment=-1)),
        (pm.ArgumentError, "device=nothing: must match exactly one Vulkan device", lambda: pm.Device("nothing")),
        (pm.ArgumentError, "memory=1: must be at least", lambda: pm.Device(memory=1)),
        (pm.ArgumentError, "path=.*picture.bmp: must be a file name that ends in .png or .exr", lambda: film.save(tmp_path / "picture.bmp")),
        (pm.Error, "cannot be written", lambda: film.save(tmp_path / "absent" / "picture.png")),
        (pm.ArgumentError, "exposure=100", lambda: film.png(exposure=100)),
        (pm.ArgumentError, "white_balance=1000: must be from 1667", lambda: film.png(white_balance=1000)),
        (pm.ArgumentError, r"layers=\['depths'\]: must be all, none, or some of", lambda: film.save(tmp_path / "picture.exr", layers=["depths"])),
        (pm.ArgumentError, r"points: must have the shape \(n, 3\), and has \(3,\)", lambda: spheres.probe([0, 0, 0], [0, 1, 0])),
        (pm.ArgumentError, "points=0: must be from 1 to", lambda: spheres.probe(np.empty((0, 3)), np.empty((0, 3)))),
        (pm.ArgumentError, "each point needs one", lambda: spheres.probe([[0, 0, 0]], [[0, 1, 0], [0, 1, 0]])),
        (pm.ArgumentError, "points: number 1 has a normal of length 0", lambda: spheres.probe([[0, 0, 0], [0, 0, 0]], [[0, 1, 0], [0, 0, 0]])),
        (pm.ArgumentError, "points: number 0 holds NaN", lambda: spheres.probe([[0, float("nan"), 0]], [[0, 1, 0]])),
        (TypeError, "'samples' is of pictures only", lambda: spheres.probe([[0, 0, 0]], [[0, 1, 0]], samples=2)),
        (pm.ArgumentError, "atlas=5", lambda: spheres.bake(atlas=5)),
        (pm.ArgumentError, "target.* must not be the position", lambda: pm.Camera((0, 0, 0), (0, 0, 0))),
        (pm.ArgumentError, "fov=180", lambda: pm.Camera((0, 0, 0), (0, 0, 1), fov=180)),
        (pm.ArgumentError, "budget=0: must be from 1s", lambda: pm.study("cornell", tmp_path, budget=0)),
        (pm.ArgumentError, "repeats=1: must be from 2", lambda: pm.study("cornell", tmp_path, repeats=1)),
    ]
    for category, message, call in wrong:
        with pytest.raises(category, match=message):
            call()


def test_every_setting_is_known(spheres: pm.Scene) -> None:
    stub = (Path(pm.__file__).parent / "__init__.pyi").read_text()
    fields = re.findall(r"^    (\w+): ", stub.split("class Settings")[1].split("\nclass ")[0], re.M)
    with pytest.raises(TypeError) as caught:
        spheres.render(xyz=1)  # type: ignore[call-arg]
    assert sorted(fields) == sorted(str(caught.value).split("the settings are ")[1].split(", ")) and len(fields) > 45
    # Files, and another camera, are tested by themselves.
    others = ["bias", "checkpoint", "every", "resume", "shard", "map", "settings", "save_settings", "denoise", "eye", "look_at", "up"]
    fields = [name for name in fields if name not in [*others, "fov", "orthographic", "aperture", "focus", "alpha"]]
    samples: dict[str, Any] = {name: 1 for name in fields} | {"error": 0.5, "group_size": 64}
    samples |= {"measure": "rmse", "confidence": 0.9, "kernel": "box", "illumination": "split", "part": "all", "filter": "box", "variant": "auto"}
    samples |= {"math": "fast", "with_": [], "without": []}
    samples |= {name: False for name in ["edge_correction", "final_gather", "aim", "paranoid", "fixed_radius"]}
    spheres.render(size=4, **samples)
    spheres.render(size=4, **{**dict.fromkeys(fields), "rounds": 1, "photons": 512})  # type: ignore[arg-type]


def test_a_run_goes_on_from_its_checkpoint(spheres: pm.Scene, tmp_path: Path) -> None:
    settings: dict[str, Any] = {"size": 8, "photons": 512, "seed": 3, "eye": (0.5, 0.5, 1.4), "look_at": (0.5, 0.4, 0.0)}
    whole = spheres.render(rounds=16, **settings)
    spheres.render(rounds=8, checkpoint=tmp_path / "run.pms", **settings)
    resumed = spheres.render(rounds=16, resume=tmp_path / "run.pms", **settings)
    np.testing.assert_array_equal(whole.radiance, resumed.radiance)
    tuned = tmp_path / "tuned.json"
    spheres.render(error=0.5, save_settings=tuned, **(settings | {"photons": None}))
    assert json.loads(tuned.read_text())["scene"] == "cornell-spheres"
    with pytest.raises(pm.ArgumentError, match="shard='3/2': must be K/N"):
        spheres.render(shard="3/2", checkpoint=tmp_path / "part.pms", **settings)


def test_everything_has_a_docstring() -> None:
    stub = (Path(pm.__file__).parent / "__init__.pyi").read_text()
    assert pm.__doc__ and "float32" in pm.__doc__
    things = [(name, thing) for name, thing in vars(pm).items() if not name.startswith("_") and not inspect.ismodule(thing)]
    assert len(things) > 12
    for name, thing in things:
        assert inspect.getdoc(thing), name
        assert name in stub, name
        for member, value in vars(thing).items() if inspect.isclass(thing) else []:
            if not member.startswith("_"):
                assert inspect.getdoc(value), f"{name}.{member}"
    assert "Shape (height, width, 3), W/m2/sr." == inspect.getdoc(pm.Film.radiance)


def test_other_threads_go_on_while_the_device_works(spheres: pm.Scene) -> None:
    count, done = 0, threading.Event()

    def work() -> None:
        nonlocal count
        while not done.is_set():
            count += 1
            time.sleep(0.001)

    thread = threading.Thread(target=work)
    thread.start()
    film = spheres.render(size=24, time=0.5)
    done.set()
    thread.join()
    # A thousand in a second, if nobody were in its way; none if the lock were held.
    assert count > 100 * film.seconds, f"{count} in {film.seconds} s"


def test_threads_take_turns_on_a_device(spheres: pm.Scene, film: pm.Film) -> None:
    found: list[pm.Film] = []
    threads = [threading.Thread(target=lambda: found.append(spheres.render(size=SIZE, **QUICK))) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 3
    for other in found:
        np.testing.assert_array_equal(other.radiance, film.radiance)


CHILD = """
import signal, threading
import photonmill as pm
signal.signal(signal.SIGINT, signal.default_int_handler)
scene = pm.Scene("cornell-spheres")
scene.render(size=8, rounds=1, photons=1024)
print("ready", flush=True)
# Nothing of Python runs in this thread, which is the one that hears of signals.
threading.Timer(0.5, lambda: print("under way", flush=True)).start()
try:
    scene.render(size=32, WORK)
except KeyboardInterrupt:
    print("interrupted", flush=True)
# What was interrupted is in nobody's way.
print(scene.render(size=8, rounds=1, photons=1024).rounds, flush=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there are no signals to send")
@pytest.mark.parametrize("work", ["time=20, rounds=100000", "error=0.001"], ids=["run", "pilot"])
def test_ctrl_c_ends_a_run(work: str) -> None:
    child = subprocess.Popen([sys.executable, "-c", CHILD.replace("WORK", work)], stdout=subprocess.PIPE, text=True)
    try:
        assert child.stdout is not None
        assert child.stdout.readline() == "ready\n"
        assert child.stdout.readline() == "under way\n"
        child.send_signal(signal.SIGINT)
        sent = time.monotonic()
        rest = child.communicate(timeout=30)[0].split("\n")
    finally:
        child.kill()
    assert rest == ["interrupted", "1", ""]
    assert child.returncode == 0 and time.monotonic() - sent < 5.0


def test_what_progress_raises_ends_the_run(spheres: pm.Scene) -> None:
    class Enough(Exception):
        pass

    def stop(now: pm.Progress) -> None:
        raise Enough

    with pytest.raises(Enough):
        spheres.render(size=16, rounds=1000000, progress=stop)


def test_a_study_ends_where_it_is_asked_to(tmp_path: Path) -> None:
    def stop(line: str) -> None:
        raise RuntimeError(line)

    with pytest.raises(RuntimeError, match="."):
        pm.study("point-over-plane", tmp_path, budget=1, repeats=2, side=8, photons=512, rounds=1, reference_samples=16, progress=stop)
    # What there is has its page.
    assert "Incomplete" in (tmp_path / "index.html").read_text()


@pytest.mark.skipif("PHOTONMILL_SLOW" not in os.environ, reason="makes pipelines for every choice, half a minute; PHOTONMILL_SLOW=1 runs it")
def test_a_study_is_written(tmp_path: Path) -> None:
    lines: list[str] = []
    found = pm.study("point-over-plane", tmp_path, budget=1, repeats=2, side=8, photons=512, rounds=1, reference_samples=16, progress=lines.append)
    assert found["complete"] is True and found["parts"] and lines
    assert (tmp_path / "index.html").is_file() and (tmp_path / "points.csv").is_file()


def test_what_the_guide_shows_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for page in ["src/guide/python.md", "tools/python/README.md"]:
        blocks = re.findall(r"^```python\n(.*?)^```", (SOURCE / page).read_text(), re.M | re.S)
        assert blocks, page
        names: dict[str, Any] = {}
        for block in blocks:
            exec(block, names)
        assert (tmp_path / "picture.exr").is_file()
        (tmp_path / "picture.exr").unlink()
    assert any((tmp_path / "baked").iterdir())
