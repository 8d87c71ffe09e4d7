// A pipe with a bend of 90 degrees between two straight pieces.
SetFactory("OpenCASCADE");
r = 0.4;
bend = 1;
length = 1;
Circle(1) = {0, 0, 0, r};
below() = Extrude {0, 0, length} { Curve{1}; };
turn() = Extrude {{0, 1, 0}, {bend, 0, length}, Pi / 2} { Curve{below(0)}; };
beside() = Extrude {length, 0, 0} { Curve{turn(0)}; };
Coherence;
eps = 1e-3;
inlet() = Curve In BoundingBox {-r - eps, -r - eps, -eps, r + eps, r + eps, eps};
outlet() = Curve In BoundingBox {bend + length - eps, -r - eps, length, bend + length + eps, r + eps, 2 * length + 2 * r};
Physical Surface("wall", 1) = {Surface{:}};
Physical Curve("inlet", 2) = {inlet()};
Physical Curve("outlet", 3) = {outlet()};
Mesh.MeshSizeMax = 0.1;
