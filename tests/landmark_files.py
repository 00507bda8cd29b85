"""Landmark files as 3D Slicer and the MNI tools write them."""

import json

TAG = """MNI Tag Point File
Volumes = 2;
%Volume: before.mnc
% Volume: after.mnc

Points =
 1 2 3 1 2 4 0 -1 -1 "one"
 -4 5 6 -3 5 6 0 -1 -1 "the second";
"""


def markup(*points, **keys) -> str:
    controls = [{"label": label, "position": position} for label, position in points]
    head = {"type": "Fiducial", "coordinateSystem": "LPS", "coordinateUnits": "mm"} | keys
    return json.dumps({"@schema": "...", "markups": [{**head, "controlPoints": controls}]})


def fcsv(*points, system: str = "# CoordinateSystem = LPS\n") -> str:
    rows = "".join(f"{i},{x},{y},{z},0,0,0,1,1,1,0,{label},,\n" for i, (label, (x, y, z)) in enumerate(points))
    return (
        "# Markups fiducial file version = 4.11\n"
        + system
        + "# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n"
        + rows
    )


START = (("F-1", [1, 2, 3]), ("F-2", [4, 5, 6]))
