#include "vdbgeo/stencil/line_solve.h"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <tuple>

#include "vdbgeo/core/parallel.h"

namespace vdbgeo::stencil {
namespace {

constexpr int dim = 8;

/// Square matrix of which the diagonals −width…width are kept, row by row.
class Band {
 public:
    void reset(int size, int width) {
        size_ = size;
        width_ = width;
        data_.assign(static_cast<std::size_t>(size) * static_cast<std::size_t>(2 * width + 1), 0.0);
    }
    int size() const { return size_; }
    int width() const { return width_; }
    int first(int row) const { return std::max(0, row - width_); }
    int last(int row) const { return std::min(size_ - 1, row + width_); }
    double& at(int row, int column) {
        return data_[static_cast<std::size_t>(row) * static_cast<std::size_t>(2 * width_ + 1) +
                     static_cast<std::size_t>(column - row + width_)];
    }

 private:
    int size_ = 0, width_ = 0;
    std::vector<double> data_;
};

/// a := tridiagonal · b, where row i of the tridiagonal is Σ f_± (v_i − v_{i±1}), f the coefficient of the
/// face behind i.
void multiply(const std::vector<double>& faces, Band& b, Band& a) {
    const int n = b.size();
    a.reset(n, b.width() + 1);
    for (int i = 0; i < n; ++i)
        for (const int side : {-1, 1}) {
            const int other = i + side;
            if (other < 0 || other >= n) continue;
            const double f = faces[static_cast<std::size_t>(std::min(i, other))];
            for (int j = b.first(i); j <= b.last(i); ++j) a.at(i, j) += f * b.at(i, j);
            for (int j = b.first(other); j <= b.last(other); ++j) a.at(i, j) -= f * b.at(other, j);
        }
}

/// Gaussian elimination without pivoting; v becomes the solution.
void eliminate(Band& m, std::vector<double>& v) {
    const int n = m.size();
    for (int k = 0; k < n; ++k)
        for (int i = k + 1; i <= m.last(k); ++i) {
            const double f = m.at(i, k) / m.at(k, k);
            if (f == 0) continue;
            for (int j = k + 1; j <= m.last(k); ++j) m.at(i, j) -= f * m.at(k, j);
            v[static_cast<std::size_t>(i)] -= f * v[static_cast<std::size_t>(k)];
        }
    for (int k = n - 1; k >= 0; --k) {
        double sum = v[static_cast<std::size_t>(k)];
        for (int j = k + 1; j <= m.last(k); ++j) sum -= m.at(k, j) * v[static_cast<std::size_t>(j)];
        v[static_cast<std::size_t>(k)] = sum / m.at(k, k);
    }
}

/// What one thread solves a run with.
struct RunSolver {
    const std::vector<SweepTerm>& terms;
    double weight, c;
    Band matrix, power, product;
    std::vector<double> ones, faces, v;
    std::vector<std::vector<float>> d;  // by term: the diffusivities of the run

    /// Faces between voxel i and the next of a term, times c.
    void find_faces(std::size_t t) {
        faces.assign(v.size(), weight * terms[t].factor * c);
        if (terms[t].diffusivity)
            for (std::size_t i = 0; i + 1 < faces.size(); ++i)
                faces[i] *= 0.5 * (static_cast<double>(d[t][i]) + d[t][i + 1]);
    }

    /// Order 0 alone: the matrix is tridiagonal, symmetric and diagonally dominant. `ones` takes what is
    /// eliminated.
    void solve_tridiagonal() {
        find_faces(0);
        const std::size_t n = v.size();
        ones.resize(n);
        double behind = 0, ratio = 0, value = 0;  // of the row before
        for (std::size_t i = 0; i < n; ++i) {
            const double ahead = i + 1 < n ? faces[i] : 0;
            const double pivot = 1 / (1 + ahead + behind * (1 - ratio));
            value = (v[i] + behind * value) * pivot;
            v[i] = value;
            ones[i] = ratio = ahead * pivot;
            behind = ahead;
        }
        for (std::size_t i = n - 1; i-- > 0;) v[i] += ones[i] * v[i + 1];
    }

    void solve() {
        if (terms.size() == 1 && terms[0].order == 0) return solve_tridiagonal();
        const int n = static_cast<int>(v.size());
        const int width = terms.back().order + 1;
        matrix.reset(n, width);
        for (int i = 0; i < n; ++i) matrix.at(i, i) = 1;
        power.reset(n, 0);
        for (int i = 0; i < n; ++i) power.at(i, i) = 1;
        ones.assign(static_cast<std::size_t>(n), weight);
        int q = 0;
        for (std::size_t t = 0; t < terms.size(); ++t) {
            for (; q < terms[t].order; ++q) {
                multiply(ones, power, product);
                std::swap(power, product);
            }
            find_faces(t);
            multiply(faces, power, product);
            for (int i = 0; i < n; ++i)
                for (int j = product.first(i); j <= product.last(i); ++j) matrix.at(i, j) += product.at(i, j);
        }
        eliminate(matrix, v);
    }
};

/// Bricks in a row along an axis, one behind the other.
struct Column {
    std::size_t begin, end;  // in the sorted list of bricks
};

std::array<int, 3> key(const openvdb::Coord& o, int axis) {
    return {o[(axis + 1) % 3], o[(axis + 2) % 3], o[axis]};
}

/// Goes through the 64 lines of a column of bricks and solves each run of active voxels in them.
void solve_column(const BlockLayout& layout, const std::int32_t* bricks, std::size_t count, int axis,
                  RunSolver& s, float* v) {
    constexpr std::array<int, 3> stride{dim * dim, dim, 1};
    const int step = stride[static_cast<std::size_t>(axis)];
    const int a = stride[static_cast<std::size_t>((axis + 1) % 3)],
              b = stride[static_cast<std::size_t>((axis + 2) % 3)];
    std::vector<std::size_t> places;
    const auto end_run = [&] {
        if (places.size() > 1) {
            s.v.resize(places.size());
            for (std::size_t i = 0; i < places.size(); ++i) s.v[i] = static_cast<double>(v[places[i]]);
            for (std::size_t t = 0; t < s.terms.size(); ++t) {
                if (!s.terms[t].diffusivity) continue;
                s.d[t].resize(places.size());
                for (std::size_t i = 0; i < places.size(); ++i) s.d[t][i] = s.terms[t].diffusivity[places[i]];
            }
            s.solve();
            for (std::size_t i = 0; i < places.size(); ++i) v[places[i]] = static_cast<float>(s.v[i]);
        }
        places.clear();
    };
    for (int line = 0; line < dim * dim; ++line) {
        const int first = line / dim * a + line % dim * b;
        for (std::size_t k = 0; k < count; ++k) {
            const auto brick = static_cast<std::size_t>(bricks[k]);
            for (int i = 0; i < dim; ++i) {
                const int at = first + i * step;
                if (layout.mask(brick)[static_cast<std::size_t>(at >> 6)] >> (at & 63) & 1)
                    places.push_back(brick * BlockField::brick_size + static_cast<std::size_t>(at));
                else
                    end_run();
            }
        }
        end_run();
    }
}

}  // namespace

void solve_lines(const BlockLayout& layout, const std::vector<SweepTerm>& terms, const Vec3d& weights,
                 double c, float* v) {
    if (c == 0) return;
    for (int axis = 0; axis < 3; ++axis) {
        std::vector<std::int32_t> bricks(layout.brick_count());
        for (std::size_t i = 0; i < bricks.size(); ++i) bricks[i] = static_cast<std::int32_t>(i);
        const auto at = [&](std::int32_t i) { return key(layout.origin(static_cast<std::size_t>(i)), axis); };
        tbb::parallel_sort(bricks.begin(), bricks.end(),
                           [&](std::int32_t i, std::int32_t j) { return at(i) < at(j); });
        std::vector<Column> columns;
        for (std::size_t i = 0; i < bricks.size(); ++i) {
            auto before = i > 0 ? at(bricks[i - 1]) : std::array<int, 3>{};
            before[2] += dim;
            if (i == 0 || before != at(bricks[i])) columns.push_back({i, i});
            columns.back().end = i + 1;
        }
        parallel_for(columns.size(), 1, [&](std::size_t i) {
            RunSolver s{terms, weights[axis], c, {}, {}, {}, {}, {}, {}, {}};
            s.d.resize(terms.size());
            solve_column(layout, bricks.data() + columns[i].begin, columns[i].end - columns[i].begin, axis, s,
                         v);
        });
    }
}

}  // namespace vdbgeo::stencil
