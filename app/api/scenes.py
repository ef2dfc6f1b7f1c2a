"""What missions can be made of."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Query, Response, status

from app.deps import CatalogueDep, PrincipalDep
from app.openapi import problems
from app.schemas import PresetEntry, PresetName, PresetSave, PresetSettings, SceneEntry

router = APIRouter(tags=["catalogue"])

_Name = Annotated[PresetName, Path(examples=["paper", "night-shift"])]


@router.get("/scenes", operation_id="listScenes")
def list_scenes(catalogue: CatalogueDep) -> list[SceneEntry]:
    """Built-in scenes and the meshes in the scenes folder."""
    return catalogue.scenes()


@router.get("/presets", operation_id="listPresets")
def list_presets(catalogue: CatalogueDep) -> list[PresetEntry]:
    """Mission presets and what they hold: the built-in ones, then those that operators saved."""
    return catalogue.presets()


@router.get("/presets/{name}", operation_id="getPreset", responses=problems(404))
def get_preset(name: _Name, catalogue: CatalogueDep) -> PresetEntry:
    return catalogue.preset(name)


@router.get("/presets/{name}/settings", operation_id="getPresetSettings", responses=problems(404))
def get_preset_settings(
    name: _Name,
    catalogue: CatalogueDep,
    planner: Annotated[
        PresetName | None, Query(description="As if the preset named this planner", examples=["best"])
    ] = None,
) -> PresetSettings:
    """Every setting of a preset with its meaning, range and value: what a form needs. Settings that differ go
    into the `overrides` of a new mission, `section.field` by text."""
    return catalogue.settings(name, planner=planner)


@router.put(
    "/presets/{name}",
    operation_id="savePreset",
    responses={201: {"model": PresetEntry, "description": "It is new"}, **problems(409)},
)
def save_preset(
    name: _Name, wish: PresetSave, catalogue: CatalogueDep, principal: PrincipalDep, response: Response
) -> PresetEntry:
    """Save a preset of your own under `name`, or replace it. Missions made of it before stay as they were."""
    entry, is_new = catalogue.save_preset(name, wish, saved_by=principal.name)
    if is_new:
        response.status_code = status.HTTP_201_CREATED
    return entry


@router.delete(
    "/presets/{name}",
    operation_id="deletePreset",
    status_code=status.HTTP_204_NO_CONTENT,
    responses=problems(404, 409),
)
def delete_preset(name: _Name, catalogue: CatalogueDep) -> None:
    """Delete a preset that an operator saved. Missions made of it stay as they were."""
    catalogue.delete_preset(name)
