// Half a torus, open at its two circles.
SetFactory("OpenCASCADE");
Torus(1) = {0, 0, 0, 1, 0.35, Pi};
eps = 1e-3;
ends() = Curve In BoundingBox {-1.35 - eps, -eps, -0.35 - eps, 1.35 + eps, eps, 0.35 + eps};
Physical Surface("torus", 1) = {1};
Physical Curve("ends", 2) = {ends()};
Mesh.MeshSizeMax = 0.1;
