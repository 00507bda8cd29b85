"""How the shipped brain meshes were made: `pipeline.build` makes them again, from the ICBM152 template maps.

Needs the extra ``warpbrain[build]``. Nothing here is imported when a simulation runs, and nothing with the folder
itself: MMG runs in a process of its own, many times for a mesh.
"""
