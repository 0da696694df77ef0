"""The body as a mesh, by another library's eyes and against a hand value."""

import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import jaxclay
from jaxclay.files.mesh import FORMATS, mesh_bytes, mesh_of, save_mesh

trimesh = pytest.importorskip("trimesh")
CONE = jaxclay.Clay.from_profile([0, 1.0], [0.5, 0.2], slices=64)


@pytest.mark.parametrize("wall", [None, 2.0], ids=["solid", "vessel"])
@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("name", ["teapot", "amphora"])
def test_a_body_is_one_closed_shell_outwards_of_the_clay_s_volume(name, kind, wall):
    clay = jaxclay.load_profile(name)
    data = io.BytesIO(mesh_bytes(clay, kind, 50.0, wall))
    mesh = trimesh.load(data, file_type=kind[1:], force="mesh")
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.body_count == 1
    assert mesh.euler_number == 2
    assert mesh.volume > 0  # normals point outwards
    up = 1 if kind == ".glb" else 2
    assert mesh.bounds[:, up] == pytest.approx([0, 50 * float(clay.height)], rel=1e-6)
    if wall is None:
        assert mesh.volume == pytest.approx(float(clay.volume) * 50**3, rel=1e-6)


def test_the_volume_of_a_cone_is_that_of_the_frustum():
    assert mesh_of(CONE, 10.0).volume == pytest.approx(
        np.pi * (0.25 + 0.1 + 0.04) / 3 * 1000, rel=1e-3
    )


def test_a_cylindrical_cup_has_the_volume_of_its_wall_and_floor():
    cup = mesh_of(jaxclay.Clay.cylinder(0.4), 100.0, wall=5.0)
    assert cup.volume == pytest.approx(np.pi * (40**2 * 100 - 35**2 * 95), rel=1e-3)


def test_a_wall_is_as_thick_as_asked_across_a_slope():
    cup = mesh_of(CONE, 100.0, wall=3.0)
    points = cup.vertices[np.abs(cup.vertices[:, 2] - 50) < 30]
    radius = np.linalg.norm(points[:, :2], axis=1)
    inside = points[radius < 50 - 0.3 * points[:, 2] - 1]
    outwards = np.array([1, 0.3]) / np.hypot(1, 0.3)
    across = (
        50 * outwards[0]
        - np.stack([np.linalg.norm(inside[:, :2], axis=1), inside[:, 2]], 1) @ outwards
    )
    np.testing.assert_allclose(across, 3.0, atol=0.05)


@settings(max_examples=15, deadline=None)
@given(st.lists(st.floats(0.05, 2.0), min_size=2, max_size=9), st.integers(3, 400))
def test_any_profile_is_watertight_and_keeps_its_volume(radii, slices):
    clay = jaxclay.Clay.from_profile(np.linspace(0, 1, len(radii)), radii, slices)
    mesh = mesh_of(clay, 100.0)
    assert mesh.is_watertight
    assert len(mesh.vertices) <= 256 * 256 + 2
    assert mesh.volume == pytest.approx(float(clay.volume) * 1e6, rel=1e-9)


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({"wall": 45.0}, "fills the piece"),
        ({"wall": -1.0}, "wall must be positive"),
        ({"millimetres": 0.0}, "millimetres must be positive"),
        ({"rings": 4}, "rings must be"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path, given, reason):
    path = tmp_path / "cup.stl"
    path.write_bytes(b"before")
    with pytest.raises(ValueError, match=reason):
        save_mesh(CONE, path, **given)
    assert path.read_bytes() == b"before"
    with pytest.raises(ValueError, match="a mesh is written as"):
        save_mesh(CONE, tmp_path / "cup.ply")
