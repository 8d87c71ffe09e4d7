// A twisted blade: B-spline surfaces through three airfoil sections, which get smaller from root to tip.
SetFactory("OpenCASCADE");
For k In {0 : 2}
  a = -0.25 * k;
  c = 1 - 0.2 * k;
  p = newp;
  // trailing edge, lower side, leading edge, upper side
  x() = {0.7, 0.3, 0, -0.25, -0.3, -0.25, 0, 0.3};
  y() = {0, -0.02, -0.04, -0.06, 0, 0.1, 0.14, 0.09};
  For i In {0 : 7}
    Point(p + i) = {c * (x(i) * Cos(a) - y(i) * Sin(a)), c * (x(i) * Sin(a) + y(i) * Cos(a)), k};
  EndFor
  Spline(1 + 2 * k) = {p : p + 4};
  Spline(2 + 2 * k) = {p + 4 : p + 7, p};
  Wire(1 + k) = {1 + 2 * k, 2 + 2 * k};
EndFor
ThruSections(1) = {1 : 3};
eps = 1e-3;
root() = Curve In BoundingBox {-1, -1, -eps, 1, 1, eps};
tip() = Curve In BoundingBox {-1, -1, 2 - eps, 1, 1, 2 + eps};
Physical Surface("pressure side", 1) = {1};
Physical Surface("suction side", 2) = {2};
Physical Curve("root", 3) = {root()};
Physical Curve("tip", 4) = {tip()};
Mesh.MeshSizeMax = 0.08;
