// A trapezium whose bottom and left sides prescribe their numbers of elements: these counts are kept.
h = 0.1;
Point(1) = {0, 0, 0, h};
Point(2) = {2, 0, 0, h};
Point(3) = {1.6, 1, 0, h};
Point(4) = {0.2, 1, 0, h};
Line(1) = {1, 2};
Line(2) = {2, 3};
Line(3) = {3, 4};
Line(4) = {4, 1};
Transfinite Curve {1} = 25;
Transfinite Curve {4} = 13;
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};
Physical Surface("plate", 1) = {1};
Physical Curve("counted", 2) = {1, 4};
