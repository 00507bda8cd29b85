"""Bodies as PyVista renders them, in a process of its own: a graphics library that fails takes nothing along."""
