"""Images and what deforms them: grids, displacement fields, transforms for other programs, points that move along.

Lengths are in mm and axes RAS throughout this room, as its files have them; meshes come in metres.
"""
