"""What every layer of the 3D scene is."""

from __future__ import annotations

from typing import Protocol

from app.missions.display import DisplayView


class Layer(Protocol):
    """One kind of thing in the scene, in as few nodes as possible, under names that stay."""

    title: str
    """As it stands beside its checkbox."""
    shown_at_first: bool

    def update(self, view: DisplayView) -> None:
        """Show `view`; array sizes on the wire stay as they are."""
        ...

    def set_visible(self, visible: bool) -> None: ...
