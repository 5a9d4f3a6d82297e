// A ply of 70 mm × 210 mm with a hole of 16 mm in its middle.
// For examples/meshes/hole.py: gmsh -2 -format msh41 hole.geo -o hole.msh
SetFactory("OpenCASCADE");
size = 7;
Rectangle(1) = {0, 0, 0, 70, 210};
Disk(2) = {35, 105, 0, 8, 8};
BooleanDifference(3) = { Surface{1}; Delete; }{ Surface{2}; Delete; };
bottom() = Curve In BoundingBox{-1, -1, -1, 71, 1, 1};
top() = Curve In BoundingBox{-1, 209, -1, 71, 211, 1};
Physical Curve("bottom") = bottom();
Physical Curve("top") = top();
Physical Surface("ply") = {3};
Mesh.MeshSizeMin = 2.5;
Mesh.MeshSizeFromCurvature = 20;
Mesh.MeshSizeMax = size;
