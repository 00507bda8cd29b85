"""What was left out of a laboratory specimen: its tests compared with a homogeneous state, corrected for glued ends."""
