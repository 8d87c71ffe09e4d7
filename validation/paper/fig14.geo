// Three materials: a square plate with a circular hole, and in it two half-discs.
h = 0.08;
For i In {0 : 3}
  Point(1 + i) = {(i == 1 || i == 2) ? 1 : -1, (i >= 2) ? 1 : -1, 0, h};
EndFor
For i In {1 : 4}
  Line(i) = {i, i % 4 + 1};
EndFor
Point(5) = {0, 0, 0, h};
Point(6) = {0.5, 0, 0, h};
Point(7) = {-0.5, 0, 0, h};
Circle(5) = {6, 5, 7};
Circle(6) = {7, 5, 6};
Line(7) = {7, 6};
Curve Loop(1) = {1, 2, 3, 4};
Curve Loop(2) = {5, 6};
Curve Loop(3) = {5, 7};
Curve Loop(4) = {6, -7};
Plane Surface(1) = {1, 2};
Plane Surface(2) = {3};
Plane Surface(3) = {4};
Physical Surface("plate", 1) = {1};
Physical Surface("upper", 2) = {2};
Physical Surface("lower", 3) = {3};
Physical Curve("rim", 4) = {1, 2, 3, 4};
Physical Curve("hole", 5) = {5, 6};
Physical Curve("split", 6) = {7};
