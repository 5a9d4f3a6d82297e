"""Public names, which the package imports on first use."""

from .curves import (
    read_curve as read_curve,
)
from .directions import (
    OF_DIRECTIONS as OF_DIRECTIONS,
    read_directions as read_directions,
    write_directions as write_directions,
)
from .draping import (
    DRAPED as DRAPED,
    write_draped as write_draped,
    write_fibres as write_fibres,
    write_net as write_net,
    write_pattern as write_pattern,
)
from .fabrics import (
    OF_FABRICS as OF_FABRICS,
    catalogue as catalogue,
    read_fabric as read_fabric,
    write_fabric as write_fabric,
)
from .meshes import (
    read_mesh as read_mesh,
)
from .part_decks import (
    PartDeck as PartDeck,
    read_part_deck as read_part_deck,
    write_part_deck as write_part_deck,
)
from .results import (
    FIELDS as FIELDS,
    write_fields as write_fields,
    write_history as write_history,
    write_phases as write_phases,
    write_summary as write_summary,
)
from .tools import (
    read_surface as read_surface,
    read_tool_mesh as read_tool_mesh,
)
