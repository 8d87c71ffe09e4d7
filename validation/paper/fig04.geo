// An ellipse, tilted: a smooth boundary, all singularities are inside.
h = 0.06;
Point(1) = {0, 0, 0, h};
c = Cos(0.6);
s = Sin(0.6);
Point(2) = {1.3 * c, 1.3 * s, 0, h};
Point(3) = {-0.9 * s, 0.9 * c, 0, h};
Point(4) = {-1.3 * c, -1.3 * s, 0, h};
Point(5) = {0.9 * s, -0.9 * c, 0, h};
Ellipse(1) = {2, 1, 2, 3};
Ellipse(2) = {3, 1, 2, 4};
Ellipse(3) = {4, 1, 2, 5};
Ellipse(4) = {5, 1, 2, 2};
Curve Loop(1) = {1, 2, 3, 4};
Plane Surface(1) = {1};
Physical Surface("ellipse", 1) = {1};
