"""Material laws at a point of the body: stress, tangent and energy as functions of Green's strain; one file per law.

A symmetric tensor is an array of six components in the order 11 22 33 12 23 13 (Voigt). Shear strains are doubled, shear
stresses are not.
"""
