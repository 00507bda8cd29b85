"""Ground floor: the code that runs on the device, on CPU and GPU from one source.

Kernels take arrays and numbers and know no policy: which law, which preconditioner and which step are decided above.
A kernel is made once for a precision (and, for the elements, once for a law) by a cached factory, in a module with a
stable name, so that Warp compiles only what a run uses and finds it again in its cache.
"""

import warp as wp

# a library does not print: Warp would greet, and tell of every kernel it loads, on standard output
wp.config.log_level = max(wp.config.log_level, wp.LOG_WARNING)
