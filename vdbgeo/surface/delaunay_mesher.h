// Restricted Delaunay refinement of an implicit surface, behind plain functions: no CGAL and no OpenVDB here.
#pragma once

