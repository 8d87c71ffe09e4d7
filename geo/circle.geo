// A disc bounded by one closed curve.  Four singularities of a quarter turn arise inside.
SetFactory("OpenCASCADE");
Disk(1) = {0, 0, 0, 1};
rim() = Boundary{ Surface{1}; };
Physical Surface("disc", 1) = {1};
Physical Curve("rim", 2) = {rim()};
Mesh.MeshSizeMax = 0.07;
