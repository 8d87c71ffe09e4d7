// Two materials: a round inclusion in a square matrix, meshed conformingly across the interface.
SetFactory("OpenCASCADE");
Rectangle(1) = {-1, -1, 0, 2, 2};
Disk(2) = {0.15, 0.1, 0, 0.45};
BooleanFragments{ Surface{1}; Delete; }{ Surface{2}; Delete; }
eps = 1e-3;
inside() = Surface In BoundingBox {-0.3 - eps, -0.35 - eps, -eps, 0.6 + eps, 0.55 + eps, eps};
all() = Surface{:};
all() -= inside();
interface() = Boundary{ Surface{inside()}; };
Physical Surface("inclusion", 1) = {inside()};
Physical Surface("matrix", 2) = {all()};
Physical Curve("interface", 3) = {interface()};
Mesh.MeshSizeMax = 0.07;
