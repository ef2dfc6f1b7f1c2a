"""States on disk: what is written comes back bit for bit, and what is not whole is never taken for whole."""

import math
from pathlib import Path

import numpy as np
import pytest

from hgs_core.errors import CheckpointError
from hgs_core.mission.state_file import StateWriter, read_state

STATE = {
    "none": None,
    "text": "ü \u2028",
    "flag": True,
    "large": 2**127 + 1,
    "float": 0.1 + 0.2,
    "odd": [math.inf, -math.inf, -0.0, 5e-324],
    "nested": {
        "rows": np.arange(12, dtype=np.float32).reshape(3, 4),
        "list": [{"a": np.float64(0.3)}, (1, 2)],
    },
    "empty": np.zeros((0, 3), np.int32),
    "flags": np.array([True, False]),
    "strided": np.arange(20)[::3],
}


def written(path: Path, state: dict, *, compressed: bool = False) -> Path:
    with path.open("wb") as file:
        writer = StateWriter(file, compressed=compressed)
        writer.write(state)
        writer.close()
    return path


@pytest.mark.parametrize("compressed", [False, True])
def test_a_state_comes_back_bit_for_bit(tmp_path: Path, compressed: bool) -> None:
    found = read_state(written(tmp_path / "a", STATE, compressed=compressed))
    for name in ("none", "text", "flag", "large", "float", "odd"):
        assert found[name] == STATE[name]
        assert type(found[name]) is type(STATE[name])
    assert math.copysign(1.0, found["odd"][2]) == -1.0
    rows = found["nested"]["rows"]
    assert rows.dtype == np.float32
    np.testing.assert_array_equal(rows, STATE["nested"]["rows"])
    assert found["nested"]["list"] == [{"a": 0.3}, [1, 2]]
    for name in ("empty", "flags", "strided"):
        assert found[name].dtype == STATE[name].dtype
        np.testing.assert_array_equal(found[name], STATE[name])
    again = written(tmp_path / "b", STATE, compressed=compressed)
    assert again.read_bytes() == (tmp_path / "a").read_bytes()


def test_a_file_cut_anywhere_is_refused(tmp_path: Path) -> None:
    whole = written(tmp_path / "whole", STATE).read_bytes()
    torn = tmp_path / "torn"
    for length in range(0, len(whole), 37):
        torn.write_bytes(whole[:length])
        with pytest.raises(CheckpointError, match="torn or damaged"):
            read_state(torn)


def test_a_changed_byte_of_content_is_found(tmp_path: Path) -> None:
    state = {"rows": np.arange(1000, dtype=np.float32), "name": "a" * 100}
    whole = written(tmp_path / "whole", state).read_bytes()
    damaged = tmp_path / "damaged"
    content = whole.index(np.arange(1000, dtype=np.float32).tobytes())
    for position in (whole.index(b"a" * 100) + 50, content, content + 3999):
        changed = bytearray(whole)
        changed[position] ^= 0x10
        damaged.write_bytes(changed)
        with pytest.raises(CheckpointError, match="torn or damaged"):
            read_state(damaged)


@pytest.mark.parametrize(
    "value", [object(), {1: 2}, {"array": 3}, np.array(["a"]), np.array([object()]), {"a": [b"x"]}]
)
def test_what_cannot_be_saved_is_refused_with_its_place(tmp_path: Path, value: object) -> None:
    with (tmp_path / "x").open("wb") as file:
        writer = StateWriter(file)
        with pytest.raises(CheckpointError, match=r"state\.planner"):
            writer.write({"planner": value})
        writer.abandon()


@pytest.mark.parametrize("compressed", [False, True])
def test_whatever_bytes_are_changed_it_is_read_or_refused(tmp_path: Path, compressed: bool) -> None:
    """A compressed part may no longer unpack, or claim to be encrypted: damage like any other."""
    whole = written(tmp_path / "whole", STATE, compressed=compressed).read_bytes()
    damaged, rng, refused = tmp_path / "damaged", np.random.default_rng(0), 0
    for _ in range(300):
        changed = bytearray(whole)
        for place in rng.integers(0, len(whole), 3):
            changed[place] ^= int(rng.integers(1, 256))
        damaged.write_bytes(changed)
        try:
            read_state(damaged)
        except CheckpointError:
            refused += 1
    assert refused > 150
