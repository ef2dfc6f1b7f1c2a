"""Annotations are checked while tests run, and only there."""

import subprocess
import sys

import numpy as np
import pytest
from jaxtyping import TypeCheckError

from hgs_core.config.base import StrictConfig
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3


def test_a_wrong_shape_is_refused() -> None:
    camera = CameraIntrinsics.centred(4, 3, 2.0)
    with pytest.raises(TypeCheckError):
        camera.project(np.zeros((5, 2)))


def test_a_wrong_field_of_a_dataclass_is_refused() -> None:
    with pytest.raises(TypeCheckError):
        SE3(rotation=np.eye(3), translation=np.zeros(4))


def test_axes_of_one_call_must_agree() -> None:
    with pytest.raises(TypeCheckError):
        SE3(rotation=np.zeros((2, 3, 3)), translation=np.zeros((5, 3)))


def test_configs_keep_working_under_the_checks() -> None:
    class Example(StrictConfig):
        range_m: float = 5.0

    assert Example(range_m=3).range_m == 3.0


def test_a_spawned_process_is_not_checked() -> None:
    program = (
        "import numpy as np\n"
        "from hgs_core.geometry.se3 import SE3\n"
        "SE3(rotation=np.eye(3), translation=np.zeros(4))\n"
        "print('unchecked')"
    )
    answer = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert answer.stdout == "unchecked\n"


def test_an_int_may_stand_for_a_float() -> None:
    assert CameraIntrinsics.centred(4, 3, 2).fx == 2
