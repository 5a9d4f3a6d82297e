"""Panels of a window, for tests of colours; directions of lines."""

import numpy as np


def degrees_off(lines, angle):
    """Differences of the directions of lines, (2, n), from an angle in degrees."""
    directions = np.degrees(np.arctan2(lines[1], lines[0]))
    return np.abs((directions - angle + 90) % 180 - 90)


def coloured(plotter):
    """Ranges and colours of the panels that are coloured."""
    from pyvista import Actor

    return [
        (tuple(actor.mapper.scalar_range), actor.mapper.lookup_table.cmap.name)
        for renderer in plotter.renderers
        for actor in renderer.actors.values()
        if isinstance(actor, Actor) and actor.mapper.scalar_visibility
    ]
