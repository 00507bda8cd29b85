"""What `case.toml` may say: every table and key in one place, from which it is read, checked and described.

`tables` declares them, with those that laws, mechanisms and recordings declare themselves; `reading` holds a table of a
file against its declaration; `schema` makes the JSON Schema of them for editors.
"""
