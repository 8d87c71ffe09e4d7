// A disc with three singular points on its rim.
h = 0.06;
Point(1) = {0, 0, 0, h};
angle[] = {0.4, 2.4, 4.6};
For i In {0 : 2}
  Point(2 + i) = {Cos(angle[i]), Sin(angle[i]), 0, h};
EndFor
Circle(1) = {2, 1, 3};
Circle(2) = {3, 1, 4};
Circle(3) = {4, 1, 2};
Curve Loop(1) = {1, 2, 3};
Plane Surface(1) = {1};
Physical Point("index=1/4", 1) = {2, 3, 4};
Physical Surface("disc", 1) = {1};
