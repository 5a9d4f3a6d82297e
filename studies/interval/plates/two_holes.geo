// A strip with two holes, triangles that are finer at the smaller one.
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 50, 120};
Disk(2) = {15, 42, 0, 6};
Disk(3) = {35, 78, 0, 8};
BooleanDifference(4) = { Surface{1}; Delete; }{ Surface{2,3}; Delete; };
Physical Surface("ply") = {4};
eps = 1e-3;
bottom() = Curve In BoundingBox{-eps, -eps, -eps, 50+eps, eps, eps};
top() = Curve In BoundingBox{-eps, 120-eps, -eps, 50+eps, 120+eps, eps};
left() = Curve In BoundingBox{-eps, -eps, -eps, eps, 120+eps, eps};
Physical Curve("bottom") = bottom();
Physical Curve("top") = top();
Physical Curve("left") = left();
MeshSize{ PointsOf{ Surface{4}; } } = 5;
small() = Curve In BoundingBox{8, 35, -1, 22, 49, 1};
MeshSize{ PointsOf{ Curve{small()}; } } = 2;
