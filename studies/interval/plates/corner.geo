// An L, quadrilaterals by recombination.
Point(1) = {0, 0, 0, 4}; Point(2) = {55, 0, 0, 4}; Point(3) = {55, 58, 0, 4};
Point(4) = {32, 58, 0, 4}; Point(5) = {32, 118, 0, 4}; Point(6) = {0, 118, 0, 4};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4};
Line(4) = {4, 5}; Line(5) = {5, 6}; Line(6) = {6, 1};
Curve Loop(1) = {1, 2, 3, 4, 5, 6};
Plane Surface(1) = {1};
Recombine Surface{1};
Mesh.RecombinationAlgorithm = 2;
Physical Surface("ply") = {1};
Physical Curve("bottom") = {1};
Physical Curve("top") = {5};
Physical Curve("step") = {3};
