// A strip with a circular hole, triangles.
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 60, 130};
Disk(2) = {27, 62, 0, 9};
BooleanDifference(3) = { Surface{1}; Delete; }{ Surface{2}; Delete; };
Physical Surface("ply") = {3};
eps = 1e-3;
bottom() = Curve In BoundingBox{-eps, -eps, -eps, 60+eps, eps, eps};
top() = Curve In BoundingBox{-eps, 130-eps, -eps, 60+eps, 130+eps, eps};
Physical Curve("bottom") = bottom();
Physical Curve("top") = top();
MeshSize{ PointsOf{ Surface{3}; } } = 4;
