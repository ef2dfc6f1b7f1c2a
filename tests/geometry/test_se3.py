"""Laws of the group of rigid transforms, then cases small enough to solve by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy import ndarray

from hgs_core.errors import SensorError
from hgs_core.geometry.se3 import SE3

_COMPONENT = st.floats(-10, 10, allow_nan=False, width=64)


@st.composite
def twists(draw: st.DrawFn, batch: tuple[int, ...] = ()) -> ndarray:
    """Twists with rotation angles over [0, pi), crowded at both ends, where the closed forms are delicate."""
    axis = draw(arrays(float, (*batch, 3), elements=st.floats(-1, 1, width=64)))
    norm = np.linalg.norm(axis, axis=-1, keepdims=True)
    axis = np.where(norm > 1e-3, axis / np.where(norm > 1e-3, norm, 1.0), np.array([0.0, 0.0, 1.0]))
    angle = draw(
        st.one_of(
            st.floats(0, np.pi - 1e-6),
            st.floats(-14, -1).map(lambda exponent: 10.0**exponent),
            st.floats(-6, -1).map(lambda exponent: np.pi - 10.0**exponent),
        )
    )
    linear = draw(arrays(float, (*batch, 3), elements=_COMPONENT))
    return np.concatenate([linear, axis * angle], axis=-1)


def transforms(batch: tuple[int, ...] = ()) -> st.SearchStrategy[SE3]:
    return twists(batch).map(SE3.exp)


def assert_same(left: SE3, right: SE3, atol: float = 1e-9) -> None:
    np.testing.assert_allclose(left.rotation, right.rotation, atol=atol)
    np.testing.assert_allclose(left.translation, right.translation, atol=atol * 100)


@given(twists())
def test_log_undoes_exp(twist: ndarray) -> None:
    # Near pi the angle is known to sqrt(eps) at worst: the rotation's entries are stationary there.
    np.testing.assert_allclose(SE3.exp(twist).log(), twist, atol=2e-7)


@given(transforms())
def test_exp_undoes_log(transform: SE3) -> None:
    assert_same(SE3.exp(transform.log()), transform, atol=1e-7)


@given(transforms())
def test_inverse_is_the_inverse_on_both_sides(transform: SE3) -> None:
    assert_same(transform @ transform.inverse(), SE3.identity())
    assert_same(transform.inverse() @ transform, SE3.identity())


@given(transforms(), transforms(), transforms())
def test_composition_is_associative(a: SE3, b: SE3, c: SE3) -> None:
    assert_same((a @ b) @ c, a @ (b @ c))


@given(transforms())
def test_identity_is_neutral(transform: SE3) -> None:
    assert_same(transform @ SE3.identity(), transform)
    assert_same(SE3.identity() @ transform, transform)


@given(transforms(), transforms(), arrays(float, (4, 3), elements=_COMPONENT))
def test_applying_a_product_is_applying_one_after_the_other(a: SE3, b: SE3, points: ndarray) -> None:
    np.testing.assert_allclose((a @ b).apply(points), a.apply(b.apply(points)), atol=1e-9)


@given(twists())
def test_inverse_negates_the_twist(twist: ndarray) -> None:
    assert_same(SE3.exp(twist).inverse(), SE3.exp(-twist))


@given(transforms(batch=(3, 2)))
def test_rotations_are_orthonormal_and_right_handed(transforms: SE3) -> None:
    gram = np.swapaxes(transforms.rotation, -1, -2) @ transforms.rotation
    np.testing.assert_allclose(gram, np.broadcast_to(np.eye(3), gram.shape), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(transforms.rotation), 1.0)


@given(twists(batch=(3, 2)))
def test_a_batch_is_its_members(twist: ndarray) -> None:
    batch = SE3.exp(twist)
    products = batch @ batch.inverse() @ batch
    for index in np.ndindex(3, 2):
        one = SE3.exp(twist[index])
        np.testing.assert_allclose(batch.rotation[index], one.rotation, atol=1e-14)
        np.testing.assert_allclose(batch.translation[index], one.translation, atol=1e-12)
        np.testing.assert_allclose(batch.log()[index], one.log(), atol=1e-7)
        np.testing.assert_allclose(batch.as_matrix()[index], one.as_matrix(), atol=1e-12)
        np.testing.assert_allclose(products.translation[index], one.translation, atol=1e-9)


@given(transforms(), transforms(batch=(4,)))
def test_a_single_transform_composes_with_a_batch(one: SE3, batch: SE3) -> None:
    after, before = one @ batch, batch @ one
    for i in range(4):
        member = SE3(rotation=batch.rotation[i], translation=batch.translation[i])
        np.testing.assert_allclose(after.as_matrix()[i], (one @ member).as_matrix(), atol=1e-12)
        np.testing.assert_allclose(before.as_matrix()[i], (member @ one).as_matrix(), atol=1e-12)


@given(transforms(batch=(2,)))
def test_matrices_and_quaternions_carry_everything(transforms: SE3) -> None:
    assert_same(SE3.from_matrix(transforms.as_matrix()), transforms)
    assert_same(SE3.from_quaternion_wxyz(transforms.as_quaternion_wxyz(), transforms.translation), transforms)


@given(twists())
def test_exp_matches_the_power_series(twist: ndarray) -> None:
    x, y, z = twist[3:]
    generator = np.zeros((4, 4))
    generator[:3, :3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
    generator[:3, 3] = twist[:3]
    series, term = np.eye(4), np.eye(4)
    for k in range(1, 40):
        term = term @ generator / k
        series += term
    np.testing.assert_allclose(SE3.exp(twist).as_matrix(), series, atol=1e-10)


@pytest.mark.parametrize("axis", np.vstack([np.eye(3), -np.eye(3), np.full((1, 3), 3**-0.5)]))
def test_log_of_half_a_turn(axis: ndarray) -> None:
    rotation = 2 * np.outer(axis, axis) - np.eye(3)  # Rodrigues' formula at pi
    twist = SE3(rotation=rotation, translation=np.array([1.0, 2.0, 3.0])).log()
    assert np.linalg.norm(twist[3:]) == pytest.approx(np.pi)
    np.testing.assert_allclose(np.abs(twist[3:] @ axis), np.pi, atol=1e-9)
    np.testing.assert_allclose(SE3.exp(twist).translation, [1.0, 2.0, 3.0], atol=1e-9)


def test_a_quarter_turn_of_driving_is_a_quarter_circle() -> None:
    # Forward at pi/2 while turning left at pi/2: radius 1, so it ends at (1, 1) facing +y.
    pose = SE3.exp(np.array([np.pi / 2, 0, 0, 0, 0, np.pi / 2]))
    np.testing.assert_allclose(pose.translation, [1, 1, 0], atol=1e-15)
    np.testing.assert_allclose(pose.apply(np.array([1.0, 0, 0])), [1, 2, 0], atol=1e-15)


def test_quaternions_are_wxyz() -> None:
    half_turn_about_z = SE3.from_quaternion_wxyz(np.array([0.0, 0, 0, 1]), np.zeros(3))
    np.testing.assert_allclose(half_turn_about_z.rotation, np.diag([-1.0, -1, 1]), atol=1e-15)


def test_a_quaternion_of_another_length_is_refused() -> None:
    with pytest.raises(SensorError, match="normalise"):
        SE3.from_quaternion_wxyz(np.array([2.0, 0, 0, 0]), np.zeros(3))


@pytest.mark.parametrize(
    "matrix",
    [
        np.diag([2.0, 1, 1, 1]),
        np.diag([1.0, 1, -1, 1]),
        np.full((4, 4), np.nan),
        np.vstack([np.eye(4)[:3], [[0.0, 0, 1, 1]]]),
    ],
    ids=["scaled", "mirrored", "nan", "projective"],
)
def test_a_matrix_that_is_no_rigid_transform_is_refused(matrix: ndarray) -> None:
    with pytest.raises(SensorError, match="rigid"):
        SE3.from_matrix(matrix)
