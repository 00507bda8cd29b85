"""The page of docs/mechanisms.md, from the registry: it cannot say what the code does not."""

from __future__ import annotations

import inspect

from warpbrain.physics.mechanism import Mechanism
from warpbrain.physics.mechanisms import mechanisms

_HEAD = """# Mechanisms

What can act on a brain beside its tissue's own law. A case assumes one by a table of `case.toml`, a run by `--with`,
and several act together:

```toml
[[mechanism]]
kind = "gravity"
csf_level = 60.0
```

```sh
warpbrain run --case 0529 --with gravity:level=60 --with swelling:amount=-3
```

Each is one file of [physics/mechanisms](../warpbrain/physics/mechanisms), and this page is made from these files:
`python docs/make_mechanisms.py`. Every one takes `ramp = [[time, factor], ...]`.
"""


def page() -> str:
    """The whole page."""
    return "\n".join([_HEAD, *(_section(mechanism) for mechanism in mechanisms().values())])


def _section(mechanism: type[Mechanism]) -> str:
    module = inspect.getmodule(mechanism)
    assert module is not None
    source = f"../{module.__name__.replace('.', '/')}.py"
    lines = [f"## {mechanism.kind}", "", f"*{mechanism.sentence}*", "", inspect.cleandoc(module.__doc__ or ""), ""]
    lines += ["| key | unit | | expected | typical | source |", "|---|---|---|---|---|---|"]
    for name, says in mechanism.parameters().items():
        doc = mechanism.described(name)
        expected = "" if says.expectation is None else str(says.expectation)
        unit = "`units`" if says.kind == "position" else says.unit
        lines.append(f"| `{name}` | {unit} | {doc} | {expected} | {says.typical} | {says.source} |")
    lines.append("")
    if mechanism.confused_with:
        lines.append(f"Taken for: {', '.join(mechanism.confused_with)}.")
    if mechanism.of_specimens:
        lines.append("In specimens too.")
    if mechanism.needs:
        lines.append(f"Told apart by {', '.join(mechanism.needs)}.")
    lines += [f"[{source.rsplit('/', 1)[1]}]({source})", ""]
    return "\n".join(lines)
