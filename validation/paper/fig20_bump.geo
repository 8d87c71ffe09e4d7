// A plate with a smooth bump off its middle: one B-spline surface through the plate's sides and points on the bump.
SetFactory("OpenCASCADE");
n = 12;
For k In {0 : n}
  y = -1 + 2 * k / n;
  p = newp;
  For i In {0 : n}
    x = -1 + 2 * i / n;
    s = ((x - 0.15)^2 + (y + 0.1)^2) / 0.16;
    Point(p + i) = {x, y, 0.5 * Exp(-s) * (1 - x^2) * (1 - y^2)};
  EndFor
  Spline(1 + k) = {p : p + n};
  Wire(1 + k) = {1 + k};
EndFor
ThruSections(1) = {1 : n + 1};
Physical Surface("plate", 1) = {Surface{:}};
Mesh.MeshSizeMax = 0.08;
