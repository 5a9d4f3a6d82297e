"""Tool and mesh sizes, see `helpers.draping`."""

from tests.helpers.draping import coarse_net, quick, tool  # noqa: F401
