#!/bin/sh -e
# From raw test files, an outline and tools to a report, a deck and a flat pattern.
skfem-textile fit picture-frame frame.txt --frame-side 200 --fabric-side 160 --out shear
skfem-textile fit cantilever droop_warp.csv --weight 6e-6 --fabric shear/fabric.json --out warp
skfem-textile fit cantilever droop_weft.csv --weight 6e-6 --family weft --fabric warp/fabric.json --out weft
skfem-textile run forming --punch punch.stl --die die.stl --travel 30 --outline ply.dxf --fibres 30 --fabric weft/fabric.json --out formed "$@"
skfem-textile export formed --deck part.inp --thickness 0.4 --part-reach 8 --calculix --pattern dxf
skfem-textile report formed
