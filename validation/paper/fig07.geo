// A quadrilateral with one bulging side, tilted: four corners of index 1/4, so that the indices inside add up to 0.
h = 0.05;
Point(1) = {-0.4, -1.2, 0, h};
Point(2) = {1.2, 0.1, 0, h};
Point(3) = {0.3, 1.25, 0, h};
Point(4) = {-1.2, 0.15, 0, h};
Point(5) = {-0.75, 0.95, 0, h};
Line(1) = {1, 2};
Line(2) = {2, 3};
Spline(3) = {3, 5, 4};
Line(4) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};
Physical Surface("plate", 1) = {1};
