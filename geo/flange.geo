// A round flange: a central bore and a circle of six bolt holes.
SetFactory("OpenCASCADE");
bolts = 6;
Disk(1) = {0, 0, 0, 1};
Disk(2) = {0, 0, 0, 0.35};
For i In {0 : bolts - 1}
  a = 2 * Pi * i / bolts;
  Disk(3 + i) = {0.68 * Cos(a), 0.68 * Sin(a), 0, 0.09};
EndFor
BooleanDifference(100) = { Surface{1}; Delete; }{ Surface{2 : 2 + bolts}; Delete; };
eps = 1e-3;
bore() = Curve In BoundingBox {-0.35 - eps, -0.35 - eps, -eps, 0.35 + eps, 0.35 + eps, eps};
Physical Surface("flange", 1) = {100};
Physical Curve("bore", 2) = {bore()};
Mesh.MeshSizeMax = 0.05;
