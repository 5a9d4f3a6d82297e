"""Scenes whose tools move and press in phases."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..contact import Holder, Phase, Process, Tool
from ..contact.tool import deepest_of
from .scene import Scene


def in_phases(
    scene: Scene,
    phases: Sequence[Phase],
    tools: Sequence[Tool | Holder] = (),
    axes: Mapping[str, tuple[Sequence[float], Any]] | None = None,
) -> Scene:
    """Scene with tools that move and press in phases, see `Process`.

    A run needs the steps of the phases, ``scene.process.steps``.

    Parameters
    ----------
    scene
        The scene.
    phases
        The phases.  Their motions of tools of the scene replace the ones of the scene.
    tools
        Further tools.
    axes
        See `Process`.

    Raises
    ------
    ValueError
        See `Process`.

    Examples
    --------
    >>> from skfem_textile.contact import Phase
    >>> from skfem_textile.scenes import hemisphere_forming, in_phases
    >>> up = Phase("up", 3, {"punch": {"motion": (0, 0, 40)}})
    >>> down = Phase("down", 3, {"punch": {"motion": (0, 0, 20)}})
    >>> scene = in_phases(hemisphere_forming(), [up, down])
    >>> scene.process.steps
    (3, 3)
    """
    stated = [item for phase in phases for item in phase.tools.items()]
    moved = {name for name, values in stated if "motion" in values}
    own = [
        replace(tool, motion=None) if tool.name in moved else tool
        for tool in scene.tools
    ]
    process = Process(phases, [*own, *tools], axes)
    return with_tools(replace(scene, process=process), process.tools)


def with_tools(scene: Scene, tools: Sequence[Tool | Holder]) -> Scene:
    """Scene with tools, of which it reports the force of the one that reaches deepest.

    Unless a condition drives the scene.

    Parameters
    ----------
    scene
        The scene.
    tools
        All its tools.

    Raises
    ------
    ValueError
        If they are holders with a pressure or force only.
    """
    if tools and scene.driven not in scene.conditions:
        scene = replace(scene, driven=deepest_of(tools, scene.mesh.p))
    return replace(scene, tools=tuple(tools))
