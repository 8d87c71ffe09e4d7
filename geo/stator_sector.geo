// A sector of an electric machine: stator iron with two slots (copper), air gap and rotor ring.
SetFactory("OpenCASCADE");
span = 60 * Pi / 180;
Macro Sector
  // face `id` between radii ra, rb and angles fa, fb
  p = newp; c = newc; l = newcl;
  Point(p) = {ra * Cos(fa), ra * Sin(fa), 0};
  Point(p + 1) = {rb * Cos(fa), rb * Sin(fa), 0};
  Point(p + 2) = {rb * Cos(fb), rb * Sin(fb), 0};
  Point(p + 3) = {ra * Cos(fb), ra * Sin(fb), 0};
  Point(p + 4) = {0, 0, 0};
  Line(c) = {p, p + 1};
  Circle(c + 1) = {p + 1, p + 4, p + 2};
  Line(c + 2) = {p + 2, p + 3};
  Circle(c + 3) = {p + 3, p + 4, p};
  Curve Loop(l) = {c, c + 1, c + 2, c + 3};
  Plane Surface(id) = {l};
  Recursive Delete { Point{p + 4}; }
Return
id = 1; ra = 0.40; rb = 0.58; fa = 0; fb = span;
Call Sector;
id = 2; ra = 0.58; rb = 0.62; fa = 0; fb = span;
Call Sector;
id = 3; ra = 0.62; rb = 1.00; fa = 0; fb = span;
Call Sector;
id = 4; ra = 0.62; rb = 0.84; fa = span * 0.14; fb = span * 0.36;
Call Sector;
id = 5; ra = 0.62; rb = 0.84; fa = span * 0.64; fb = span * 0.86;
Call Sector;
f() = BooleanFragments{ Surface{1 : 3}; Delete; }{ Surface{4, 5}; Delete; };
Physical Surface("rotor", 1) = {1};
Physical Surface("air gap", 2) = {2};
Physical Surface("slot A", 3) = {4};
Physical Surface("slot B", 4) = {5};
iron() = Surface{:};
iron() -= {1, 2, 4, 5};
Physical Surface("stator", 5) = {iron()};
Mesh.MeshSizeMax = 0.03;
