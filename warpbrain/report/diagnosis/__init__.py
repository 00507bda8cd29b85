"""What a diagnosis prints and writes.

`description` makes the dictionary that is `diagnosis.json`, `text` sentences and rows of it for the terminal and the
page, `pictures` the figures of the page, `files` the map, the state and the tables beside it.
"""
