// A plate with two round holes of different size.
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 2, 1};
Disk(2) = {0.55, 0.5, 0, 0.22};
Disk(3) = {1.4, 0.55, 0, 0.3};
BooleanDifference(4) = { Surface{1}; Delete; }{ Surface{2, 3}; Delete; };
eps = 1e-3;
left() = Curve In BoundingBox {-eps, -eps, -eps, eps, 1 + eps, eps};
right() = Curve In BoundingBox {2 - eps, -eps, -eps, 2 + eps, 1 + eps, eps};
Physical Surface("plate", 1) = {4};
Physical Curve("clamped", 2) = {left()};
Physical Curve("pulled", 3) = {right()};
Mesh.MeshSizeMax = 0.05;
