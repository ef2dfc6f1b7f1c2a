import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from hgs_core.geometry.polygons import area_m2, contains, crossing_edges, distance_m

SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
points = arrays(np.float64, (20, 2), elements=st.floats(-4, 4))


@st.composite
def stars(draw: st.DrawFn) -> np.ndarray:
    """Outlines that the origin sees all of: simple, and rarely convex."""
    n = draw(st.integers(3, 12))
    angles = np.arange(n) * 2 * np.pi / n
    radii = np.array(draw(st.lists(st.floats(0.5, 3.0), min_size=n, max_size=n)))
    return np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)


def test_a_square_by_hand() -> None:
    asked = np.array([[1.0, 1.0], [3.0, 1.0], [3.0, 3.0], [-0.5, 0.5]])
    np.testing.assert_array_equal(contains(SQUARE, asked), [True, False, False, False])
    np.testing.assert_allclose(distance_m(SQUARE, asked), [0.0, 1.0, np.sqrt(2.0), 0.5])
    assert area_m2(SQUARE) == pytest.approx(4.0)


@settings(deadline=None, max_examples=50)
@given(outline=stars(), asked=points)
def test_which_way_round_and_where_it_begins_change_nothing(outline: np.ndarray, asked: np.ndarray) -> None:
    expected = distance_m(outline, asked)
    np.testing.assert_allclose(distance_m(outline[::-1], asked), expected, atol=1e-9)
    np.testing.assert_allclose(distance_m(np.roll(outline, 1, axis=0), asked), expected, atol=1e-9)
    assert area_m2(outline) == pytest.approx(area_m2(outline[::-1]))


@settings(deadline=None, max_examples=50)
@given(outline=stars(), asked=points, shares=st.lists(st.floats(0, 0.999), min_size=3, max_size=3))
def test_inside_is_what_the_triangles_about_the_middle_hold(
    outline: np.ndarray, asked: np.ndarray, shares: list[float]
) -> None:
    assert crossing_edges(outline) is None
    for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        weights = np.array(shares) / max(sum(shares), 1.0)
        inner = 0.99 * (weights[0] * a + weights[1] * b)
        assert contains(outline, inner[None])[0]
    # Going straight to a point outside leaves the outline: no point is nearer than the distance says.
    away = distance_m(outline, asked)
    corners = np.linalg.norm(asked[:, None] - outline[None], axis=2).min(axis=1)
    assert np.all(away <= corners + 1e-9)
    np.testing.assert_array_equal(away[contains(outline, asked)], 0.0)


def test_outlines_that_cross_themselves_are_found() -> None:
    assert crossing_edges(np.array([[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0]])) == (0, 2)
    touching = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 0.0], [0.0, 2.0]])
    assert crossing_edges(touching) is None
