// A coupon of 50 mm x 120 mm with a hole of 12 mm: gmsh -2 -format msh22 coupon.geo
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 50, 120};
Disk(2) = {25, 60, 0, 6};
BooleanDifference(3) = { Surface{1}; Delete; }{ Surface{2}; Delete; };
MeshSize{ PointsOf{ Surface{3}; } } = 7;
Mesh.MeshSizeFromCurvature = 10;
Physical Curve("bottom") = Curve In BoundingBox{-1, -1, -1, 51, 1, 1};
Physical Curve("top") = Curve In BoundingBox{-1, 119, -1, 51, 121, 1};
Physical Curve("hole") = Curve In BoundingBox{18, 53, -1, 32, 67, 1};
Physical Surface("ply") = {3};
