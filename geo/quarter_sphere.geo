// A quarter of a sphere between two half circles.
SetFactory("OpenCASCADE");
Sphere(1) = {0, 0, 0, 1, 0, Pi / 2, Pi};
rim() = Boundary { Surface{1}; };
Physical Surface("dome", 1) = {1};
Physical Curve("rim", 2) = {rim()};
Mesh.MeshSizeMax = 0.08;
