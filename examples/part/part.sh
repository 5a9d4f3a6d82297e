#!/bin/sh -e
# From raw test files, an outline and tools to a report, a deck and a flat pattern.
skfem-textile fit picture-frame frame.txt --frame 200 --side 160 --out fit
skfem-textile fit cantilever droop.csv --fabric fit/fabric.json --out fit
skfem-textile run forming --punch punch.stl --die die.stl --travel 40 --outline ply.dxf --fibres 30 --fabric fit/fabric.json --out formed "$@"
skfem-textile export formed --deck part.inp --pattern dxf
skfem-textile report formed
