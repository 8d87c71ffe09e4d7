// A plate with a smooth bump beside its middle: a surface of revolution, tangent to the plate all around.
SetFactory("OpenCASCADE");
x = 0.15;
y = -0.1;
r = 0.55;
Point(1) = {x + r, y, 0};
Point(2) = {x + 0.65 * r, y, 0};
Point(3) = {x + 0.55 * r, y, 0.4};
Point(4) = {x, y, 0.4};
BSpline(1) = {1 : 4};
Extrude { {0, 0, 1}, {x, y, 0}, 2 * Pi } { Curve{1}; }
rim() = Curve In BoundingBox {x - 1.01 * r, y - 1.01 * r, -0.01, x + 1.01 * r, y + 1.01 * r, 0.01};
Point(11) = {-1, -1, 0};
Point(12) = {1, -1, 0};
Point(13) = {1, 1, 0};
Point(14) = {-1, 1, 0};
Line(11) = {11, 12};
Line(12) = {12, 13};
Line(13) = {13, 14};
Line(14) = {14, 11};
Curve Loop(21) = {11 : 14};
Curve Loop(22) = {rim()};
Plane Surface(11) = {21, 22};
Physical Surface("bump", 1) = {1};
Physical Surface("plate", 2) = {11};
Mesh.MeshSizeMax = 0.08;
