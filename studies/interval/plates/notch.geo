// A strip with a rounded notch at one side, triangles.
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 50, 110};
Disk(2) = {50, 56, 0, 11};
BooleanDifference(3) = { Surface{1}; Delete; }{ Surface{2}; Delete; };
Physical Surface("ply") = {3};
eps = 1e-3;
bottom() = Curve In BoundingBox{-eps, -eps, -eps, 50+eps, eps, eps};
top() = Curve In BoundingBox{-eps, 110-eps, -eps, 50+eps, 110+eps, eps};
Physical Curve("bottom") = bottom();
Physical Curve("top") = top();
MeshSize{ PointsOf{ Surface{3}; } } = 3.5;
