// NACA 0012 with a sharp trailing edge in a box.  Four quads meet at the trailing edge, so its index is -1/2.
// The points follow the thickness formula, spaced like a cosine.
n = 40;
t = 0.12;
h = 0.08;
For i In {0 : 2 * n - 1}
  a = Pi * i / n;
  x = 0.5 * (1 + Cos(a));
  y = 5 * t * (0.2969 * Sqrt(x) - 0.1260 * x - 0.3516 * x^2 + 0.2843 * x^3 - 0.1036 * x^4);
  If (i == 0)
    y = 0;
  EndIf
  If (i <= n)
    Point(1 + i) = {x, y, 0, h};
  Else
    Point(1 + i) = {x, -y, 0, h};
  EndIf
EndFor
Spline(1) = {1 : n + 1};
Spline(2) = {n + 1 : 2 * n, 1};
Point(201) = {-1, -1, 0, h};
Point(202) = {2, -1, 0, h};
Point(203) = {2, 1, 0, h};
Point(204) = {-1, 1, 0, h};
Line(3) = {201, 202};
Line(4) = {202, 203};
Line(5) = {203, 204};
Line(6) = {204, 201};
Curve Loop(1) = {3, 4, 5, 6};
Curve Loop(2) = {1, 2};
Plane Surface(1) = {1, 2};
Physical Surface("air", 1) = {1};
Physical Curve("airfoil", 2) = {1, 2};
Physical Curve("inflow", 3) = {6};
Physical Curve("outflow", 4) = {4};
