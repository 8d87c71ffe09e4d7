// Two arcs that meet at right angles: two boundary points of index 1/4, so that 1 - 2/4 = 1/2 is left for the inside.
// No symmetry: the upper arc bulges to the right.
h = 0.05;
Point(1) = {-1, -0.1, 0, h};
Point(2) = {1, 0.15, 0, h};
Point(3) = {-0.6, 0.5, 0, h};
Point(4) = {0.6, 1.3, 0, h};
Point(5) = {-0.4, -0.55, 0, h};
Point(6) = {0.45, -0.2, 0, h};
Bezier(1) = {1, 5, 6, 2};
Bezier(2) = {2, 4, 3, 1};
Curve Loop(1) = {1, 2};
Plane Surface(1) = {1};
Physical Point("left, index=1/4", 1) = {1};
Physical Point("right, index=1/4", 2) = {2};
Physical Surface("lens", 1) = {1};
