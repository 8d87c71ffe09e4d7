// A heat sink: a base with fins in aluminium on a chip; corners of 90 and 270 degrees only.
h = 0.05;
fins = 5;
w = 0.12;
pitch = (2 - w) / (fins - 1);
Point(1) = {0, 0, 0, h};
Point(2) = {0.7, 0, 0, h};
Point(3) = {1.3, 0, 0, h};
Point(4) = {2, 0, 0, h};
Point(5) = {1.3, -0.2, 0, h};
Point(6) = {0.7, -0.2, 0, h};
// fins from right to left
n = 10;
For i In {0 : fins - 1}
  xr = 2 - i * pitch;
  If (i > 0)
    Point(n) = {xr, 0.25, 0, h}; n += 1;
  EndIf
  Point(n) = {xr, 0.8, 0, h}; n += 1;
  Point(n) = {xr - w, 0.8, 0, h}; n += 1;
  If (i < fins - 1)
    Point(n) = {xr - w, 0.25, 0, h}; n += 1;
  EndIf
EndFor
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 10};
For i In {10 : n - 2}
  Line(i) = {i, i + 1};
EndFor
Line(n) = {n - 1, 1};
Line(6) = {2, 6};
Line(7) = {6, 5};
Line(8) = {5, 3};
Curve Loop(1) = {1 : 4, 10 : n - 2, n};
Curve Loop(2) = {6, 7, 8, -2};
Plane Surface(1) = {1};
Plane Surface(2) = {2};
Physical Surface("aluminium", 1) = {1};
Physical Surface("chip", 2) = {2};
Physical Curve("cooled", 3) = {10 : n - 2};
