"""Sound case files, and what a case file may say, as documented."""

from collections.abc import Mapping
from random import Random
from typing import Any

#: Files beside a case file.
SHEAR = "shear angle (deg),moment (N mm/mm2)\n0,0\n20,0.05\n40,0.2\n85,2.5\n"
TEST = "displacement (mm),force (N),angle (deg)\n0,0,0\n2,1.5,5\n4,3.5,10\n"

_LAW = {"law", "stiffness_N_per_mm"}
_LAWS = {
    "tension": _LAW
    | {"toe", "initial_stiffness_N_per_mm", "bending_N_per_mm", "compression"}
    | {"warp_crimp", "weft_crimp", "extrapolation", "continuation"}
    | {"pretension_N_per_mm", "in_compression", "weft"},
    "shear": _LAW
    | {"locking_angle_deg", "coefficients_N_per_mm", "variable"}
    | {"extrapolation", "continuation"},
}
_PARTS = {
    "tension": {
        "in_compression": _LAWS["tension"]
        - {"compression", "pretension_N_per_mm", "in_compression", "weft"},
        "weft": _LAWS["tension"] - {"weft"},
    }
}
_FIBRES = {"warp_deg", "weft_deg"}
_SCENES = {
    "strip": set(),
    "picture_frame": {"shear_angle_deg"},
    "trellis": _FIBRES | {"shear_angle_deg", "bend_deg", "free", "roller_deg"},
    "bias_extension": _FIBRES | {"shear_angle_deg", "part"},
    "specimen": _FIBRES | {"width_mm", "height_mm", "move_mm", "driven"},
}
_TABLES = {
    "mesh": {"source", "size", "jitter", "seed"},
    "formulation": {"name", "cs_N_per_mm", "stabilisation", "deviation"},
    "loads": {"force_N"},
    "stepping": {"steps", "tolerance", "most_unknowns", "method", "warn_only"}
    | {"solver"},
    "output": {"pictures", "test_curve"},
}


def unknown_keys(content: Mapping[str, Any]) -> list[str]:
    """Keys and tables of a case file that are not documented."""
    scene = content.get("scene", {})
    name = scene.get("name") if isinstance(scene, dict) else None
    own = _SCENES.get(name, set()) if isinstance(name, str) else set()
    known = {"scene": {"name", "rotate_deg"} | own, **_TABLES, **_LAWS}
    found = []
    for table, values in content.items():
        if table == "regions":
            continue
        if table not in known:
            found.append(table)
        elif isinstance(values, dict):
            found += [f"{table}.{key}" for key in values if key not in known[table]]
            for part, keys in _PARTS.get(table, {}).items():
                own = values.get(part)
                if isinstance(own, dict):
                    found += [f"{table}.{part}.{k}" for k in own if k not in keys]
    return found


def sound_case(random: Random) -> str:
    """The text of a sound case file, which takes a moment to run."""
    scene = random.choice(list(_SCENES))
    lines = ["[scene]", f'name = "{scene}"', f"rotate_deg = {random.choice((0, 30))}"]
    if scene == "bias_extension":
        lines += ["shear_angle_deg = 15", 'part = "half"']
    if scene == "picture_frame":
        lines += ["shear_angle_deg = 15.5"]
    if scene == "trellis":
        lines += ["bend_deg = 10", 'free = ["left"]']
        lines += ["[scene.roller_deg]", "right = 30"]
    if scene == "specimen":
        top = random.choice(("top = [0, 4]", 'top = ["free", 4]'))
        lines += ['driven = "top"', "height_mm = 105.0"]
        lines += ["[scene.move_mm]", "bottom = [0, 0]", top]
    lines += ["[mesh]", 'source = "aligned"', "size = [2, 3]", "jitter = 0.1"]
    toe = ['law = "crimp-toe"', "toe = 0.004", "initial_stiffness_N_per_mm = 10"]
    lines += ["[tension]", "stiffness_N_per_mm = 1000.0"]
    lines += random.choice(([], [*toe, 'compression = "none"']))
    lines += random.choice(([], ["pretension_N_per_mm = 0.1"]))
    weft = ["[tension.weft]", "stiffness_N_per_mm = 500.0"]
    compressed = ["[tension.in_compression]", "stiffness_N_per_mm = 20.0"]
    lines += random.choice(
        ([], weft, weft if 'compression = "none"' in lines else compressed)
    )
    lines += random.choice(
        (
            ["[shear]", 'law = "shear.csv"', 'continuation = "odd"'],
            ["[shear]", 'law = "sin2"', "stiffness_N_per_mm = 0.5"],
            ["[shear]", 'law = "polynomial"', "coefficients_N_per_mm = [0.5, 0, 1.5]"],
        )
    )
    lines += random.choice(
        ([], ["[formulation]", 'name = "one-point"', "cs_N_per_mm = 4.0"])
    )
    lines += random.choice(([], ["[loads.force_N]", "right = [0.1, 0.0]"]))
    lines += ["[stepping]", "steps = 1", 'method = "newton"']
    lines += ['solver = "superlu"', "[output]", "pictures = false"]
    lines += random.choice(([], ['test_curve = "test.csv"']))
    return "\n".join([*lines, ""])
