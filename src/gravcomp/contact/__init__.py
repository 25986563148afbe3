"""Contact between a robot's surface and the obstacles of a scene, with Coulomb's friction.

    `surface`: stations along the robot with their outlines
    `outline_gap`: the point of an outline next to an obstacle, also at its edges
    `places`: where the surface is near an obstacle, with gap and directions
    `own_surface`, `own_pairs`, `own_places`, `own_rows`: where the robot is near itself, and what that is in the model
    `condensed`: contact forces, friction and cable tensions from the compliance at these places
    `stability`: whether the robot would leave that equilibrium

The model that moves the surface, full or reduced, computes the compliance; it is the same method in both.
"""
