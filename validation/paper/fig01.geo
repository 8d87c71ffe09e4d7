// A smooth closed curve, a bean: no corners, curved everywhere.
SetFactory("OpenCASCADE");
n = 12;
For i In {0 : n - 1}
  a = 2 * Pi * i / n;
  r = 1 + 0.25 * Cos(2 * a) + 0.12 * Sin(3 * a);
  Point(1 + i) = {1.1 * r * Cos(a), 0.95 * r * Sin(a), 0, 0.06};
EndFor
Spline(1) = {1 : n, 1};
Curve Loop(1) = {1};
Plane Surface(1) = {1};
Physical Surface("bean", 1) = {1};
