"""The scene of a robot: walls and solids that it touches, as signed distances.

    robot file, section `scene` -> `declared` -> `scene.Scene` (compiled arrays) -> `distance`: gap and normal at points

scene = load_robot_file("in_lumen.yaml").scene
gap, normal, obstacle = scene.nearest(points)      # m, unit vectors into free space, numbers of obstacles
"""

from gravcomp.scene.declared import BoxWall, MeshWall, PlaneWall, SceneSection, SphereWall, TubeWall, Wall

__all__ = ["BoxWall", "MeshWall", "PlaneWall", "SceneSection", "SphereWall", "TubeWall", "Wall"]
