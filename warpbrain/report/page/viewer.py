"""The 3-D view of a report as HTML: a canvas, what switches it, a bar of colours, and its script, all in the page."""

from __future__ import annotations

from warpbrain.report.page.document import asset, text
from warpbrain.report.page.scene import View, describe_scene, scene_json

#: What the buttons of views say.
_VIEWS = {"start": "start", "front": "from the front", "left": "from the left", "above": "from above"}


def viewer(view: View, legend: str, note: str) -> str:
    """The view; where a browser has no WebGL it says so, and the pictures above and below remain.

    Parameters
    ----------
    view : View
    legend, note : str
        What the arrows are, in a word or two, and in a sentence.
    """
    scene = describe_scene(view)
    fields = "".join(
        f'<label><input type="radio" name="field" value="{k}"{" checked" if k == 0 else ""}>'
        f"{text(field['name'])}</label>"
        for k, field in enumerate(scene["fields"])
    )
    arrows = "".join(
        f'<label><input type="checkbox" name="arrows" value="{k}"{" checked" if one["shown"] else ""}>'
        f'<span class="swatch" style="background:rgb{tuple(one["colour"])}"></span>{text(one["name"])}</label>'
        for k, one in enumerate(scene["arrows"])
    )
    left = (
        f"<fieldset><legend>{text(legend)}</legend>{arrows}</fieldset>"
        '<label>arrows <input type="range" name="enlarged" min="1" max="40" step="1" '
        f'value="{scene["enlarged"]}"><output>{scene["enlarged"]} times</output></label>'
        if arrows
        else ""
    )
    ball = '<label><input type="checkbox" name="ball" checked>located ball</label>' if scene["ball"] else ""
    factor = view.exaggeration
    moves = (
        f'<label>motion <input type="range" name="moves" min="0" max="{2.0 * factor or 2.0:g}" '
        f'step="{factor / 20.0 or 0.1:g}" value="{factor:g}"><output>{factor:g} times</output></label>'
        if view.u is not None
        else ""
    )
    cuts = "".join(
        f'<label><input type="checkbox" name="cuts" value="{k}">{text(one["name"])}</label>'
        for k, one in enumerate(scene["cuts"])
    )
    cuts = f"<fieldset><legend>cuts</legend>{cuts}</fieldset>" if cuts else ""
    views = "".join(f'<button type="button" data-view="{key}">{name}</button>' for key, name in _VIEWS.items())
    triad = "".join(
        f'<line class="line-{letter}" x1="40" y1="40"/><text class="text-{letter}">{letter}</text>' for letter in "RAS"
    )
    stops = ", ".join(f"rgb({r} {g} {b})" for r, g, b in scene["colours"])
    return f"""<div id="scene">
<div class="controls">
<fieldset><legend>surface</legend>{fields}</fieldset>
<label>opacity <input type="range" name="opacity" min="0.1" max="1" step="0.05" value="0.3"></label>
{moves}{cuts}{left}{ball}
<span class="views">{views}</span>
</div>
<div class="stage">
<canvas tabindex="0" role="img" aria-label="3-D view of the anatomy with recorded points; arrow keys turn it, plus and
minus zoom, shift and arrow keys move it, 0 goes back"></canvas>
<svg class="triad" viewBox="0 0 80 80" aria-hidden="true">{triad}</svg>
</div>
<div class="bar"><div class="ends"><span class="low"></span><span class="label"></span><span class="high"></span></div>
<div class="scale" style="background:linear-gradient(to right, {stops})"><span class="mark" hidden></span></div>
<div class="mark-text"></div></div>
<p class="missing">This browser shows no WebGL, which the 3-D view needs; the pictures of this page hold the same.</p>
<p class="note">Drag to turn, shift and drag to move, wheel to zoom; keys: arrows, + and -, 0. R, A, S: right, front,
top of the patient. Surface in mm. {text(note)}</p>
</div>
<script type="application/json" id="scene-data">{scene_json(scene)}</script>
<script>{asset("scene.js")}</script>"""
