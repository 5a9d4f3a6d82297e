// A 40 mm x 60 mm strip in unstructured quadrilaterals, for examples/meshes/gmsh_mesh.py.
// gmsh -2 -format msh41 strip.geo
h = 8;
Point(1) = {0, 0, 0, h};
Point(2) = {40, 0, 0, h};
Point(3) = {40, 60, 0, h};
Point(4) = {0, 60, 0, h};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};
Physical Curve("bottom") = {1};
Physical Curve("right") = {2};
Physical Surface("ply") = {1};
Mesh.Algorithm = 8; // frontal, for quadrilaterals
Mesh.RecombineAll = 1;
Mesh.SubdivisionAlgorithm = 1; // quadrilaterals only
