"""Scenes: gaps and normals of every kind of obstacle, frames, and what is refused."""

import numpy as np
import pytest
import yaml

from gravcomp.config import ConfigError, from_mapping
from gravcomp.description import load_robot_file
from gravcomp.scene import SceneSection
from gravcomp.scene.distance import gap_to
from gravcomp.scene.scene import Scene
from gravcomp.scene.world_axes import world_rotation

_TUBE = {"points_mm": [[0, 0, -20], [0, 5, 30], [10, 20, 80], [30, 30, 130]], "radius_mm": [8, 9, 7, 12]}


def scene(tmp_path="", **kinds) -> Scene:
    return Scene(
        from_mapping(SceneSection, kinds, source="scene", key="scene"), str(tmp_path / "robot.yaml") if tmp_path else "scene"
    )


def written(tmp_path, mesh, name="wall.stl"):
    mesh.export(tmp_path / name)
    return name


@pytest.fixture
def ball():
    import trimesh

    return trimesh.creation.icosphere(3, 10.0)


def test_gaps_of_simple_obstacles_are_distances():
    one = scene(planes=[{"point_mm": [0, 0, 5], "normal": [0, 0, -2]}])
    gap, normal, number = one.nearest(np.array([[0.003, 0.0, 0.001]]))
    assert gap == pytest.approx([0.004]) and normal[0] == pytest.approx([0, 0, -1]) and number == [0]
    one = scene(spheres=[{"centre_mm": [0, 0, 10], "radius_mm": 4}, {"radius_mm": 100, "side": "inside"}])
    gap, normal, number = one.nearest(np.array([[0.0, 0.0, 0.005], [0.0, 0.099, 0.0]]))
    assert gap == pytest.approx([1e-3, 1e-3]) and normal == pytest.approx(np.array([[0, 0, -1.0], [0, -1, 0]]))
    assert number.tolist() == [0, 1]
    one = scene(boxes=[{"size_mm": [20, 20, 20], "rpy_deg": [0, 0, 45]}])
    gap, normal, _ = one.nearest(np.array([[0.02, 0.0, 0.0], [0.0, 0.0, 0.013], [0.0, 0.0, 0.009]]))
    assert gap == pytest.approx([0.02 - np.sqrt(2) * 0.01, 0.003, -0.001])
    assert normal[0] == pytest.approx([1, 0, 0], abs=1e-12)
    one = scene(boxes=[{"size_mm": [20, 40, 60], "side": "inside"}])
    gap, normal, number = one.nearest(np.array([[0.007, 0.0, 0.0], [0.0, 0.021, 0.0]]))
    assert gap == pytest.approx([0.003, -0.001]) and normal[1] == pytest.approx([0, -1, 0]) and number.tolist() == [0, 0]


@pytest.mark.parametrize("side", ["inside", "outside"])
def test_a_tube_s_gap_is_the_distance_to_its_envelope(side):
    """The distance is that to the ball of the densely sampled centre line whose surface is farthest out; the wall moves by it."""
    lumen = scene(tubes=[_TUBE | {"side": side}])
    piece, share = np.divmod(np.linspace(0, 2.9999, 40_001), 1.0)
    c = lumen.arrays.curve[piece.astype(int)]
    line = np.einsum("kp,kpi->ki", share[:, None] ** np.arange(3, -1, -1), c)
    random = np.random.default_rng(3)
    middle = line[random.integers(3_000, 37_000, 100)]
    points = middle[:, :3] + 0.006 * random.standard_normal((100, 3))
    gap, normal, _ = lumen.nearest(points)
    sampled = np.array([(line[:, 3] - np.linalg.norm(line[:, :3] - point, axis=1)).max() for point in points])
    inner = (points[:, 2] > 0.0) & (points[:, 2] < 0.11)
    expected = sampled if side == "inside" else -sampled
    assert gap[inner] == pytest.approx(expected[inner], abs=1e-9)
    on_wall = points - gap[:, None] * normal
    assert np.abs(lumen.nearest(on_wall[inner])[0]).max() < 1e-8


def test_normals_are_gradients_of_gaps(tmp_path, ball):
    name = written(tmp_path, ball)
    obstacles = scene(
        tmp_path, tubes=[_TUBE], spheres=[{"radius_mm": 6}], boxes=[{"size_mm": [5, 9, 40], "rpy_deg": [20, 30, 40]}],
        meshes=[{"file": name, "move_mm": [3, 2, 1], "side": "inside"}], planes=[{"normal": [1, 2, 3]}],
    )  # fmt: skip
    arrays = obstacles.arrays
    random = np.random.default_rng(1)
    normal, other, h = np.zeros(3), np.zeros(3), 1e-7
    for k in range(len(arrays.kind)):
        for point in 0.008 * random.standard_normal((20, 3)):
            gap_to(arrays, k, point, normal)
            slope = [
                (gap_to(arrays, k, point + h * e, other) - gap_to(arrays, k, point - h * e, other)) / (2 * h) for e in np.eye(3)
            ]
            assert slope == pytest.approx(normal, abs=2e-4), (k, point)


def test_past_its_open_ends_a_tube_is_no_wall():
    lumen = scene(tubes=[{"points_mm": [[0, 0, 0], [0, 0, 50]], "radius_mm": [5]}])
    gap, normal, _ = lumen.nearest(np.array([[0.004, 0, 0.025], [0.004, 0, 0.05], [0.02, 0, 0.054], [0.0, 0.0, 0.053]]))
    assert gap == pytest.approx([0.001, 0.001, np.hypot(0.015, 0.004), np.hypot(0.005, 0.003)])
    assert normal[2] == pytest.approx(np.array([15, 0, 4]) / np.hypot(15, 4))
    closed = scene(tubes=[{"points_mm": [[0, 0, 0], [0, 0, 50]], "radius_mm": [5], "closed": True}])
    assert closed.nearest(np.array([[0.0, 0.0, 0.053]]))[0] == pytest.approx([0.002])


def test_the_gap_of_a_surface_is_exact_for_its_triangles(tmp_path, ball):
    import trimesh

    ring = trimesh.creation.torus(20.0, 6.0)
    for number, mesh in enumerate((ball, ring)):
        name = written(tmp_path, mesh, f"{number}.obj")
        obstacle = scene(tmp_path, meshes=[{"file": name}])
        random = np.random.default_rng(number)
        points = random.uniform(-0.03, 0.03, (40, 3))
        gap = obstacle.nearest(points)[0]
        vertices = 1e-3 * mesh.vertices[mesh.faces]
        a, b = np.meshgrid(np.linspace(0, 1, 30), np.linspace(0, 1, 30))
        inside = a + b <= 1.0
        a, b = a[inside][:, None], b[inside][:, None]
        for point, found in zip(points, gap):
            near = vertices[np.argsort(np.linalg.norm(vertices.mean(axis=1) - point, axis=1))[:12]]
            dense = (near[:, None, 0] * (1 - a - b) + near[:, None, 1] * a + near[:, None, 2] * b).reshape(-1, 3)
            assert abs(found) <= np.linalg.norm(dense - point, axis=1).min() + 1e-9
            assert abs(found) >= np.linalg.norm(dense - point, axis=1).min() - 1e-4
        contained = (
            np.linalg.norm(points, axis=1) < 0.0099
            if number == 0
            else np.hypot(np.hypot(*points.T[:2]) - 0.02, points[:, 2]) < 0.0055
        )
        assert (gap[contained] < 0).all()


def test_faces_that_meet_in_a_hollow_edge_are_rows_of_their_own(tmp_path):
    import trimesh

    prism = trimesh.creation.cylinder(20.0, 200.0, sections=8)
    outside = scene(tmp_path, meshes=[{"file": written(tmp_path, prism)}])
    lumen = scene(tmp_path, meshes=[{"file": written(tmp_path, prism), "side": "inside"}])
    assert len(outside.arrays.kind) == 1, "no edge of a prism is hollow from outside"
    assert set(lumen.arrays.obstacle) == {0} and len(lumen.arrays.kind) > 1
    # Half way between two faces, 1 mm from each: two rows are near, with the normals of the faces.
    half = np.pi / 8
    for turn in 2 * half * np.arange(8):
        middle = 1e-3 * (20.0 * np.cos(half) - 1.0) / np.cos(half)
        point = middle * np.array([np.cos(turn), np.sin(turn), 0.0])
        normal = np.empty((len(lumen.arrays.kind), 3))
        gap = np.array([gap_to(lumen.arrays, k, point, normal[k]) for k in range(len(normal))])
        near = np.flatnonzero(gap < 1.001e-3)
        assert len(near) == 2 and gap[near] == pytest.approx([1e-3, 1e-3])
        between = np.arccos(normal[near[0]] @ normal[near[1]])
        assert between == pytest.approx(2 * half)
    points = np.random.default_rng(2).uniform(-0.025, 0.025, (200, 3))
    assert lumen.nearest(points)[0] == pytest.approx(-outside.nearest(points)[0])


def test_faces_that_meet_in_a_hollow_corner_are_rows_of_their_own(tmp_path):
    """Faces on opposite sides of a corner of an octahedron have no edge in common; a section in the corner touches them all."""
    import trimesh

    corners = 0.02 * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    body = trimesh.convex.convex_hull(trimesh.PointCloud(corners))
    outside = scene(tmp_path, meshes=[{"file": written(tmp_path, body), "file_unit_mm": 1000}])
    hollow = scene(tmp_path, meshes=[{"file": written(tmp_path, body), "file_unit_mm": 1000, "side": "inside"}])
    assert len(outside.arrays.kind) == 1, "no corner of an octahedron is hollow from outside"
    for corner in corners:
        point, normal = corner * (1.0 - 1e-3 * np.sqrt(3.0) / 0.02), np.empty((len(hollow.arrays.kind), 3))
        gap = np.array([gap_to(hollow.arrays, k, point, normal[k]) for k in range(len(normal))])
        near = np.flatnonzero(gap < 1.001e-3)
        assert len(near) == 4 and gap[near] == pytest.approx(4 * [1e-3])
        assert len(np.unique(np.sign(normal[near]), axis=0)) == 4


def test_obstacles_in_the_world_keep_their_place_when_the_robot_turns():
    table = scene(planes=[{"normal": [0, 0, 1], "point_mm": [0, 0, -50], "frame": "world"}])
    point = np.array([[-0.03, 0.0, 0.1]])
    assert table.nearest(point)[0] == pytest.approx([0.02])  # the robot is horizontal, x of soft_base points up
    hanging = table.under_gravity(np.array([0.0, 0.0, 9.81]))  # z of soft_base points down: the table is 50 mm below the base
    assert table.nearest(np.array([[0.0, 0.0, 0.04]]), hanging)[0] == pytest.approx([0.01])
    assert table.nearest(point)[0] == pytest.approx([0.02])  # what others have of the scene stays
    for gravity in np.random.default_rng(0).standard_normal((5, 3)):
        rotation = world_rotation(gravity)
        assert rotation @ gravity == pytest.approx([0, 0, -np.linalg.norm(gravity)], abs=1e-12)
        assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-12)


@pytest.mark.parametrize(
    ("kinds", "message"),
    [
        ({"planes": [{"friction": -0.1}]}, "friction is -0.1; allowed: 0 to 10"),
        ({"planes": [{"normal": [0, 0, 0]}]}, "normal is .0, 0, 0."),
        ({"tubes": [{"points_mm": [[0, 0, 0]], "radius_mm": [1]}]}, "at least 2"),
        ({"tubes": [{"points_mm": [[0, 0, 0], [0, 0, 1]], "radius_mm": [1, 2, 3]}]}, r"as many as points_mm \(2\)"),
        ({"tubes": [{"points_mm": [[0, 0, 0]], "radius_mm": 4}]}, "points_mm: 1 given; at least 2"),
        ({"meshes": [{"file": "missing.stl"}]}, "missing.stl: does not exist"),
        ({"meshes": [{"file": "wall.step"}]}, "allowed formats: .stl"),
        ({"cylinders": []}, "unknown key 'scene.cylinders'"),
    ],
)
def test_a_wrong_scene_is_refused_with_its_key(tmp_path, kinds, message):
    with pytest.raises(ConfigError, match=message):
        scene(tmp_path, **kinds)


def test_a_surface_is_checked(tmp_path, ball):
    opened = ball.copy()
    opened.update_faces(np.arange(len(ball.faces)) > 200)
    with pytest.raises(ConfigError, match=r"scene\.meshes \('mesh 1'\).*not closed"):
        scene(tmp_path, meshes=[{"file": written(tmp_path, opened)}])
    turned = ball.copy()
    turned.invert()
    repaired = scene(tmp_path, meshes=[{"file": written(tmp_path, turned)}])
    assert repaired.nearest(np.zeros((1, 3)))[0] < 0
    assert "faced inward" in repaired.notes[0]


def test_a_surface_in_metres_is_named(tmp_path, ball):
    name = written(tmp_path, ball.apply_scale(1e-3))
    document = load_robot_file("article").sections | {"scene": {"meshes": [{"file": name}]}}
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump(document), encoding="utf-8")
    with pytest.raises(ConfigError, match="file_unit_mm: 1000"):
        _ = load_robot_file(tmp_path / "robot.yaml").scene
