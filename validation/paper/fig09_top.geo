// A drop without symmetry: two corners, both of index 1/4.
h = 0.06;
Point(1) = {-0.5, -0.6, 0, h};
Point(2) = {1.1, -0.35, 0, h};
Point(3) = {-0.9, 0.4, 0, h};
Point(4) = {-0.3, 1.1, 0, h};
Point(5) = {0.8, 0.9, 0, h};
Point(6) = {0.2, -0.95, 0, h};
Point(7) = {0.8, -0.85, 0, h};
Bezier(1) = {1, 6, 7, 2};
Bezier(2) = {2, 5, 4, 3, 1};
Curve Loop(1) = {1, 2};
Plane Surface(1) = {1};
Physical Point("index=1/4", 1) = {1, 2};
Physical Surface("drop", 1) = {1};
