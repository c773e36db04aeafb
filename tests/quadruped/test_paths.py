"""Paths: corners, spacing, headings, and the law that every leg is cut evenly."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cpl.quadruped.paths import Path, hexagon, polyline, rectangle, shape, triangle, zigzag


def test_rectangle_by_hand():
    path = rectangle(1.0, 0.5, spacing_m=0.5)
    expected = [
        [-0.5, -0.25, 0.0],
        [0.0, -0.25, 0.0],
        [0.5, -0.25, 0.0],
        [0.5, 0.25, np.pi / 2],
        [0.0, 0.25, np.pi],
        [-0.5, 0.25, np.pi],
        [-0.5, -0.25, -np.pi / 2],
    ]
    np.testing.assert_allclose(path.waypoints, expected, atol=1e-12)


@pytest.mark.parametrize("path", [triangle(), rectangle(), hexagon()], ids=lambda path: path.name)
def test_shapes_are_closed_and_centred(path):
    np.testing.assert_array_equal(path.waypoints[0, :2], path.waypoints[-1, :2])
    assert np.abs(path.waypoints[:, :2]).max() < 2.0
    assert shape(path.name).length_m == path.length_m


def test_polygons_have_the_stated_side():
    assert triangle(2.0).length_m == pytest.approx(6.0)
    assert hexagon(2.0).length_m == pytest.approx(12.0)
    corner = triangle(2.0, spacing_m=2.0).waypoints[:3, :2]
    assert np.linalg.norm(corner[1] - corner[0]) == pytest.approx(2.0)


@given(
    st.lists(
        st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=2, max_size=6, unique=True
    ).filter(lambda v: min(np.linalg.norm(np.diff(v, axis=0), axis=1)) > 1e-3),
    st.floats(0.05, 3),
)
def test_no_two_waypoints_are_farther_apart_than_the_spacing(vertices, spacing_m):
    path = polyline(vertices, spacing_m=spacing_m)
    step = np.diff(path.waypoints[:, :2], axis=0)
    assert np.linalg.norm(step, axis=1).max() <= spacing_m * (1 + 1e-6)
    headings = np.arctan2(step[:, 1], step[:, 0])
    np.testing.assert_allclose(np.cos(path.waypoints[1:, 2] - headings), 1.0, atol=1e-6)
    np.testing.assert_allclose(path.waypoints[[0, -1], :2], [vertices[0], vertices[-1]], atol=1e-9)


def test_zigzag_stays_in_the_square_and_depends_on_its_stream_alone():
    path = zigzag(np.random.default_rng(3))
    assert np.abs(path.waypoints[:, :2]).max() <= 2.0
    assert path.start[:2] == (0.0, 0.0)
    np.testing.assert_array_equal(path.waypoints, zigzag(np.random.default_rng(3)).waypoints)


def test_one_keypoint_is_the_literal_line():
    headings = zigzag(np.random.default_rng(0), keypoints=1).waypoints[:, 2]
    assert len(set(headings.tolist())) == 1


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: polyline([(0, 0)]), r"vertices .* not \(1, 2\)"),
        (lambda: polyline([(0, 0), (0, 0)]), "vertices must differ"),
        (lambda: polyline([(0, 0), (1, 0)], spacing_m=0), "spacing_m .* not 0"),
        (lambda: triangle(-1), "side_m .* not -1"),
        (lambda: rectangle(1, 0), "width_m .* not 0"),
        (lambda: shape("star"), "name .* not 'star'"),
        (lambda: zigzag(np.random.default_rng(0), keypoints=0), "keypoints .* not 0"),
        (lambda: zigzag(np.random.default_rng(0), min_leg_m=9), "min_leg_m .* not 9"),
        (lambda: Path(name="x", waypoints=np.zeros((1, 3))), r"waypoints .* not \(1, 3\)"),
        (lambda: Path(name="x", waypoints=np.full((2, 3), np.nan)), "waypoints must be finite"),
    ],
)
def test_bad_arguments_are_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()
