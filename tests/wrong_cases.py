"""What a `case.toml` can have wrong with it: a change of the block's, and what the message says."""

FORCE = 'kind = "force"\ntotal = [0.01, 0.02, -0.05]'
SECOND_LAW = "mu = 3000.0"
GRAVITY = '[[mechanism]]\nkind = "gravity"\n'

WRONG = {
    # keys: misspelt, of no meaning here, missing
    "top level": (("[body]", "[bodies]"), r"case.toml: bodies: unknown key \(did you mean 'body'\?\)"),
    "head": (("title", "titel"), r"\[case\] titel: unknown key \(did you mean 'title'\?\)"),
    "mesh": (("file =", "files ="), r"\[mesh\] files: unknown key \(did you mean 'file'\?\)"),
    "tissue": (("mu = 1000", "m = 1000"), r"\[tissue.1\] m: unknown key"),
    "body": (("poisson", "poison"), r"\[body\] poison: unknown key \(did you mean 'poisson'\?\)"),
    "boundary": (("total", "totl"), r"\[boundary 2\] totl: unknown key \(did you mean 'total'\?\)"),
    "mechanism": (("[body]", GRAVITY + "level = 3\n[body]"), r"\[mechanism 1\] level: unknown key \(.*csf_level"),
    "law": ((SECOND_LAW, "mu = 3.0\nC1 = 1.0"), r"\[tissue.2\] C1: means nothing with model 'neo-hookean'"),
    "law 2": (
        (SECOND_LAW, 'model = "mooney-rivlin"\nmu = 3.0'),
        r"\[tissue.2\] mu: expected one of prior.*takes C1, C2",
    ),
    "fixed": (('"fixed"', '"fixed"\nvalue = [0, 0, 1]'), r"\[boundary 1\] value: means nothing with kind 'fixed'"),
    "moved": ((FORCE, 'kind = "displacement"\nvalue = [0, 0, 1]\ntotal = [0, 0, 1]'), r"\[boundary 2\] total: means"),
    "no head": (("[case]", "[case.x]"), r"\[case\] x: unknown key"),
    "no name": (('name = "block"\n', ""), r"\[case\] name: missing"),
    "no origin": (('origin = "synthetic"\n', ""), r"\[case\] origin: missing"),
    "no file": (('file = "mesh.vtu"\n', ""), r"\[mesh\] file: missing"),
    "no mu": (("mu = 1000.0\n", ""), r"\[tissue.1\] mu: missing"),
    "no alpha": ((SECOND_LAW, 'model = "ogden"\nmu = [1.0]'), r"\[tissue.2\] alpha: missing"),
    "no C2": ((SECOND_LAW, 'model = "mooney-rivlin"\nC1 = 1.0'), r"\[tissue.2\] C2: missing"),
    "no nodes": (('nodes = "top"\n', ""), r"\[boundary 2\] nodes: missing"),
    "no kind": (('kind = "fixed"\n', ""), r"\[boundary 1\] kind: missing"),
    "no total": (("\ntotal = [0.01, 0.02, -0.05]", ""), r"\[boundary 2\] total: missing"),
    "no mass": ((FORCE, FORCE + "\nmass = 0.0"), r"\[boundary 2\] mass: "),
    "no axis": (
        ("[body]", GRAVITY + "csf_level = 1\n[body]"),
        r"\[case\] gravity_axis: missing, but \[\[mechanism\]\] gravity",
    ),
    # values: of the wrong type or outside their range
    "name": (('"block"', "529"), r"\[case\] name: expected text, found 529"),
    "key": (('title = "A block of gel"', r'"\u001b[31m" = 1'), r"\[case\] \\x1b\[31m: unknown key"),
    "title": (
        ('"A block of gel"', r'"red \u001b[31m"'),
        r"\[case\] title: expected text without control characters, found 'red \\x1b\[31m'",
    ),
    "units": (('"mm"', '"cm"'), r"\[case\] units: found 'cm', expected one of m, mm"),
    "axes": (('"RAS"', '"RAI"'), r"\[case\] axes: found 'RAI', expected one of RAS, LPS"),
    "origin": (('"synthetic"', '"made up"'), r"\[case\] origin: found 'made up', expected one of measured, stand-in"),
    "zero axis": (
        ('"RAS"', '"RAS"\ngravity_axis = [0, 0, 0]'),
        r"\[case\] gravity_axis: .* not all zero, found \[0, 0, 0\]",
    ),
    "axis": (('"RAS"', '"RAS"\ngravity_axis = "down"'), r"\[case\] gravity_axis: expected 3 finite numbers"),
    "registration": (
        ('"RAS"', '"RAS"\nregistration = 2.0'),
        r"\[case\] registration: expected a table, found 2.0 \(registration = \{ mm = 2.0, degrees = 1.0 \}\)",
    ),
    "registration mm": (
        ('"RAS"', '"RAS"\nregistration = { mm = 0, degrees = 1.0 }'),
        r"\[case\] registration: mm: found 0, expected a number in the open interval \(0, 1000\) \[mm\]",
    ),
    "registration degrees": (
        ('"RAS"', '"RAS"\nregistration = { mm = 1, degrees = "one" }'),
        r"\[case\] registration: degrees: expected a finite number \[degrees\], found 'one'",
    ),
    "registration half": (
        ('"RAS"', '"RAS"\nregistration = { mm = 1 }'),
        r"\[case\] registration: degrees: missing, found \{'mm': 1\}",
    ),
    "registration key": (
        ('"RAS"', '"RAS"\nregistration = { mm = 1, degrees = 1, deg = 2 }'),
        r"\[case\] registration: deg: unknown key, expected mm, degrees",
    ),
    "model": (('"neo-hookean"', '"fung"'), r"\[tissue.1\] model: found 'fung', expected one of neo-hookean"),
    "formulation": ((SECOND_LAW, 'mu = 1.0\nformulation = "mixed"'), r"\[tissue.2\] formulation: found 'mixed'"),
    "zero mu": (("mu = 1000.0", "mu = 0"), r"\[tissue.1\]: .*mu = 0"),
    "negative mu": (("mu = 1000.0", "mu = -5.0"), r"\[tissue.1\]: .*mu = -5"),
    "prior": (("mu = 1000.0", 'mu = "prior"'), r"\[tissue.1\] prior: missing, but mu = .prior. needs it .*hyperel"),
    "ogden": ((SECOND_LAW, 'model = "ogden"\nmu = 1.0\nalpha = 2.0'), r"\[tissue.2\] mu: expected a list of finite"),
    "ogden terms": ((SECOND_LAW, 'model = "ogden"\nmu = [1.0, 2.0]\nalpha = [2.0]'), r"\[tissue.2\]: .*2 values of mu"),
    "density": (("density = 1000.0", "density = 0"), r"\[body\] density: found 0, expected a positive number"),
    "nu": (("poisson = 0.45", "poisson = 0.5"), r"\[body\] poisson: found 0.5, expected .*open interval \(-1, 0.5\)"),
    "low nu": (("poisson = 0.45", "poisson = -1"), r"\[body\] poisson: found -1, expected"),
    "table": (("[body]\ndensity = 1000.0\npoisson = 0.45", "[[body]]\ndensity = 1"), r"\[body\]: expected a table"),
    "list": (('[[boundary]]\nname = "table"', '[boundary]\nname = "table"'), r"TOML"),
    "mechanism list": (("[body]", '[mechanism]\nkind = "gravity"\n[body]'), r"\[\[mechanism\]\]: expected a list"),
    "ramp": (("-0.05]", "-0.05]\nramp = 5"), r"\[boundary 2\] ramp: expected \[time, factor\] pairs"),
    "ramp text": (("-0.05]", '-0.05]\nramp = [["0", 1]]'), r"\[boundary 2\] ramp: expected \[time, factor\] pairs"),
    "ramp nan": (("-0.05]", "-0.05]\nramp = [[0, nan]]"), r"\[boundary 2\] ramp: expected .*finite"),
    "ramp back": (("-0.05]", "-0.05]\nramp = [[1, 0], [0, 1]]"), r"\[boundary 2\] ramp.*times must increase"),
    # labels and sets, both ways
    "tissue missing": (('[tissue.2]\nname = "stiff"\nmu = 3000.0\n', ""), r"\[tissue.2\]: missing, but the mesh has"),
    "tissue unused": ((SECOND_LAW, "mu = 3.0\n[tissue.7]\nmu = 1.0"), r"\[tissue.7\]: the mesh has no tissue 7"),
    "tissue word": (("[tissue.2]", "[tissue.grey]"), r"\[tissue.grey\]: tissue labels are whole numbers"),
    "tissue 02": (("[tissue.2]", "[tissue.02]"), r"\[tissue.02\]: tissue labels are whole numbers"),
    "tissue huge": (
        ("[tissue.2]", f"[tissue.{'2' * 5000}]"),
        r"\[tissue.2+\.\.\.2+\]: tissue labels are whole numbers",
    ),
    "tissue squared": (("[tissue.2]", '[tissue."²"]'), r"\[tissue.²\]: tissue labels are whole numbers"),
    "tissue value": (
        ('[tissue.2]\nname = "stiff"\nmu', "[tissue]\n2"),
        r"\[tissue.2\]: expected a table, found 3000.0",
    ),
    "labels": (('"mesh.vtu"', '"mesh.vtu"\ntissue = "organ"'), r"no cell array 'organ' .*found .*tissue"),
    "set": (('"top"', '"roof"'), r"\[boundary 2\] nodes: .*no node set 'roof' \(it has bottom, nobody, top\)"),
    "empty set": (('"top"', '"nobody"'), r"\[boundary 2\] nodes: node set 'nobody' is empty"),
    "empty fixed": (('"bottom"', '"nobody"'), r"\[boundary 1\] nodes: node set 'nobody' is empty"),
    "elements": (("[body]", '[[mechanism]]\nkind = "resection"\n[body]'), r"\[mechanism 1\] elements: .*'resection'"),
    "both": (
        (FORCE, FORCE + '\n[[boundary]]\nname = "lift"\nnodes = "bottom"\nkind = "displacement"\nvalue = [0, 0, 1]'),
        r"\[\[boundary\]\]: 'table' fixes 9 nodes that 'lift' displaces",
    ),
    "twice": (
        ("[body]", 2 * '[[mechanism]]\nkind = "resection"\nelements = "corner"\n' + "[body]"),
        r"\[mechanism 2\] kind: a second 'resection'",
    ),
    "kind": (('"force"', '"farce"'), r"\[boundary 2\] kind: found 'farce', expected one of fixed, sliding"),
    "skull-flap": (
        ("[body]", '[[mechanism]]\nkind = "skull-flap"\n[body]'),
        r"\[mechanism 1\] kind: found 'skull-flap', expected",
    ),
    # files
    "no mesh": (('"mesh.vtu"', '"other.vtu"'), r"\[mesh\] file: no such file: .*other.vtu"),
    "outside": (('"mesh.vtu"', '"../mesh.vtu"'), r"\[mesh\] file: '../mesh.vtu' leaves the case folder"),
    "absolute": (('"mesh.vtu"', '"/etc/passwd"'), r"\[mesh\] file: '/etc/passwd' leaves the case folder"),
    "null": (('"mesh.vtu"', r'"a\u0000b"'), r"\[mesh\] file: expected the name of a file"),
    "a folder": (('"mesh.vtu"', '"."'), r"\[mesh\] file: no such file"),
}
