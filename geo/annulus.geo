// An eccentric annulus: two circles that are not concentric, no corner anywhere.
SetFactory("OpenCASCADE");
Disk(1) = {0, 0, 0, 1};
Disk(2) = {0.2, 0, 0, 0.4};
BooleanDifference(3) = { Surface{1}; Delete; }{ Surface{2}; Delete; };
Physical Surface("ring", 1) = {3};
Mesh.MeshSizeMax = 0.07;
