// TriMesh to OpenMesh half-edges and back.
#pragma once

