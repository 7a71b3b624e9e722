// A block 2 x 2 x 1 whose bottom is part of a cylinder, lowest in the middle, for `contact_size --mesh`:
//     gmsh -3 -setnumber h 0.032 examples/data/curved_block.geo -o curved_block.msh
// h is the size of the tetrahedra: 0.032 makes 317 385 displacements (Gmsh 4.15).
SetFactory("OpenCASCADE");
DefineConstant[ h = 0.2 ];
depth = 0.15;
radius = (1 + depth * depth) / (2 * depth);
Box(1) = {0, 0, -1, 2, 2, 2};
Cylinder(2) = {1, -1, radius - depth, 0, 4, 0, radius};
BooleanIntersection(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };
e = 1e-3;
Physical Volume("body") = {3};
Physical Surface("left") = Surface In BoundingBox{-e, -e, -1, e, 2 + e, 1 + e};
Physical Surface("right") = Surface In BoundingBox{2 - e, -e, -1, 2 + e, 2 + e, 1 + e};
Physical Surface("top") = Surface In BoundingBox{-e, -e, 1 - e, 2 + e, 2 + e, 1 + e};
Physical Surface("bottom") = Surface In BoundingBox{-e, -e, -1, 2 + e, 2 + e, 0.5};
Mesh.MeshSizeMin = h;
Mesh.MeshSizeMax = h;
