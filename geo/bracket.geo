// A bracket: rounded outer corners, a slot and two bolt holes.
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 3, 1.4, 0.3};
Disk(2) = {0.55, 0.7, 0, 0.2};
Disk(3) = {2.45, 0.7, 0, 0.2};
Rectangle(4) = {1.1, 0.55, 0, 0.8, 0.3, 0.149};
BooleanDifference(5) = { Surface{1}; Delete; }{ Surface{2, 3, 4}; Delete; };
Physical Surface("bracket", 1) = {5};
Mesh.MeshSizeMax = 0.07;
