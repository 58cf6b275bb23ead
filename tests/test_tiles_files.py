"""Files larger than memory: read and written in parts, resumed after an interruption."""

import dataclasses

import numpy as np
import pytest

from face_plugin import Execution, Params, estimate_normals
from face_plugin.io import CloudFile, read_cloud, write_cloud
from face_plugin.io.sinks import WRITERS
from face_plugin.io.sources import ArraySource, open_source
from face_plugin.shapes import sphere
from face_plugin.tiles.engines import Serial
from face_plugin.tiles.files import columns_of, normals_of_file, streams, work_folder
from face_plugin.tiles.prepare import fill_store

EXECUTION = Execution(tile_points=1250, engine="serial")
COUNT = 2500


@pytest.fixture(scope="module")
def ball():
    return sphere(COUNT)


@pytest.fixture(scope="module")
def expected(ball):
    return estimate_normals(ball.points, execution=EXECUTION)


def attributes():
    rng = np.random.default_rng(0)
    return {
        "red": rng.integers(0, 256, COUNT).astype(np.uint8),
        "intensity": rng.integers(0, 60000, COUNT).astype(np.uint16),
        "quality": rng.random(COUNT).astype(np.float32),
    }


@pytest.mark.parametrize("suffix", [".npy", ".ply", ".las", ".laz"])
@pytest.mark.parametrize("output", [".npy", ".ply", ".las", ".laz"])
def test_every_pair_of_formats(suffix, output, ball, expected, tmp_path):
    source, target = tmp_path / f"in{suffix}", tmp_path / f"out{output}"
    write_cloud(source, CloudFile(ball.points, attributes=attributes()))
    read, opened = read_cloud(source), open_source(source)
    inside = np.arange(COUNT) % 3 == 0
    found = {
        "normals": expected.normals,
        "strength": expected.strength,
        "confidence": expected.confidence,
        "interior": inside,
    }
    # Three parts of different length.
    parts = columns_of(opened, found, ["strength", "interior"], keep=None, chunk=1000)
    WRITERS[output](target, COUNT, parts, opened)
    written = read_cloud(target)
    step = 1e-8 if ".la" in suffix + output else 0.0
    assert np.allclose(written.points, read.points, rtol=0, atol=step)
    # LAS keeps normals in single precision.
    assert np.allclose(written.normals, expected.normals, rtol=0, atol=1e-7)
    if output != ".npy":
        assert np.allclose(written.attributes["strength"], expected.strength, rtol=1e-6)
        assert np.array_equal(written.attributes["interior"] > 0, inside)
        if suffix != ".npy":
            assert np.allclose(written.attributes["quality"], attributes()["quality"], rtol=1e-6)
            assert np.array_equal(written.attributes["intensity"], attributes()["intensity"])
    kept = columns_of(opened, found, [], keep=~inside, chunk=1000)
    WRITERS[output](target, int((~inside).sum()), kept, opened)
    assert np.allclose(read_cloud(target).points, read.points[~inside], rtol=0, atol=step)


@pytest.mark.parametrize("factor", [1, 257])
def test_colours_of_las_become_bytes_in_every_part(factor, ball, tmp_path):
    rng = np.random.default_rng(1)
    colours = {name: rng.integers(0, 256, COUNT) * (np.arange(COUNT) > 1200) for name in ("red", "green", "blue")}
    given = {name: (values * factor).astype(np.uint16) for name, values in colours.items()}
    write_cloud(tmp_path / "in.las", CloudFile(ball.points, attributes=given))
    content = (tmp_path / "in.las").read_bytes()
    (tmp_path / "in.las").write_bytes(content[:58] + b"Ger\xe4t".ljust(32, b"\0") + content[90:])
    opened = open_source(tmp_path / "in.las")
    # The first part is black: it does not say whether the colours have 8 bits or 16.
    parts = columns_of(opened, {"normals": ball.normals}, [], keep=None, chunk=1000)
    WRITERS[".ply"](tmp_path / "out.ply", COUNT, parts, opened)
    parts = columns_of(opened, {"normals": ball.normals}, [], keep=None, chunk=1000)
    WRITERS[".las"](tmp_path / "out.las", COUNT, parts, opened)
    assert b"Ger\xe4t" in (tmp_path / "out.las").read_bytes()[58:90]
    written = read_cloud(tmp_path / "out.ply").attributes
    for name, values in colours.items():
        assert written[name].dtype == np.uint8
        assert np.array_equal(written[name], values)


def test_the_same_normals_as_in_memory(ball, expected, tmp_path):
    np.save(tmp_path / "in.npy", ball.points)
    result = normals_of_file(tmp_path / "in.npy", tmp_path / "out.ply", execution=EXECUTION)
    assert np.array_equal(read_cloud(tmp_path / "out.ply").normals, expected.normals)
    assert result.written == COUNT
    assert not work_folder(tmp_path / "out.ply").exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in.npy", "out.ply"]


class Stopping(Serial):
    """An engine that is interrupted after the first tile."""

    def run(self, job, folder, tiles, done):
        done(job(folder, tiles[0]))
        raise KeyboardInterrupt


def test_an_interrupted_run_goes_on(ball, expected, tmp_path):
    source, output = tmp_path / "in.npy", tmp_path / "out.npy"
    np.save(source, ball.points)
    with pytest.raises(KeyboardInterrupt):
        normals_of_file(source, output, execution=dataclasses.replace(EXECUTION, engine=Stopping()))
    assert not output.exists()
    folder = work_folder(output)
    done = list(folder.glob("field-*.npz"))
    assert len(done) == 1
    solved = []

    class Watching(Serial):
        def run(self, job, folder, tiles, done):
            solved.append(len(tiles))
            super().run(job, folder, tiles, done)

    # How the work is done may change on the way.
    other = Execution(tile_points=1250, workers=3, max_memory=2.0)
    normals_of_file(source, output, execution=dataclasses.replace(other, engine=Watching()), resume=True)
    # One tile of the first stage was left, and the second.
    assert solved == [1, 2]
    assert np.array_equal(np.load(output)[:, 3:], expected.normals)


def test_work_on_another_cloud_is_not_resumed(ball, tmp_path):
    source, output = tmp_path / "in.npy", tmp_path / "out.npy"
    np.save(source, ball.points)
    with pytest.raises(KeyboardInterrupt):
        normals_of_file(source, output, execution=dataclasses.replace(EXECUTION, engine=Stopping()))
    with pytest.raises(ValueError, match="another input or with other settings"):
        normals_of_file(source, output, Params(seed=1), execution=EXECUTION, resume=True)
    np.save(source, ball.points[::-1])
    with pytest.raises(ValueError, match="another input or with other settings"):
        normals_of_file(source, output, execution=EXECUTION, resume=True)
    assert work_folder(output).exists()


def test_a_failure_before_any_tile_leaves_nothing(tmp_path):
    bad = sphere(COUNT).points
    bad[2100, 1] = np.inf
    np.save(tmp_path / "in.npy", bad)
    with pytest.raises(ValueError, match="found NaN or infinity in 1 of 2500 rows: 2100"):
        normals_of_file(tmp_path / "in.npy", tmp_path / "out.ply", execution=EXECUTION)
    assert [path.name for path in tmp_path.iterdir()] == ["in.npy"]
    with pytest.raises(ValueError, match=r"1 of 500 rows: 100 \(rows counted from row 2000\)"):
        fill_store(tmp_path, ArraySource(bad), Params(), 1250, interior=False, chunk=1000)


def test_a_store_does_not_depend_on_the_parts(ball, tmp_path):
    stores = []
    for name, chunk in (("whole", COUNT), ("parts", 700)):
        (tmp_path / name).mkdir()
        source = ArraySource(ball.points)
        stores.append(fill_store(tmp_path / name, source, Params(), 600, interior=False, chunk=chunk))
    (whole, voxels), (parts, others) = stores
    assert np.array_equal(whole.points(), parts.points())
    assert np.array_equal(whole.rows(), parts.rows())
    assert np.array_equal(whole.bounds, parts.bounds)
    assert np.array_equal(voxels.points, others.points)
    assert np.allclose(whole.frame.from_unit(whole.points()), ball.points[whole.rows()], rtol=0, atol=1e-14)


def test_files_that_cannot_be_streamed(tmp_path):
    (tmp_path / "in.xyz").write_text("0 0 0\n")
    np.save(tmp_path / "in.npy", np.zeros((4, 2)))
    with pytest.raises(ValueError, match=r"in\.xyz: cannot be read in parts; allowed are \.npy"):
        normals_of_file(tmp_path / "in.xyz", tmp_path / "out.ply")
    with pytest.raises(ValueError, match=r"out\.obj: cannot be written in parts"):
        normals_of_file(tmp_path / "in.npy", tmp_path / "out.obj")
    with pytest.raises(ValueError, match=r"in\.npy: not a readable NPY file: .* shape \(4, 2\)"):
        normals_of_file(tmp_path / "in.npy", tmp_path / "out.ply")
    header = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n"
    (tmp_path / "in.ply").write_text(header + "0\n")
    with pytest.raises(ValueError, match=r"'vertex' has no x, y, z"):
        open_source(tmp_path / "in.ply")


def test_what_is_streamed(tmp_path):
    np.save(tmp_path / "in.npy", np.zeros((200_000, 3), dtype=np.float32))
    small, large = Execution(max_memory=0.05), Execution(max_memory=1.0)
    assert streams(tmp_path / "in.npy", tmp_path / "out.ply", small)
    assert not streams(tmp_path / "in.npy", tmp_path / "out.ply", large)
    assert not streams(tmp_path / "in.npy", tmp_path / "out.xyz", small)


def test_parts_of_a_source_are_the_whole(tmp_path):
    points = np.random.default_rng(0).random((2500, 3)).astype(np.float32)
    write_cloud(tmp_path / "a.ply", CloudFile(points, attributes=attributes()))
    source = open_source(tmp_path / "a.ply")
    parts = list(source.parts(700))
    assert [len(p) for p, _ in parts] == [700, 700, 700, 400]
    assert np.array_equal(np.concatenate([p for p, _ in parts]), points)
    assert np.array_equal(np.concatenate([a["red"] for _, a in parts]), attributes()["red"])
    assert source.dtype == np.float32
    assert source.count == 2500
    assert source.digest() == open_source(tmp_path / "a.ply").digest()
