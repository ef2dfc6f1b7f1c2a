"""What missions can be made of."""

from __future__ import annotations

from fastapi import APIRouter

from app.deps import CatalogueDep
from app.schemas import PresetEntry, SceneEntry

router = APIRouter(tags=["catalogue"])


@router.get("/scenes", operation_id="listScenes")
def list_scenes(catalogue: CatalogueDep) -> list[SceneEntry]:
    """Built-in scenes and the meshes in the scenes folder."""
    return catalogue.scenes()


@router.get("/presets", operation_id="listPresets")
def list_presets(catalogue: CatalogueDep) -> list[PresetEntry]:
    """Mission presets and what they hold."""
    return catalogue.presets()
