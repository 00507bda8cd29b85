"""The parts of `case.toml`, one file each: from tables that `cases.format` has checked to plain data in SI units.

First the anatomy, then tissues by its labels; `named` finds what keys name in it (node sets, files) for boundaries,
mechanisms and recordings, of which tests are compared with tissues. All note problems and go on; `cases.reading` calls
them in this order.
"""
