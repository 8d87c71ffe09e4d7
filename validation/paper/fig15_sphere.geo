// The unit sphere: no direction can be carried all over it without a zero.
SetFactory("OpenCASCADE");
Sphere(1) = {0, 0, 0, 1};
Physical Surface("sphere", 1) = {1};
Mesh.MeshSizeMax = 0.2;
