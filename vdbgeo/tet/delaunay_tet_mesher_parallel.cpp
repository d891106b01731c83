// The same mesher on CGAL's parallel triangulation: a unit of its own, for each takes the compiler a minute.
#define VDBGEO_PARALLEL_TET_MESHER
#include "vdbgeo/tet/delaunay_tet_mesher.cpp"
