// A sphere with a circular hole beside its pole.
SetFactory("OpenCASCADE");
Sphere(1) = {0, 0, 0, 1};
Cylinder(2) = {0, 0, 0, 1, -0.8, 1.2, 0.45};
shell() = BooleanDifference { Surface{1}; Delete; } { Volume{2}; Delete; };
rim() = Boundary { Surface{shell()}; };
Physical Surface("shell", 1) = {shell()};
Mesh.MeshSizeMax = 0.15;
