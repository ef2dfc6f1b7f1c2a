"""Rigid transforms.

Parameter order: a twist is `(v_x, v_y, v_z, w_x, w_y, w_z)`, translation first; quaternions are `wxyz`.
`p_world = T_world_camera @ p_camera`. All operations accept leading batch axes, and broadcast them.
Source of the closed forms: Barfoot, "State Estimation for Robotics", section 7.1 (left Jacobian of SO(3)).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial.transform import Rotation

from hgs_core.errors import SensorError


@dataclass(frozen=True, kw_only=True, eq=False)
class SE3:
    """A rotation followed by a translation, batched over leading axes."""

    rotation: Float[ndarray, "*batch 3 3"]
    translation: Float[ndarray, "*batch 3"]

    @staticmethod
    def identity() -> SE3:
        return SE3(rotation=np.eye(3), translation=np.zeros(3))

    @staticmethod
    def from_matrix(matrix: Float[ndarray, "*batch 4 4"]) -> SE3:
        """Raises `SensorError` for a matrix that is not a rigid transform within 1e-3."""
        rotation = matrix[..., :3, :3]
        gram_error = np.abs(np.swapaxes(rotation, -1, -2) @ rotation - np.eye(3))
        row_error = np.abs(matrix[..., 3, :] - np.array([0.0, 0.0, 0.0, 1.0]))
        # Written so that NaN fails, too.
        if not (
            np.all(gram_error < 1e-3) and np.all(np.linalg.det(rotation) > 0) and np.all(row_error < 1e-3)
        ):
            raise SensorError(
                f"not a rigid transform: {matrix.tolist()}; expected [R t; 0 0 0 1] with R a rotation "
                "(orthonormal, determinant +1)"
            )
        return SE3(rotation=rotation, translation=matrix[..., :3, 3])

    @staticmethod
    def from_quaternion_wxyz(
        quaternion: Float[ndarray, "*batch 4"], translation: Float[ndarray, "*batch 3"]
    ) -> SE3:
        """Raises `SensorError` for a quaternion whose norm is not 1 within 1e-3."""
        norm = np.linalg.norm(quaternion, axis=-1)
        if not np.all(np.abs(norm - 1.0) < 1e-3):
            raise SensorError(f"quaternion wxyz has norm {norm}, expected 1: normalise it first")
        rotation = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()
        return SE3(rotation=rotation, translation=np.asarray(translation, dtype=float))

    @staticmethod
    def exp(twist: Float[ndarray, "*batch 6"]) -> SE3:
        """The rigid motion of a unit time at constant `twist` [m, rad]."""
        omega = twist[..., 3:]
        angle = np.linalg.norm(omega, axis=-1)[..., None, None]
        hat = _hat(omega)
        # b = (1 - cos a) / a^2 without its cancellation near 0 (np.sinc(x) = sin(pi x) / (pi x)).
        b = 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2
        # c = (a - sin a) / a^3; below 0.01 the series is exact to double precision.
        small = angle < 1e-2
        safe = np.where(small, 1.0, angle)
        series = 1.0 / 6.0 - angle**2 / 120.0 + angle**4 / 5040.0
        c = np.where(small, series, (safe - np.sin(safe)) / safe**3)
        left_jacobian = np.eye(3) + b * hat + c * (hat @ hat)
        translation = (left_jacobian @ twist[..., :3, None])[..., 0]
        flat = Rotation.from_rotvec(omega.reshape(-1, 3)).as_matrix()
        return SE3(rotation=flat.reshape(*omega.shape[:-1], 3, 3), translation=translation)

    def log(self) -> Float[ndarray, "*batch 6"]:
        """The twist whose `exp` is this transform; rotation angle in [0, pi].

        At exactly pi the axis's sign is arbitrary; `exp` gives the same transform for both.
        """
        flat = Rotation.from_matrix(self.rotation.reshape(-1, 3, 3)).as_rotvec()
        omega = flat.reshape(*self.rotation.shape[:-2], 3)
        angle = np.linalg.norm(omega, axis=-1)[..., None, None]
        hat = _hat(omega)
        # d = (1 - (a/2) cot(a/2)) / a^2; below 0.01 the series is exact to double precision.
        small = angle < 1e-2
        safe = np.where(small, 1.0, angle)
        half = safe / 2.0
        series = 1.0 / 12.0 + angle**2 / 720.0 + angle**4 / 30240.0
        d = np.where(small, series, (1.0 - half / np.tan(half)) / safe**2)
        inverse_jacobian = np.eye(3) - 0.5 * hat + d * (hat @ hat)
        v = (inverse_jacobian @ self.translation[..., None])[..., 0]
        return np.concatenate([v, omega], axis=-1)

    def __getitem__(self, index: int | np.integer[Any] | slice) -> SE3:
        """One pose of a batch, or some of them, along its first axis."""
        return SE3(rotation=self.rotation[index], translation=self.translation[index])

    def inverse(self) -> SE3:
        transposed = np.swapaxes(self.rotation, -1, -2)
        return SE3(rotation=transposed, translation=-(transposed @ self.translation[..., None])[..., 0])

    def __matmul__(self, other: SE3) -> SE3:
        return SE3(
            rotation=self.rotation @ other.rotation,
            translation=(self.rotation @ other.translation[..., None])[..., 0] + self.translation,
        )

    def apply(self, points: Float[ndarray, "*points 3"]) -> Float[ndarray, "*points 3"]:
        """Points [m] moved by one (unbatched) transform."""
        return points @ self.rotation.T + self.translation

    def as_matrix(self) -> Float[ndarray, "*batch 4 4"]:
        matrix = np.zeros((*self.rotation.shape[:-2], 4, 4))
        matrix[..., :3, :3] = self.rotation
        matrix[..., :3, 3] = self.translation
        matrix[..., 3, 3] = 1.0
        return matrix

    def as_quaternion_wxyz(self) -> Float[ndarray, "*batch 4"]:
        flat = Rotation.from_matrix(self.rotation.reshape(-1, 3, 3)).as_quat(scalar_first=True)
        return flat.reshape(*self.rotation.shape[:-2], 4)


def _hat(omega: Float[ndarray, "*batch 3"]) -> Float[ndarray, "*batch 3 3"]:
    x, y, z = omega[..., 0], omega[..., 1], omega[..., 2]
    zero = np.zeros_like(x)
    return np.stack(
        [
            np.stack([zero, -z, y], axis=-1),
            np.stack([z, zero, -x], axis=-1),
            np.stack([-y, x, zero], axis=-1),
        ],
        axis=-2,
    )
