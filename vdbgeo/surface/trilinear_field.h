// Fast samples of a map's trilinear interpolant, for meshers that ask point by point.
#pragma once

