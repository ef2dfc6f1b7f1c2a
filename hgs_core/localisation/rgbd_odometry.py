"""Visual odometry from colour and depth, by open3d's multi-scale alignment: each frame is aligned to a
keyframe (Steinbruecker et al. 2011; Park et al. 2017)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import open3d as o3d
from jaxtyping import Float, Float32
from numpy import ndarray
from pydantic import Field

from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3
from hgs_core.localisation.depth_agreement import DepthAgreement, depth_agreement
from hgs_core.localisation.localiser import LocalisationConfig, Located, Lost
from hgs_core.localisation.motion import MotionLimits, StampedPose, flaw
from hgs_core.sensing.point_scan import PointScan
from hgs_core.sensing.raw_frame import AlignedFrame

_odometry = o3d.t.pipelines.odometry
_PIXEL_CENTRE: Final = 0.5
"""open3d counts pixel coordinates from the centre of the first pixel."""
_COARSE: Final = (20, 10, 6)
_FINE: Final = (10, 6)
"""Iterations at each scale of the pyramid, the smallest image first."""


class RgbdOdometryConfig(LocalisationConfig):
    """Aligns depth to depth first, which finds its way from far; then colours too, which hold where surfaces
    are flat. Frames should come at 5 Hz or more."""

    method: Literal["rgbd-odometry"] = "rgbd-odometry"
    residual: Literal["hybrid", "point-to-plane"] = "hybrid"
    """`point-to-plane` leaves the colours out: for cameras whose colour is not well registered to depth, and
    for changing light."""
    max_width_px: int = Field(320, ge=40)
    """Images are made smaller by a whole factor until they are at most this wide."""
    max_depth_m: float = Field(5.0, gt=0)
    """Farther depth is not used [m]."""
    min_overlap: float = Field(0.3, gt=0, le=1)
    """Share of the frame's depth that must fall on the keyframe's."""
    min_fitness: float = Field(0.8, gt=0, le=1)
    """Share of that overlap whose depths must agree, within 3 cm + 2 %. Right alignments reach 0.93 in a
    simulated house and 0.85 with a Kinect, wrong ones seldom 0.8."""
    max_inlier_rmse_m: float = Field(0.04, gt=0)
    """Largest root mean square difference of the depths that agree [m]."""
    keyframe_overlap: float = Field(0.75, gt=0, le=1)
    """A frame that overlaps the keyframe less than this becomes the next one."""
    keyframe_distance_m: float = Field(0.25, gt=0)
    """A frame farther from the keyframe [m] becomes the next one, too: where a camera drives straight ahead,
    all of the image overlaps, and less and less of it agrees."""
    search_turns_deg: tuple[float, ...] = (4, -4, 8, -8, 12, -12, 16, -16, 20, -20, 24, -24)
    """Turns about the vertical that the robot may have made since the last frame: tried beside steady motion
    and standing still, those first whose depths agree best."""
    search_steps_m: tuple[float, ...] = (0.1, 0.2, 0.3, -0.1, -0.2)
    """Ways straight ahead that are tried likewise."""
    max_tries: int = Field(3, ge=1)
    """So many of these are aligned before the frame is lost."""
    limits: MotionLimits = MotionLimits()


_GATE_M: Final = 0.03
_GATE_SLOPE: Final = 0.02
_SEARCH_GATE_M: Final = 0.1
"""Depths that differ less are good enough for a guess."""
_SEARCH_STRIDE: Final = 4
_SEARCHED_S: Final = 1.0
"""However long a camera was lost, it is looked for only where it can have come in so long: farther off,
places that look alike would be taken for each other."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _View:
    """A frame made smaller, as open3d takes it."""

    rgbd: o3d.t.geometry.RGBDImage
    depth_m: Float32[ndarray, "height width"]
    camera: CameraIntrinsics


@dataclass(frozen=True, kw_only=True, eq=False)
class _Keyframe:
    view: _View
    T_world_camera: SE3


@dataclass(frozen=True, kw_only=True, eq=False)
class _Alignment:
    T_world_camera: SE3
    agreement: DepthAgreement
    wrong: str | None
    """Why it is not believed."""


class RgbdOdometry:
    """Implements `Localiser`. The first frame stands at `start`; from there errors add up (drift).

    The same frames give the same poses up to rounding: open3d sums over its threads in any order.
    """

    def __init__(self, config: RgbdOdometryConfig, start: SE3) -> None:
        self._config = config
        self._start = start
        self._keyframe: _Keyframe | None = None
        self._last: StampedPose | None = None
        self._twist_per_s: Float[ndarray, " 6"] = np.zeros(6)

    def take_scan(self, scan: PointScan) -> None:
        """Scans pass."""

    def locate(self, frame: AlignedFrame) -> Located | Lost:
        view = self._view(frame)
        if not (view.depth_m > 0).any():
            return Lost(reason=f"frame {frame.sequence} has no depth within {self._config.max_depth_m} m")
        if self._keyframe is None or self._last is None:
            return self._settle(frame, view, self._start)
        passed_s = frame.timestamp_s - self._last.timestamp_s
        if passed_s <= 0:
            return Lost(
                reason=f"frame {frame.sequence}: its time {frame.timestamp_s:.3f} s is not after "
                f"{self._last.timestamp_s:.3f} s"
            )
        reasons = []
        for guess in self._guesses(view, self._keyframe, self._last.pose, passed_s):
            alignment = self._aligned(view, self._keyframe, guess, self._last, passed_s)
            if alignment.wrong is None:
                step = self._last.pose.inverse() @ alignment.T_world_camera
                self._twist_per_s = step.log() / passed_s
                if self._is_near(alignment):
                    self._last = StampedPose(pose=alignment.T_world_camera, timestamp_s=frame.timestamp_s)
                    return Located(T_world_camera=alignment.T_world_camera)
                return self._settle(frame, view, alignment.T_world_camera)
            reasons.append(alignment.wrong)
        self._twist_per_s = np.zeros(6)
        return Lost(reason=f"frame {frame.sequence} fits nowhere near the last one: {reasons[0]}")

    def _is_near(self, alignment: _Alignment) -> bool:
        """Whether the keyframe will do for the next frame, too."""
        if self._keyframe is None:
            return False
        apart = alignment.T_world_camera.translation - self._keyframe.T_world_camera.translation
        return (
            alignment.agreement.overlap >= self._config.keyframe_overlap
            and float(np.linalg.norm(apart)) < self._config.keyframe_distance_m
        )

    def _settle(self, frame: AlignedFrame, view: _View, pose: SE3) -> Located:
        """Take the frame as the next keyframe."""
        self._keyframe = _Keyframe(view=view, T_world_camera=pose)
        self._last = StampedPose(pose=pose, timestamp_s=frame.timestamp_s)
        return Located(T_world_camera=pose)

    def _guesses(self, view: _View, keyframe: _Keyframe, last: SE3, passed_s: float) -> list[SE3]:
        """Poses to align from, the likeliest first."""
        guesses = [last @ SE3.exp(self._twist_per_s * min(passed_s, _SEARCHED_S)), last]
        for turn_deg in self._config.search_turns_deg:
            turn = SE3.exp(np.array([0.0, 0.0, 0.0, 0.0, 0.0, np.radians(turn_deg)]))
            guesses.append(SE3(rotation=turn.rotation @ last.rotation, translation=last.translation))
        for step_m in self._config.search_steps_m:
            guesses.append(last @ SE3.exp(np.array([0.0, 0.0, step_m, 0.0, 0.0, 0.0])))
        few, camera = _every(view.depth_m, view.camera, _SEARCH_STRIDE)

        def agreeing(guess: SE3) -> float:
            found = depth_agreement(
                few,
                keyframe.view.depth_m,
                camera,
                keyframe.T_world_camera.inverse() @ guess,
                other_camera=keyframe.view.camera,
                gate_m=_SEARCH_GATE_M,
                gate_slope=_GATE_SLOPE,
            )
            return found.overlap * found.fitness

        return sorted(guesses, key=agreeing, reverse=True)[: self._config.max_tries]

    def _aligned(
        self, view: _View, keyframe: _Keyframe, guess: SE3, last: StampedPose, passed_s: float
    ) -> _Alignment:
        config = self._config
        T_key_camera = keyframe.T_world_camera.inverse() @ guess
        stages: list[tuple[_odometry.Method, tuple[int, ...]]] = [(_odometry.Method.PointToPlane, _COARSE)]
        if config.residual == "hybrid":
            stages.append((_odometry.Method.Hybrid, _FINE))
        try:
            for method, iterations in stages:
                T_key_camera = self._align(view, keyframe.view, T_key_camera, method, iterations)
        except RuntimeError as error:  # open3d's word for "too few pixels fit to solve for six numbers"
            nothing = DepthAgreement(overlap=0.0, fitness=0.0, inlier_rmse_m=0.0)
            first_line = str(error).strip().splitlines()[-1]
            return _Alignment(T_world_camera=guess, agreement=nothing, wrong=f"no alignment ({first_line})")
        agreement = depth_agreement(
            view.depth_m,
            keyframe.view.depth_m,
            view.camera,
            T_key_camera,
            other_camera=keyframe.view.camera,
            gate_m=_GATE_M,
            gate_slope=_GATE_SLOPE,
        )
        pose = keyframe.T_world_camera @ T_key_camera
        wrong = (
            flaw(pose)
            or self._doubt(agreement)
            or config.limits.violation(last.pose, pose, min(passed_s, _SEARCHED_S))
        )
        return _Alignment(T_world_camera=pose, agreement=agreement, wrong=wrong)

    def _align(
        self,
        view: _View,
        target: _View,
        guess: SE3,
        method: _odometry.Method,
        iterations: tuple[int, ...],
    ) -> SE3:
        camera = view.camera
        matrix = np.array(
            [
                [camera.fx, 0.0, camera.cx - _PIXEL_CENTRE],
                [0.0, camera.fy, camera.cy - _PIXEL_CENTRE],
                [0.0, 0.0, 1.0],
            ]
        )
        found = _odometry.rgbd_odometry_multi_scale(
            view.rgbd,
            target.rgbd,
            o3d.core.Tensor.from_numpy(matrix),
            o3d.core.Tensor.from_numpy(guess.as_matrix()),
            1.0,
            self._config.max_depth_m,
            [_odometry.OdometryConvergenceCriteria(n) for n in iterations],
            method,
        )
        T = found.transformation.numpy()
        return SE3(rotation=_orthonormal(T[:3, :3]), translation=T[:3, 3].copy())

    def _doubt(self, agreement: DepthAgreement) -> str | None:
        config = self._config
        if agreement.overlap < config.min_overlap:
            return (
                f"overlap with the keyframe {agreement.overlap:.2f}, at least {config.min_overlap} is needed"
            )
        if agreement.fitness < config.min_fitness:
            return f"fitness {agreement.fitness:.2f}, at least {config.min_fitness} is needed"
        if agreement.inlier_rmse_m > config.max_inlier_rmse_m:
            return (
                f"depths differ by {agreement.inlier_rmse_m:.3f} m (rms), at most "
                f"{config.max_inlier_rmse_m} m is believed"
            )
        return None

    def _view(self, frame: AlignedFrame) -> _View:
        """Colours averaged over blocks of pixels, depth of one pixel of each."""
        size = -(-frame.intrinsics.width // self._config.max_width_px)
        height, width = frame.rgb.shape[0] // size, frame.rgb.shape[1] // size
        blocks = frame.rgb[: height * size, : width * size].reshape(height, size, width, size, 3)
        rgb = blocks.mean(axis=(1, 3), dtype=np.float32).astype(np.uint8)
        middle = size // 2
        depth = frame.depth_m[middle : height * size : size, middle : width * size : size]
        near = np.where(depth <= self._config.max_depth_m, depth, np.float32(0.0)).astype(np.float32)
        full = frame.intrinsics
        # The pixel whose depth is taken is the block's middle one: its centre is where the ray goes through.
        aside = (middle + 0.5) / size - 0.5
        camera = CameraIntrinsics(
            width=width,
            height=height,
            fx=full.fx / size,
            fy=full.fy / size,
            cx=full.cx / size - aside,
            cy=full.cy / size - aside,
        )
        near = np.ascontiguousarray(near)
        return _View(
            rgbd=o3d.t.geometry.RGBDImage(
                o3d.t.geometry.Image(o3d.core.Tensor.from_numpy(rgb)),
                o3d.t.geometry.Image(o3d.core.Tensor.from_numpy(near)),
            ),
            depth_m=near,
            camera=camera,
        )


def _every(
    depth_m: Float32[ndarray, "height width"], camera: CameraIntrinsics, stride: int
) -> tuple[Float32[ndarray, "rows columns"], CameraIntrinsics]:
    """Every `stride`-th pixel, and the camera that sees just these rays."""
    few = np.ascontiguousarray(depth_m[::stride, ::stride])
    aside = 0.5 - 0.5 / stride
    return few, CameraIntrinsics(
        width=few.shape[1],
        height=few.shape[0],
        fx=camera.fx / stride,
        fy=camera.fy / stride,
        cx=camera.cx / stride + aside,
        cy=camera.cy / stride + aside,
    )


def _orthonormal(rotation: Float[ndarray, "3 3"]) -> Float[ndarray, "3 3"]:
    """The rotation nearest to a matrix that is one but for rounding."""
    u, _, vt = np.linalg.svd(rotation)
    return u @ vt
