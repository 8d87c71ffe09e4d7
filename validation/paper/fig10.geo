// A square plate with a round hole beside its middle: chi = 0.
h = 0.06;
Point(1) = {-1, -1, 0, h};
Point(2) = {1, -1, 0, h};
Point(3) = {1, 1, 0, h};
Point(4) = {-1, 1, 0, h};
For i In {1 : 4}
  Line(i) = {i, i % 4 + 1};
EndFor
Point(5) = {0.1, 0.05, 0, h};
Point(6) = {0.45, 0.05, 0, h};
Point(7) = {-0.25, 0.05, 0, h};
Circle(5) = {6, 5, 7};
Circle(6) = {7, 5, 6};
Curve Loop(1) = {1, 2, 3, 4};
Curve Loop(2) = {5, 6};
Plane Surface(1) = {1, 2};
Physical Surface("plate", 1) = {1};
