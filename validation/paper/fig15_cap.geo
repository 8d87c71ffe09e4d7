// The part of the unit sphere around its top that is less than 81 degrees away from it; the top is a point of the surface,
// the poles and the seam of its parameters are not.
SetFactory("OpenCASCADE");
low = Cos(81 * Pi / 180);
Sphere(1) = {0, 0, 0, 1};
Rotate {{1, 0, 0}, {0, 0, 0}, Pi / 2} { Volume{1}; }
Box(2) = {-2, -2, low, 4, 4, 2};
cap() = BooleanIntersection { Surface{1}; } { Volume{2}; };
Recursive Delete { Volume{1, 2}; }
top = newp;
Point(top) = {0, 0, 1};
Point{top} In Surface{cap(0)};
rim() = Boundary { Surface{cap(0)}; };
Physical Surface("cap", 1) = {cap(0)};
Physical Curve("rim", 2) = {rim()};
Mesh.MeshSizeMax = 0.1;
