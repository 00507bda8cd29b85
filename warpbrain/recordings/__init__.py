"""What was observed: recordings, their files, and how a simulated state is compared with them.

A kind (`points`, `surface`, `force`, `test`) says what `case.toml` may say of it, reads and checks its file with
`tables`, `markups`, `tags`, `surfaces` or `vtp`, and writes it; `recording` lists the kinds. `times` says which rows a
state is compared with, `location` and `closest` where they are in the mesh, and `comparison` how far they are from the
state. `electrodes` are points that are moved only.
"""
