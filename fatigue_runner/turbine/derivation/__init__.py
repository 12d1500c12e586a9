"""Build time only: the equations of motion, derived symbolically, and the printer that writes them as lane kernels.

`equations` knows the bodies, `pitching` turns the pitch into an input, `printer` writes `turbine/generated/`.
"""
