"""Which files hold meshes; apart from their reader, which takes a second to import."""

from typing import Final

MESH_SUFFIXES: Final = (".glb", ".gltf", ".obj", ".ply")
