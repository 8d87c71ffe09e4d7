// A triangle of three bulging sides, with the index 1/4 at every corner.
h = 0.06;
Point(1) = {-1, -0.6, 0, h};
Point(2) = {1.1, -0.5, 0, h};
Point(3) = {0.1, 1.1, 0, h};
Point(4) = {0.05, -0.85, 0, h};
Point(5) = {0.9, 0.45, 0, h};
Point(6) = {-0.75, 0.4, 0, h};
Spline(1) = {1, 4, 2};
Spline(2) = {2, 5, 3};
Spline(3) = {3, 6, 1};
Curve Loop(1) = {1, 2, 3};
Plane Surface(1) = {1};
Physical Point("index=1/4", 1) = {1, 2, 3};
Physical Surface("triangle", 1) = {1};
