"""Textured meshes from GLB, glTF, OBJ and PLY files (through trimesh)."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from jaxtyping import Float32, UInt8
from numpy import ndarray
from PIL import Image

from hgs_core.errors import SceneError
from hgs_core.scene.mesh_suffixes import MESH_SUFFIXES
from hgs_core.scene.ply_polygons import read_polygons
from hgs_core.scene.textured_mesh import Material, TexturedMesh, concatenated

GREY = (0.6, 0.6, 0.6)

_UNREAD_EXTENSIONS = {
    "GOOGLE_texture_basis": "textures in the Basis format",
    "KHR_texture_basisu": "textures in the KTX2 (Basis) format",
    "KHR_draco_mesh_compression": "triangles compressed with Draco",
    "EXT_meshopt_compression": "triangles compressed with meshopt",
}
"""What trimesh drops or trips over, and what it holds."""
_UNREAD_IMAGES = {"image/x-basis": "GOOGLE_texture_basis", "image/ktx2": "KHR_texture_basisu"}


def read_mesh_file(path: Path) -> tuple[TexturedMesh, list[str]]:
    """The file's triangles in its own frame and unit, and notices of what could not be kept.

    Node transforms are applied. Raises `SceneError` for a file that is missing, of another kind, unreadable
    or without triangles.
    """
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise SceneError(f"{path} is not a mesh file: expected one of {', '.join(MESH_SUFFIXES)}")
    if not path.is_file():
        raise SceneError(f"no scene file {path}: give the path of a mesh, or the name of a built-in scene")
    notices = _what_is_not_read(path)
    polygons = read_polygons(path) if path.suffix.lower() == ".ply" else None
    try:
        scene = trimesh.load_scene(path, process=False) if polygons is None else trimesh.Scene(polygons)
    except Exception as error:  # trimesh raises whatever its parsers hit
        raise SceneError(f"{path} cannot be read as {path.suffix[1:].upper()}: {error}") from error
    parts = []
    for node in sorted(scene.graph.nodes_geometry):
        transform, name = scene.graph[node]
        geometry = scene.geometry[name]
        if isinstance(geometry, trimesh.Trimesh) and len(geometry.faces):
            parts.append(_part(geometry, np.asarray(transform), str(name), notices))
    if not parts:
        raise SceneError(f"{path} holds no triangles: a point cloud or an empty file cannot serve as a world")
    return concatenated(parts), list(dict.fromkeys(notices))


def _part(geometry: trimesh.Trimesh, transform: ndarray, name: str, notices: list[str]) -> TexturedMesh:
    faces = np.asarray(geometry.faces, dtype=np.int32)
    vertices = np.asarray(geometry.vertices) @ transform[:3, :3].T + transform[:3, 3]
    visual: Any = geometry.visual
    uv = np.zeros((len(faces), 3, 2), dtype=np.float32)
    colours = None
    material_index = np.zeros(len(faces), dtype=np.int32)
    if isinstance(visual, trimesh.visual.TextureVisuals):
        if visual.uv is not None and len(visual.uv) == len(vertices):
            uv = _finite(np.asarray(visual.uv, dtype=np.float32))[faces]
        material = visual.material
        if isinstance(material, trimesh.visual.material.MultiMaterial):
            materials = tuple(_material(m, name, notices) for m in material.materials)
            if visual.face_materials is not None:
                material_index = np.asarray(visual.face_materials, dtype=np.int32)
        else:
            materials = (_material(material, name, notices),)
        vertex_colours = visual.vertex_attributes.get("color")
        if vertex_colours is not None and len(vertex_colours) == len(vertices):
            colours = trimesh.visual.color.to_rgba(vertex_colours)[faces][..., :3]
    else:
        materials = (Material(name=name),)
        if visual.kind == "vertex":
            colours = np.asarray(visual.vertex_colors)[faces][..., :3]
        elif visual.kind == "face":
            colours = np.repeat(np.asarray(visual.face_colors)[:, None, :3], 3, axis=1)
        else:
            materials = (Material(name=name, factor=GREY),)
            notices.append(f"{name} has neither texture nor colours: drawn grey")
    return TexturedMesh(
        vertices_m=vertices.astype(np.float32),
        triangles=faces,
        uv=uv,
        material_index=material_index,
        materials=materials,
        corner_colours=None if colours is None else np.ascontiguousarray(colours, dtype=np.uint8),
    )


def _material(material: Any, mesh_name: str, notices: list[str]) -> Material:
    name = str(getattr(material, "name", None) or mesh_name)
    if isinstance(material, trimesh.visual.material.PBRMaterial):
        image, factor = material.baseColorTexture, material.baseColorFactor
        if material.alphaMode not in (None, "OPAQUE"):
            notices.append(
                f"material {name} has alpha mode {material.alphaMode}: alpha is ignored, drawn opaque"
            )
        # glTF factors are linear light, texels are display values; in a pure power law the product stays.
        colour = (1.0, 1.0, 1.0) if factor is None else _rgb(factor, 1 / 2.2)
    else:
        image = getattr(material, "image", None)
        diffuse = getattr(material, "diffuse", None)
        # Exporters leave arbitrary Kd beside a texture, so a texture speaks for itself.
        colour = (1.0, 1.0, 1.0) if image is not None or diffuse is None else _rgb(diffuse, 1.0)
    if image is None:
        return Material(name=name, factor=colour)
    return Material(name=name, factor=colour, texture=_texels(image))


def _rgb(colour: Any, exponent: float) -> tuple[float, float, float]:
    values = np.asarray(trimesh.visual.color.to_rgba(colour)).reshape(-1)[:3] / 255.0
    red, green, blue = (float(v) ** exponent for v in values)
    return red, green, blue


def _texels(image: Image.Image) -> UInt8[ndarray, "h w 3"]:
    return np.ascontiguousarray(np.asarray(image.convert("RGB")))


def _finite(uv: Float32[ndarray, "n 2"]) -> Float32[ndarray, "n 2"]:
    """Texture coordinates with 0 where a file holds NaN or infinity."""
    return np.where(np.isfinite(uv), uv, np.float32(0.0))


def _what_is_not_read(path: Path) -> list[str]:
    """Notices about references that the loader drops without a word.

    Raises `SceneError` for a glTF whose textures or triangles would be dropped whole.
    """
    suffix = path.suffix.lower()
    if suffix == ".obj":
        return _missing_obj_textures(path)
    if suffix in (".glb", ".gltf"):
        return _gltf_notices(path)
    return []


def _missing_obj_textures(path: Path) -> list[str]:
    notices = []
    with path.open(encoding="utf-8", errors="replace") as lines:
        libraries = [line for line in lines if line.startswith("mtllib ")]
    for line in libraries:
        library = path.parent / line.split(maxsplit=1)[1].strip()
        if not library.is_file():
            notices.append(f"material library {library.name} is missing: its surfaces are drawn grey")
            continue
        for row in library.read_text(encoding="utf-8", errors="replace").splitlines():
            words = row.split()
            if words[:1] == ["map_Kd"] and not (library.parent / words[-1].replace("\\", "/")).is_file():
                notices.append(f"texture {words[-1]} is missing: drawn in the material's plain colour")
    return notices


def _gltf_notices(path: Path) -> list[str]:
    try:
        document = _gltf_document(path)
    except (ValueError, struct.error) as error:
        raise SceneError(f"{path} cannot be read as {path.suffix[1:].upper()}: {error}") from error
    notices = []
    images = [image.get("mimeType") for image in document.get("images", [])]
    named = [*document.get("extensionsUsed", []), *(_UNREAD_IMAGES.get(kind, "") for kind in images)]
    unread = [what for extension, what in _UNREAD_EXTENSIONS.items() if extension in named]
    if unread:
        raise SceneError(
            f"{path} cannot be read: it holds {' and '.join(unread)}, for which there is no reader here. Use "
            "the uncompressed download (Matterport3D: the .obj in matterport_mesh; HM3D: ID.glb of "
            "hm3d-*-glb), or export it again with PNG or JPEG textures and plain triangles"
        )
    if "KHR_texture_transform" in document.get("extensionsUsed", []):
        notices.append(
            "texture transforms (KHR_texture_transform) are not applied: textures may be misplaced"
        )
    for image in document.get("images", []):
        uri = image.get("uri", "")
        if uri and not uri.startswith("data:") and not (path.parent / uri).is_file():
            notices.append(f"texture {uri} is missing: drawn in the material's plain colour")
    return notices


def _gltf_document(path: Path) -> dict[str, Any]:
    content = path.read_bytes()
    if content[:4] == b"glTF":
        length = struct.unpack_from("<I", content, 12)[0]
        content = content[20 : 20 + length]
    return json.loads(content)
