"""What the user reads: files and figures made from results. Computes nothing.

A result becomes one dictionary with units in its keys (`describe_...` of `summary`, `estimate`, `ensemble`, `specimen`,
`diagnosis.description`), which `files.write_summary` writes as JSON. The templates in `page` make the printed lines
(`*.txt`) and `report.html` (`*.html`) of that dictionary; `picture`, `views` and `rendering` draw what is in them.
`files` opens a deformed body again, for `view`, `compare` and `warp`.
"""
