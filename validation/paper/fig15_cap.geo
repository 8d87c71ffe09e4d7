// The part of the unit sphere around its top that is less than 81 degrees away from it; the top is a point of the surface.
SetFactory("OpenCASCADE");
low = Cos(81 * Pi / 180);
Sphere(1) = {0, 0, 0, 1, Asin(low), Pi / 2, 2 * Pi};
