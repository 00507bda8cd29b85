"""python -m warpbrain"""

from warpbrain.cli import main

raise SystemExit(main())
