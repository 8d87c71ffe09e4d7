// An ellipse with two round holes: chi = -1, and no corners.
h = 0.06;
Point(1) = {0, 0, 0, h};
Point(2) = {1.5, 0, 0, h};
Point(3) = {0, 1, 0, h};
Point(4) = {-1.5, 0, 0, h};
Point(5) = {0, -1, 0, h};
Ellipse(1) = {2, 1, 2, 3};
Ellipse(2) = {3, 1, 2, 4};
Ellipse(3) = {4, 1, 2, 5};
Ellipse(4) = {5, 1, 2, 2};
For i In {0 : 1}
  c = 10 + 4 * i;
  x = 0.62 * (2 * i - 1);
  Point(c) = {x, 0, 0, h};
  Point(c + 1) = {x + 0.28, 0, 0, h};
  Point(c + 2) = {x - 0.28, 0, 0, h};
  Circle(c) = {c + 1, c, c + 2};
  Circle(c + 1) = {c + 2, c, c + 1};
EndFor
Curve Loop(1) = {1, 2, 3, 4};
Curve Loop(2) = {10, 11};
Curve Loop(3) = {14, 15};
Plane Surface(1) = {1, 2, 3};
Physical Surface("plate", 1) = {1};
