"""Figures of a ply that lies on a tool."""

import numpy as np
from numpy import ndarray

from ...drape import bridging, contact_pressure, wrinkle_risk
from ...solve.result import Result

_NO_NET = (
    "nothing pulls the edges, and fibres do not resist bending: where fibres are "
    "compressed they buckle in the plane of the ply, and the state is not the net"
)


def measured_on_tool(result: Result) -> dict[str, float | str]:
    """Where the shear is largest, contact pressures, and shares of the ply's area.

    Empty of a ply that is on no tool.
    """
    ply, u, t = result.ply, result.u, result.states[-1].load_factor
    surface = result.tool(t)
    if surface is None:
        return {}
    area = np.abs(ply.basis.mapping.detDF(ply.centre))[:, 0]

    def share(elements: ndarray) -> float:
        return float(area[elements].sum() / area.sum())

    sheared = np.abs(ply.shear_angle(u)).max(axis=1).argmax()
    corners = ply.mesh.t[:, sheared]
    x = np.pad(ply.nodes, ((0, 1), (0, 0))) + ply.nodal(u)
    place = x[:, corners].mean(axis=1).tolist()
    found: dict[str, float | str] = {
        f"max_shear_angle_at_{axis}_mm": at
        for axis, at in zip("xyz", place, strict=True)
    }
    pressure = contact_pressure(ply, surface, u, t)
    found["max_contact_pressure_N_per_mm2"] = float(pressure.max())
    found["min_contact_pressure_N_per_mm2"] = float(pressure.min())
    found["bridging_share_of_area"] = share(bridging(ply, pressure))
    found["wrinkle_risk_share_of_area"] = share(wrinkle_risk(ply, u))
    if not (np.any(ply.fabric.bending) or ply.load(u, t).any()):
        found["not_the_net"] = _NO_NET
    return found
