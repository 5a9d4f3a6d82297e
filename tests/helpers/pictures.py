"""Panels of a window, for tests of colours."""


def coloured(plotter):
    """Ranges and colours of the panels that are coloured."""
    from pyvista import Actor

    return [
        (tuple(actor.mapper.scalar_range), actor.mapper.lookup_table.cmap.name)
        for renderer in plotter.renderers
        for actor in renderer.actors.values()
        if isinstance(actor, Actor) and actor.mapper.scalar_visibility
    ]
