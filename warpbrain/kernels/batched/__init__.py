"""Kernels of many samples on one mesh: the structure is shared, the values are one set a sample.

Every array of values has the sample as its last, fastest index, and components apart: ``x[node, component, slot]``. The
32 threads of a warp then work on 32 samples at the same place of the mesh: they share its indices and geometry, and
read and write whole lines of memory.

A sample has a slot, its place in these arrays. Kernels are launched over a list of slots, ``slots[lane]`` for
``lane < count[0]``: a sample that is not in the list costs nothing but the lanes that end at once.

No number of a sample depends on another sample, on its slot or on how many there are: every sum has an order of its
own, so a sample has the same bits alone and among others on the same kind of device.
"""
