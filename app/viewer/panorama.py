"""What would be gained from the next view, all around: two strips in the control panel, and a mark there."""

from __future__ import annotations

import numpy as np
import viser

from app.missions.display import PANORAMA_PX, DisplayView
from app.viewer.palette import SKY


class PanoramaPanel:
    """The panorama of the gain evaluator from where the plan looks next, on the newest maps."""

    def __init__(self, server: viser.ViserServer) -> None:
        with server.gui.add_folder("Next view: gain all around"):
            self._image = server.gui.add_image(
                np.zeros((*PANORAMA_PX, 3), np.uint8), label=None, format="png"
            )
            self._text = server.gui.add_markdown("No view is planned yet.")
        self._mark = server.scene.add_cylinder(
            "/next_view", radius=0.32, height=0.03, color=SKY, opacity=0.8, visible=False, cast_shadow=False
        )

    def update(self, view: DisplayView) -> None:
        known = len(view.panorama_m) > 0
        self._mark.visible = known
        self._image.image = view.panorama
        if not known:
            text = "No view is planned, or this planner's gain has no panorama."
        else:
            x_m, y_m, z_m = view.panorama_m[0].tolist()
            self._mark.position = (x_m, y_m, 0.05)
            text = (
                f"From ({x_m:.1f}, {y_m:.1f}), camera at {z_m:.1f} m. Above: volume newly seen; below: what "
                "is seen better. Bright = much, each to its own scale. The middle looks along +x, left of it "
                "along +y, the ends along -x."
            )
        if self._text.content != text:
            self._text.content = text
