"""The documents say what the code does, as far as a program can tell."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import msgspec
import pytest
from pydantic import BaseModel

from app.robot.figures import RobotReport
from hgs_core.evaluation.report import MissionReport
from hgs_core.live.messages import (
    CameraFacts,
    DepthCameraFacts,
    FromRobot,
    LensFacts,
    ScanPart,
    ToRobot,
)


def documented_names(text: str) -> set[str]:
    """Names in backticks in the first column of the tables; `a_1cm`, `_2cm` stands for a_1cm and a_2cm."""
    names: set[str] = set()
    for row in re.findall(r"^\| ([^|]+) \|", text, re.MULTILINE):
        stem = ""
        for name in re.findall(r"`([\w.]+)`", row):
            if name.startswith("_"):
                names.add(re.sub(r"_\d+cm$", name, stem))
            elif name.startswith("."):
                names.add(stem.split(".")[0] + name)
            else:
                stem = name
                names.add(name)
    return names


def keys_of(model: type[BaseModel], prefix: str = "") -> set[str]:
    """Keys as they stand in the file; a nested model's as `outer.inner`."""
    keys: set[str] = set()
    for name, field in model.model_fields.items():
        key = prefix + (field.alias or name)
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            keys |= keys_of(field.annotation, key + ".")
        else:
            keys.add(key)
    return keys


def test_every_key_of_the_report_is_documented_and_no_other(repository: Path) -> None:
    documented = documented_names((repository / "docs" / "report.md").read_text(encoding="utf-8"))
    assert documented == keys_of(MissionReport)


@pytest.mark.parametrize(
    "document",
    [
        "README.md",
        "docs/extending.md",
        "docs/report.md",
        "docs/results.md",
        "docs/robots.md",
        "docs/scenes.md",
        "docs/service.md",
    ],
)
def test_local_links_lead_somewhere(repository: Path, document: str) -> None:
    path = repository / document
    targets = re.findall(r"\]\((?!https?:|#)([^)#]+)", path.read_text(encoding="utf-8"))
    targets += re.findall(r'src="(?!https?:)([^"]+)"', path.read_text(encoding="utf-8"))
    missing = [target for target in targets if not (path.parent / target).exists()]
    assert not missing


def test_readme_names_only_make_targets_that_exist(repository: Path) -> None:
    readme = (repository / "README.md").read_text(encoding="utf-8")
    makefile = (repository / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z-]+):", makefile, re.MULTILINE))
    assert set(re.findall(r"(?:`|^)make ([a-z-]+)", readme, re.MULTILINE)) <= targets


def test_the_page_about_robots_has_every_message_and_every_figure(repository: Path) -> None:
    text = (repository / "docs" / "robots.md").read_text(encoding="utf-8")
    rows = {
        name: set(re.findall(r"`(\w+)`", keys))
        for name, keys in re.findall(r"^\| `(\w+)` \| ([^|]*`[^|]*)\|", text, re.M)
    }
    for message in (*get_args(FromRobot), *get_args(ToRobot)):
        info = msgspec.inspect.type_info(message)
        assert rows[info.tag] == {field.name for field in info.fields}, info.tag
    parts = {"camera": CameraFacts, "depth_camera": DepthCameraFacts, "lens": LensFacts, "scan": ScanPart}
    for name, part in parts.items():
        assert rows[name] == {field.name for field in msgspec.inspect.type_info(part).fields}, name
    assert set(RobotReport.model_fields) <= set(re.findall(r"`(\w+)`", text.split("### robot.json")[1]))
