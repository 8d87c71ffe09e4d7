// A disc with two singular points of index 1/4 on its rim: one block has its corner there.  The field needs 1/2 more inside,
// for instance --field "singularities:(-0.4,0):1,(0.4,0):1".
SetFactory("OpenCASCADE");
Point(1) = {1, 0, 0};
Point(2) = {-1, 0, 0};
Point(3) = {0, 0, 0};
Circle(1) = {1, 3, 2};
Circle(2) = {2, 3, 1};
Curve Loop(1) = {1, 2};
Plane Surface(1) = {1};
Physical Surface("disc", 1) = {1};
Physical Curve("rim", 2) = {1, 2};
Physical Point("right index=1/4", 3) = {1};
Physical Point("left index=1/4", 4) = {2};
Mesh.MeshSizeMax = 0.07;
