"""Skins in a scene."""

import viser

from gravcomp.view.backbone import Backbone
from gravcomp.view.colours import Rgb
from gravcomp.view.scale import scaled
from gravcomp.view.skin import Skin


def add_skin(
    scene: viser.SceneApi,
    name: str,
    skin: Skin,
    backbone: Backbone,
    colour: Rgb,
    *,
    opacity: float | None = None,
    cast_shadow: bool = True,
) -> viser.MeshHandle:
    """Add a skin on a backbone to a scene."""
    return scene.add_mesh_simple(
        name, scaled(skin.on(backbone)), skin.faces, color=colour, side="front", opacity=opacity, cast_shadow=cast_shadow
    )
