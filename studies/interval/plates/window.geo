// A strip with a square window, quadrilaterals by recombination.
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 56, 125};
Rectangle(2) = {20, 50, 0, 16, 16};
BooleanDifference(3) = { Surface{1}; Delete; }{ Surface{2}; Delete; };
Physical Surface("ply") = {3};
eps = 1e-3;
bottom() = Curve In BoundingBox{-eps, -eps, -eps, 56+eps, eps, eps};
top() = Curve In BoundingBox{-eps, 125-eps, -eps, 56+eps, 125+eps, eps};
right() = Curve In BoundingBox{56-eps, -eps, -eps, 56+eps, 125+eps, eps};
Physical Curve("bottom") = bottom();
Physical Curve("top") = top();
Physical Curve("right") = right();
MeshSize{ PointsOf{ Surface{3}; } } = 4;
Recombine Surface{3};
Mesh.RecombinationAlgorithm = 2;
